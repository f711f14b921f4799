"""The command line: parses, calls, prints. A module a group of commands."""

from coupled.cli import blind, flights, gaps, logs
from coupled.cli.app import app, main

__all__ = ["app", "blind", "flights", "gaps", "logs", "main"]
