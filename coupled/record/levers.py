"""Channels of a flight's levers: throttles, flaps, gear and others.

A lever's channel is the model's property, as `fcs/throttle-cmd-norm[1]`, or has its short name in
the record of a log, `throttle_1_norm`; engines count from 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

OF_ENGINES = ("throttle", "mixture", "advance")
_KINDS = "|".join((*OF_ENGINES, "flap", "speedbrake", "spoiler", "gear"))
_PROPERTY = re.compile(rf"(?:fcs|gear)/({_KINDS})-(?:cmd|pos)-norm(?:\[(\d+)\])?")
_CHANNEL = re.compile(rf"({_KINDS})(?:_(\d+))?_norm")


def lever_channel(name: str) -> str:
    """Return the channel of a lever's property in the record of a log; "" for other properties."""
    found = _PROPERTY.fullmatch(name)
    return "" if found is None else "_".join([*filter(None, found.groups()), "norm"])


def levers_of(channels: Iterable[str]) -> dict[str, tuple[str, int]]:
    """Return {channel: (lever, engine)} of those that are levers; a command before a position."""
    found = dict[tuple[str, int], str]()
    for name in sorted(channels, key=lambda one: "-pos-" in one):
        match = _PROPERTY.fullmatch(name) or _CHANNEL.fullmatch(name)
        if match is not None:
            found.setdefault((match[1], int(match[2] or 0)), name)
    return {name: lever for lever, name in found.items()}


def lever_property(kind: str, engine: int = 0) -> str:
    """Return the model's property that commands a lever."""
    name = f"{'gear' if kind == 'gear' else 'fcs'}/{kind}-cmd-norm"
    return f"{name}[{engine}]" if engine else name
