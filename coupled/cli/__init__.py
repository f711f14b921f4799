"""The command line: parses, calls, prints. A module a group of commands."""

from coupled.cli import bench, calibration, document, flights, gaps
from coupled.cli.app import app, main

__all__ = ["app", "bench", "calibration", "document", "flights", "gaps", "main"]
