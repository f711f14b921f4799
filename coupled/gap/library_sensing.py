"""The effects of what is read, in the library."""

from __future__ import annotations

from coupled.gap.effect import Effect
from coupled.gap.entries import factor, one

SENSING: tuple[Effect, ...] = (
    one(
        "sensing",
        "deflection_scale",
        factor("sensing.deflection_scale", 1.03),
        *("computed", "computed_left"),
    ),
)
