"""Effects that pass for others in a faint gap."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Likeness:
    """An effect that passes for a plainer one in a faint gap, and by which values it then does.

    `values` takes the plainer one's values and what the nominal rig has under `base`.
    """

    plainer: str
    base: str
    values: Callable[[Mapping[str, float], float], dict[str, float]]
