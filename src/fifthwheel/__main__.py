"""`python -m fifthwheel` is the command line."""

from fifthwheel.cli import main

main()
