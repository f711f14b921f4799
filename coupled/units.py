"""Factors from the units of the field's edges to SI: multiply by them to get SI.

The units that a user's own log may be in stand in a table of names, with their dimension,
so that inches of force are refused and not multiplied.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

from scipy import constants

FOOT_m: Final[float] = constants.foot
INCH_m: Final[float] = constants.inch
KNOT_m_per_s: Final[float] = constants.knot
POUND_N: Final[float] = constants.lbf
PSF_Pa: Final[float] = constants.lbf / constants.foot**2
POUND_PER_INCH_N_per_m: Final[float] = constants.lbf / constants.inch
INCH_PER_POUND_m_per_N: Final[float] = constants.inch / constants.lbf
DEGREE_rad: Final[float] = math.pi / 180.0
MILLISECOND_s: Final[float] = constants.milli

Dimension = tuple[int, int, int, int]  # powers of mass, length, time, angle

# An angle is a dimension of its own here: a log in degrees must not pass for a bare number.
_NONE: Final[Dimension] = (0, 0, 0, 0)
_FORCE: Final[Dimension] = (1, 1, -2, 0)
_LENGTH: Final[Dimension] = (0, 1, 0, 0)
_TIME: Final[Dimension] = (0, 0, 1, 0)
_ANGLE: Final[Dimension] = (0, 0, 0, 1)
_PRESSURE: Final[Dimension] = (1, -1, -2, 0)
_SPEED: Final[Dimension] = (0, 1, -1, 0)
_ACCELERATION: Final[Dimension] = (0, 1, -2, 0)

_WORDS: Final[dict[Dimension, str]] = {
    _NONE: "a bare number",
    _FORCE: "a force",
    _LENGTH: "a length",
    _TIME: "a time",
    _ANGLE: "an angle",
    _PRESSURE: "a pressure",
    _SPEED: "a speed",
    _ACCELERATION: "an acceleration",
    (0, 0, -1, 1): "an angular rate",
    (1, 0, -2, 0): "a force per length",
    (1, 1, -2, -1): "a force per angle",
}


@dataclass(frozen=True)
class Unit:
    """A unit: a quantity in it times `factor` is the quantity in SI."""

    factor: float
    dimension: Dimension

    @property
    def word(self) -> str:
        """What a quantity in this unit is, for people."""
        return _WORDS.get(self.dimension, "another quantity")


_NAMED: Final[dict[str, Unit]] = {
    name: Unit(factor, dimension)
    for dimension, units in {
        _NONE: {"1": 1.0, "%": constants.centi},
        _FORCE: {
            **{"N": 1.0, "daN": 10.0, "kN": constants.kilo},
            **{"lbf": POUND_N, "lb": POUND_N, "ozf": POUND_N / 16.0},
            **{"kgf": constants.kilogram_force, "kp": constants.kilogram_force},
        },
        _LENGTH: {
            **{"m": 1.0, "mm": constants.milli, "cm": constants.centi, "km": constants.kilo},
            **{"in": INCH_m, "ft": FOOT_m},
        },
        _TIME: {
            **{"s": 1.0, "ms": constants.milli, "us": constants.micro, "ns": constants.nano},
            **{"min": constants.minute, "h": constants.hour},
        },
        _ANGLE: {"rad": 1.0, "mrad": constants.milli, "deg": DEGREE_rad},
        _PRESSURE: {
            **{"Pa": 1.0, "hPa": constants.hecto, "kPa": constants.kilo},
            **{"mbar": constants.hecto, "bar": constants.bar},
            **{"psf": PSF_Pa, "psi": constants.psi},
        },
        _SPEED: {
            **{"kt": KNOT_m_per_s, "kts": KNOT_m_per_s, "knots": KNOT_m_per_s},
            **{"mph": constants.mph, "fpm": FOOT_m / constants.minute},
        },
        _ACCELERATION: {"g": constants.g},
    }.items()
    for name, factor in units.items()
}
# Quotients that a message may propose; any other of two named units is understood as well.
_QUOTIENTS: Final = (
    *("m/s", "km/h", "ft/s", "rad/s", "deg/s", "m/s^2", "ft/s^2"),
    *("N/m", "N/mm", "daN/cm", "lbf/in", "lbf/ft", "N/rad", "N/deg", "lbf/rad", "lbf/deg"),
)
_FACTOR: Final = re.compile(r"([A-Za-z]+|1|%)(?:\^?([23]))?")


def parse_unit(text: str) -> Unit | None:
    """Return the unit that a text like `lbf/in`, `[deg/s]` or `m/s²` means, or nothing."""
    plain = text.strip().strip("[]()").strip()
    plain = plain.replace("°", "deg").replace("²", "^2").replace("µ", "u").replace(" ", "")
    if len(plain) > 40:
        return None
    factor, dimension = 1.0, _NONE
    for place, part in enumerate(plain.split("/")):
        match = _FACTOR.fullmatch(part)
        if match is None or match[1] not in _NAMED:
            return None
        power = int(match[2] or 1) * (1 if place == 0 else -1)
        named = _NAMED[match[1]]
        factor *= named.factor**power
        a, b, c, d = (x + power * y for x, y in zip(dimension, named.dimension, strict=True))
        dimension = (a, b, c, d)
    return Unit(factor, dimension)


def units_like(unit: Unit) -> list[str]:
    """Return the names of the units that measure the same quantity."""
    names = [name for name, named in _NAMED.items() if named.dimension == unit.dimension]
    for name in _QUOTIENTS:
        quotient = parse_unit(name)
        if quotient is not None and quotient.dimension == unit.dimension:
            names.append(name)
    return names


def unit_names() -> list[str]:
    """Return the names of all units."""
    return [*_NAMED, *_QUOTIENTS]
