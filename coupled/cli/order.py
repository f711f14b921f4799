"""The commands in the order in which a user meets them, under the heads of `coupled --help`."""

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
    """Return what a user types for a command or a group of typer's."""
    return str(info.name or info.callback.__name__.replace("_", "-"))


def arrange(app: typer.Typer) -> None:
    """Put each command under its head, and in its place there."""
    place = {name: head for head, names in PANELS.items() for name in names}
    order = {name: i for i, name in enumerate(place)}
    registered: list[Any] = [*app.registered_commands, *app.registered_groups]
    for info in registered:
        info.rich_help_panel = place.get(name_of(info), "Commands")
    app.registered_commands.sort(key=lambda info: order.get(name_of(info), len(order)))
