"""How large a machine's forces and motions are in its records: the scale of each number.

A number in the unit Nᵃ·dᵇ·sᶜ has the scale Fᵃ·xᵇ·tᶜ, with the rms force F, the rms motion x about
its mean, and the time t = x/v by the rms speed v; kg counts as N·s²/d. Friction of one scale is as
large as the force, a damping of one scale takes all of it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.reading import Reading

# Powers of force, motion and time by the name of a unit; a load factor is a bare number.
POWERS = {
    "N": (1, 0, 0),
    "kg": (1, -1, 2),
    "m": (0, 1, 0),
    "rad": (0, 1, 0),
    "s": (0, 0, 1),
    "Hz": (0, 0, -1),
    "g": (0, 0, 0),
    "1": (0, 0, 0),
}
EXPONENTS = {"²": 2, "³": 3, "2": 2, "3": 3}


@dataclass(frozen=True)
class Scales:
    """The rms of a control's force in N and motion in d, and their time in s, over records."""

    force_N: float
    way: float
    time_s: float

    @classmethod
    def of(cls, readings: Sequence[Reading]) -> Scales | None:
        """Return the scales of records; None where they lack force or motion, or nothing moves."""
        forces, ways, speeds = [], [], []
        for reading in readings:
            names = (reading.name_of(quantity) for quantity in ("computed", "deflection"))
            moved = next((name for name in names if name in reading.record), None)
            if moved is None or reading.name_of("force") not in reading.record:
                continue
            way = smoothed(reading.record[moved])
            forces.append(reading.record[reading.name_of("force")])
            ways.append(way - way.mean())
            speeds.append(rate_of(way, reading.rig.frame_rate))
        if not forces:
            return None
        force, way_d, speed = (
            float(np.sqrt(np.mean(np.concatenate(each) ** 2))) for each in (forces, ways, speeds)
        )
        return cls(force, way_d, way_d / speed) if min(force, way_d, speed) > 0.0 else None

    def size(self, unit: str) -> float | None:
        """Return one scale of a number in a unit as N·s/m; None of another unit."""
        over, _, under = unit.partition("/")
        total = np.zeros(3)
        for side, part in ((1, over), (-1, under)):
            for token in filter(None, part.split("·")):
                name, power = _split(token)
                if name not in POWERS:
                    return None
                total += side * power * np.array(POWERS[name])
        if not total.any():
            return None
        return float(self.force_N ** total[0] * self.way ** total[1] * self.time_s ** total[2])


def _split(token: str) -> tuple[str, int]:
    """Return the name and the power of a part of a unit: m³ is (m, 3)."""
    found = re.fullmatch(r"([A-Za-z]+|1)([²³23]?)", token)
    return (found[1], EXPONENTS.get(found[2], 1)) if found else ("", 1)
