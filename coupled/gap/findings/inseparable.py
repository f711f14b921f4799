"""Fitted numbers that records determine only together: signatures that nearly cancel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coupled.gap.search.found import Fit, Group
from coupled.gap.thresholds import ALIKE, SHARES_IN

# Why two numbers may act alike, by the last parts of their keys.
WHY = {
    frozenset(("friction", "damping")): "all motion is at one speed",
    frozenset(("friction", "offset")): "all motion is in one direction",
    frozenset(("mass", "basic_gradient")): "all motion is at one frequency",
    frozenset(("servo_frequency", "servo_damping_ratio")): "all motion is slow beside the servo",
}


@dataclass(frozen=True)
class Alike:
    """Numbers that these records do not distinguish, by their keys, and why."""

    keys: tuple[str, ...]
    why: str

    @property
    def words(self) -> str:
        """What is to be said of them."""
        count = {2: "one number", 3: "two numbers"}.get(len(self.keys), "fewer numbers")
        names = " and ".join((", ".join(self.keys[:-1]), self.keys[-1]))
        because = f"{self.why}: " if self.why else ""
        return f"{because}{names} are {count} in these records"

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {"keys": list(self.keys), "why": self.why, "words": self.words}


def alike(group: Group) -> list[Alike]:
    """Return the numbers that were fitted together, and that records determine only together.

    By the small eigenvalues of the signatures' cosines: where each number may be moved as far as
    the others make good again.
    """
    size = np.sqrt(np.diag(group.information))
    moved = size > 0.0
    if moved.sum() < 2:
        return []
    keys = [name.rstrip(".") for name in group.values]  # of numbers without a name of their own
    shown = [key for key, on in zip(keys, moved, strict=True) if on]
    cosines = group.information[np.ix_(moved, moved)] / np.outer(size[moved], size[moved])
    strengths, directions = np.linalg.eigh(cosines)
    found = []
    for strength, direction in zip(strengths, directions.T, strict=True):
        if strength > ALIKE:
            break
        least = SHARES_IN * float(np.max(np.abs(direction)))
        shares = [key for key, d in zip(shown, direction, strict=True) if abs(d) >= least]
        found.append(Alike(tuple(shares), _why(shares)))
    return found


def inseparable(found: Fit) -> tuple[Alike, ...]:
    """Return the numbers of a fit's effects that records determine only together."""
    ours = {effect.value_key(p) for effect in found.effects for p in effect.free}
    each = (one for group in found.groups.values() for one in alike(group))
    return tuple(one for one in each if ours.issuperset(one.keys))


def _why(keys: Sequence[str]) -> str:
    """Return why numbers act alike, where it is known."""
    words = [key.partition(".")[2] for key in keys]
    for pair, why in WHY.items():
        if len(words) == 2 and all(any(w.startswith(name) for w in words) for name in pair):
            return why
    return ""
