"""Commands on results: compare, assess."""

from fifthwheel.cli.results import assess, compare  # noqa: F401 - importing a command registers it
