"""Run the command line with ``python -m taxel``."""

from taxel.cli import program

program()
