"""The command line: parses, calls, prints. A module a group of commands."""

from coupled.cli import flights, gaps, logs
from coupled.cli.app import app, main

__all__ = ["app", "flights", "gaps", "logs", "main"]
