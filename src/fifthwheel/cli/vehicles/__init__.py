"""Commands that show and write vehicle files, one module for each."""

from fifthwheel.cli.vehicles import new, roll_test, show, weigh  # noqa: F401 - importing a command registers it
