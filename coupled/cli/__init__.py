"""The command line: parses, calls and prints. Each module has a group of commands."""

from coupled.cli import (
    bench,
    blind,
    calibration,
    campaign,
    document,
    export,
    fit,
    flights,
    gaps,
    live,
    logs,
    maps,
    models,
    new,
    stability,
)
from coupled.cli.app import app, main
from coupled.cli.order import arrange

__all__ = [
    "app",
    "bench",
    "blind",
    "calibration",
    "campaign",
    "document",
    "export",
    "fit",
    "flights",
    "gaps",
    "live",
    "logs",
    "main",
    "maps",
    "models",
    "new",
    "stability",
]

arrange(app)
