"""`python -m coupled`: the command line."""

from coupled.cli import main

main()
