"""The command line: parses, calls, prints. A module a group of commands."""

from coupled.cli import calibration, flights, gaps
from coupled.cli.app import app, main

__all__ = ["app", "calibration", "flights", "gaps", "main"]
