"""Conversion factors to SI: multiply by them.

All are exact by definition, and written here as numbers, since libraries of constants load slowly.
A test compares them with scipy's.

The units of a user's own log are in a table of names with their dimensions, so that inches of a
force are refused.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

INCH_m: Final[float] = 0.0254
FOOT_m: Final[float] = 12.0 * INCH_m
KNOT_m_per_s: Final[float] = 1852.0 / 3600.0
GRAVITY_m_per_s2: Final[float] = 9.80665  # standard
POUND_N: Final[float] = 0.45359237 * GRAVITY_m_per_s2
PSF_Pa: Final[float] = POUND_N / FOOT_m**2
POUND_PER_INCH_N_per_m: Final[float] = POUND_N / INCH_m
INCH_PER_POUND_m_per_N: Final[float] = INCH_m / POUND_N
DEGREE_rad: Final[float] = math.pi / 180.0
MILLISECOND_s: Final[float] = 1e-3

Dimension = tuple[int, int, int, int]  # powers of mass, length, time, angle

# An angle has its own dimension: a log in degrees must not pass for a number without unit.
_NONE: Final[Dimension] = (0, 0, 0, 0)
_FORCE: Final[Dimension] = (1, 1, -2, 0)
_TORQUE: Final[Dimension] = (1, 2, -2, 0)
_LENGTH: Final[Dimension] = (0, 1, 0, 0)
_TIME: Final[Dimension] = (0, 0, 1, 0)
_ANGLE: Final[Dimension] = (0, 0, 0, 1)
_PRESSURE: Final[Dimension] = (1, -1, -2, 0)
_SPEED: Final[Dimension] = (0, 1, -1, 0)
_ACCELERATION: Final[Dimension] = (0, 1, -2, 0)

_WORDS: Final[dict[Dimension, str]] = {
    _NONE: "a bare number",
    _FORCE: "a force",
    _TORQUE: "a torque",
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
        """The quantity of this unit, in words."""
        return _WORDS.get(self.dimension, "another quantity")


_NAMED: Final[dict[str, Unit]] = {
    name: Unit(factor, dimension)
    for dimension, units in {
        _NONE: {"1": 1.0, "%": 0.01},
        _FORCE: {
            **{"N": 1.0, "daN": 10.0, "kN": 1e3},
            **{"lbf": POUND_N, "lb": POUND_N, "lbs": POUND_N, "ozf": POUND_N / 16.0},
            **{"kgf": GRAVITY_m_per_s2, "kp": GRAVITY_m_per_s2, "mN": 1e-3},
        },
        _TORQUE: {
            **{"Nm": 1.0, "mNm": 1e-3, "Ncm": 0.01, "daNm": 10.0, "kNm": 1e3},
            **{"kgfcm": 0.01 * GRAVITY_m_per_s2, "kgfm": GRAVITY_m_per_s2, "kpm": GRAVITY_m_per_s2},
            **{
                "ftlbf": POUND_N * FOOT_m,
                "inlbf": POUND_N * INCH_m,
                "inozf": POUND_N * INCH_m / 16,
            },
        },
        _LENGTH: {
            **{"m": 1.0, "mm": 1e-3, "cm": 0.01, "km": 1e3},
            **{"in": INCH_m, "ft": FOOT_m, "um": 1e-6},
        },
        _TIME: {
            **{"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
            **{"min": 60.0, "h": 3600.0, "d": 86_400.0},
        },
        _ANGLE: {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE_rad},
        _PRESSURE: {
            **{"Pa": 1.0, "hPa": 100.0, "kPa": 1e3},
            **{"mbar": 100.0, "bar": 1e5},
            **{"psf": PSF_Pa, "psi": POUND_N / INCH_m**2},
        },
        _SPEED: {
            **{"kt": KNOT_m_per_s, "kts": KNOT_m_per_s, "knots": KNOT_m_per_s},
            **{"mph": 5280.0 * FOOT_m / 3600.0, "fpm": FOOT_m / 60.0},
        },
        _ACCELERATION: {"g": GRAVITY_m_per_s2},
    }.items()
    for name, factor in units.items()
}
# Quotients proposed in messages; other quotients of two known units are accepted as well.
_QUOTIENTS: Final = (
    *("m/s", "km/h", "ft/s", "rad/s", "deg/s", "m/s^2", "ft/s^2"),
    *("N/m", "N/mm", "daN/cm", "lbf/in", "lbf/ft", "N/rad", "N/deg", "lbf/rad", "lbf/deg"),
)
_FACTOR: Final = re.compile(r"([A-Za-z]+|1|%)(?:\^?([23]))?")

# Usual spellings of units, in words, and their symbols in this package.
SPELLINGS: Final[dict[str, str]] = {
    **{"lbf": "lbf", "kgf": "kgf", "n": "N", "m": "m", "um": "um", "mm": "mm", "cm": "cm"},
    **{"in": "in", "ft": "ft", "rad": "rad", "mrad": "mrad", "deg": "deg", "pa": "Pa"},
    **{"kpa": "kPa", "hpa": "hPa", "psf": "psf", "psi": "psi", "mbar": "mbar", "kt": "kt"},
    **{"mph": "mph", "s": "s", "ms": "ms", "us": "us", "ns": "ns", "g": "g"},
    **{"lb": "lbf", "lbs": "lbf", "dan": "daN", "kts": "kt", "knots": "kt", "inch": "in"},
    **{"inches": "in", "degree": "deg", "degrees": "deg", "newton": "N", "sec": "s", "pct": "%"},
    **{"feet": "ft", "metres": "m", "meters": "m", "kn": "kN"},
    **{"deg s": "deg/s", "rad s": "rad/s", "m s": "m/s", "ft s": "ft/s", "mps": "m/s"},
    **{"deg per s": "deg/s", "rad per s": "rad/s", "m per s": "m/s", "ft per s": "ft/s"},
    **{"dps": "deg/s", "km h": "km/h"},
}

_TIMES: Final = re.compile(r"(?<=[A-Za-z])(?: *[·⋅*.-] *| +)(?=[A-Za-z])")


def parse_unit(text: str) -> Unit | None:
    """Return the unit of a text like `lbf/in`, `[deg/s]`, `ft-lb` or `m/s²`, or None.

    A product is read factor by factor: `m·N` is a torque, and not the millinewton `mN`. Products
    are allowed before a `/` only, since `N/mm·s` is ambiguous.
    """
    plain = text.strip().strip("[]()").strip()
    plain = plain.replace("°", "deg").replace("²", "^2").replace("µ", "u")
    if len(plain) > 40:
        return None
    above, *below = plain.split("/")
    factors = [(part, 1) for part in _TIMES.split(above)] + [(part, -1) for part in below]
    factor, dimension = 1.0, _NONE
    for part, sign in factors:
        match = _FACTOR.fullmatch(part.replace(" ", ""))
        if match is None or _TIMES.search(part) or match[1] not in _NAMED:
            return None
        power = int(match[2] or 1) * sign
        named = _NAMED[match[1]]
        factor *= named.factor**power
        a, b, c, d = (x + power * y for x, y in zip(dimension, named.dimension, strict=True))
        dimension = (a, b, c, d)
    return Unit(factor, dimension)


def usual_unit(text: str) -> str:
    """Return the unit that a log's text means, in this package's symbol; "" if it is unknown.

    `LBF`, `Inches` and `sec` are read as well: a log's units come in any case, a map's do not.
    """
    if parse_unit(text) is not None:
        return text
    return SPELLINGS.get(" ".join(re.findall("[^\\W_]+", text.lower())), "")


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
