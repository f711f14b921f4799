"""The order and headings of the commands in `coupled --help`."""

from __future__ import annotations

from typing import Any

import typer

PANELS = {
    "Fly": ("runs", "compare", "fly", "check", "sweep", "plot", "live"),
    "Your loader": ("bench", "calibrate", "document", "map", "stability"),
    "Simulation and record": ("import", "diagnose", "fit", "blind"),
    "Your aircraft": ("models", "terms", "new", "export"),
}


def name_of(info: Any) -> str:
    """Return the name of a typer command or group."""
    return str(info.name or info.callback.__name__.replace("_", "-"))


def arrange(app: typer.Typer) -> None:
    """Set heading and order of each command."""
    place = {name: head for head, names in PANELS.items() for name in names}
    order = {name: i for i, name in enumerate(place)}
    registered: list[Any] = [*app.registered_commands, *app.registered_groups]
    for info in registered:
        info.rich_help_panel = place.get(name_of(info), "Commands")
    app.registered_commands.sort(key=lambda info: order.get(name_of(info), len(order)))
