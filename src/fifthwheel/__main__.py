"""`python -m fifthwheel` is the command line."""

from fifthwheel.apps.cli import main

main()
