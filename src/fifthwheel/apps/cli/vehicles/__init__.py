"""Commands that show and write vehicle files, one module for each."""

from fifthwheel.apps.cli.vehicles import measure, new, show  # noqa: F401 - importing a command registers it
