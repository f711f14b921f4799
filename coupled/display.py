"""Units for display: the displayed unit of an SI quantity, and the conversion factor.

A name ends in its unit, as `force_N` or `peak_rate_rad_per_s`. Displayed are degrees, per cent and
newtons, or in the system `us` pounds, inches, knots and feet. Files and JSON are in SI.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from coupled.units import (
    POUND_N,
    DEGREE_rad,
    FOOT_m,
    GRAVITY_m_per_s2,
    INCH_m,
    INCH_PER_POUND_m_per_N,
    KNOT_m_per_s,
    POUND_PER_INCH_N_per_m,
    PSF_Pa,
)

System = Literal["si", "us"]
SHARES: Final = ("loss", "loss_closed_form", "felt_ratio", "felt_ratio_closed_form")


@dataclass(frozen=True)
class Shown:
    """The displayed unit of a quantity, and the factor from SI.

    `words` name the quantity, if known.
    """

    unit: str
    factor: float = 1.0
    words: str = ""

    @property
    def label(self) -> str:
        """The words with the unit, for an axis or a heading."""
        return self.labelled(self.words)

    def labelled(self, words: str) -> str:
        """Return other words with the unit; without one, the words alone."""
        return f"{words}, {self.unit}" if self.unit else words

    def written(self, value: float, digits: int = 4) -> str:
        """Return a number with `digits` significant digits, without its unit."""
        text = f"{self.factor * value:.{digits}g}"
        return "0" if float(text) == 0.0 else text


def percent(share: float, decimals: int = 1) -> str:
    """Return a share in per cent, without a sign before zero."""
    text = f"{100.0 * share:.{decimals}f}"
    return f"{text.lstrip('-') if float(text) == 0.0 else text} %"


_SI: Final[Mapping[str, Shown]] = {
    "N": Shown("N"),
    "m": Shown("m"),
    "s": Shown("s"),
    "Pa": Shown("Pa"),
    "kg": Shown("kg"),
    "Hz": Shown("Hz"),
    "rad": Shown("°", 1.0 / DEGREE_rad),
    "rad_per_s": Shown("°/s", 1.0 / DEGREE_rad),
    "m_per_s": Shown("m/s"),
    "N_per_m": Shown("N/m"),
    "N_per_rad": Shown("N/°", DEGREE_rad),
    "m_per_N": Shown("m/N"),
    "norm": Shown("%", 100.0),
}
_US: Final[Mapping[str, Shown]] = {
    **_SI,
    "N": Shown("lb", 1.0 / POUND_N),
    "m": Shown("in", 1.0 / INCH_m),
    "Pa": Shown("lb/ft²", 1.0 / PSF_Pa),
    "m_per_s": Shown("kt", 1.0 / KNOT_m_per_s),
    "N_per_m": Shown("lb/in", 1.0 / POUND_PER_INCH_N_per_m),
    "N_per_rad": Shown("lb/°", DEGREE_rad / POUND_N),
    "m_per_N": Shown("in/lb", 1.0 / INCH_PER_POUND_m_per_N),
}
_ALTITUDE: Final = Shown("ft", 1.0 / FOOT_m)


def unit_in(name: str) -> str:
    """Return the unit suffix of a name, as `rad_per_s`, or ""."""
    ends = [unit for unit in _SI if name == unit or name.endswith(f"_{unit}")]
    return max(ends, key=len, default="")


# The same for units as text, factor by factor: N·s/m, N/rad.
_WRITTEN: Final[Mapping[str, Shown]] = {
    "N": Shown("lb", 1.0 / POUND_N),
    "m": Shown("in", 1.0 / INCH_m),
    "rad": Shown("°", 1.0 / DEGREE_rad),
    "Pa": Shown("(lb/ft²)", 1.0 / PSF_Pa),
    "kg": Shown("lb", GRAVITY_m_per_s2 / POUND_N),  # mass
}
_FACTOR = re.compile("[A-Za-z]+")
_POWER: Final[Mapping[str, int]] = {"²": 2, "³": 3}


def in_system(unit: str, system: System = "si") -> Shown:
    """Return the displayed unit for a unit as text, `N·s/m`; in SI the unit is unchanged."""
    if system == "si":
        return Shown(unit)
    factor, under, text, end = 1.0, False, "", 0
    for found in _FACTOR.finditer(unit):
        between = unit[end : found.start()]
        under = under or "/" in between
        one, end = _WRITTEN.get(found[0], Shown(found[0])), found.end()
        power = _POWER.get(unit[end : end + 1], 1)
        factor *= one.factor ** (-power if under else power)
        text += between + one.unit
    text += unit[end:]
    return Shown(text[1:-1] if text == "(lb/ft²)" else text, factor)


def pressure_shown(system: System = "si") -> Shown:
    """Return the displayed unit of a dynamic pressure in Pa: kPa, or lb/ft²."""
    return drawn("Pa", system)


def pressure_in(pressure_Pa: float, system: System = "si", digits: int = 2) -> str:
    """Return a dynamic pressure as text, with `digits` decimals in kPa."""
    unit = pressure_shown(system)
    return f"{unit.factor * pressure_Pa:.{digits}f} {unit.unit}"


def convert(value: float, unit: str, system: System = "si") -> float:
    """Return a quantity converted to the unit of `in_system`."""
    return in_system(unit, system).factor * value


def split_unit(name: str) -> tuple[str, str]:
    """Return a name without its unit suffix, and the unit as text: `play_m` is play, m."""
    words = name.split("_")
    first = len(words)
    if first > 1 and words[-2] == "per":
        words[-1] = _POWERS.get(words[-1], words[-1])
    while first > 1 and words[first - 1] in _PARTS:
        first -= 1
    over, _, under = "·".join(words[first:]).partition("per")
    text = f"{over.strip('·') or '1'}/{under.strip('·')}" if under else over
    return "_".join(words[:first]), text


_POWERS: Final[Mapping[str, str]] = {"m3": "m³", "rad3": "rad³", "s2": "s²"}
_PARTS: Final = frozenset(
    ("N", "m", "s", "rad", "kg", "Pa", "V", "g", "Hz", "per", "norm", "bits", *_POWERS.values())
)


def parameter_label(key: str) -> str:
    """Return the label of a varied key with its unit: `column loader bend, m/N`."""
    *tables, last = key.split(".")
    name, unit = split_unit(last)
    words = [table for table in tables if table not in _TABLES]
    label = " ".join([*words, name.replace("_", " ")])
    return f"{label}, {'of travel' if unit == 'norm' else unit}" if unit else label


# File tables that a label omits.
_TABLES: Final = frozenset(("rig", "controls", "flight", "properties", "event"))


def shown(name: str, system: System = "si") -> Shown:
    """Return the displayed unit of a quantity from its name; names without a unit are unchanged."""
    if name in SHARES:
        return Shown("%", 100.0)
    unit = unit_in(name)
    if system == "us" and unit == "m" and name.startswith("altitude"):
        return _ALTITUDE
    return (_US if system == "us" else _SI).get(unit, Shown(""))


def drawn(name: str, system: System = "si", fine: bool = False) -> Shown:
    """Return the unit of a quantity in figures: as `shown`, but cm, kPa and g in SI.

    `fine` is for residuals and travels: mm instead of cm.
    """
    unit = unit_in(name)
    if name == "load_factor":
        return Shown("g")
    if system == "si" and unit == "m" and not name.startswith("altitude"):
        return Shown("mm", 1000.0) if fine else Shown("cm", 100.0)
    if system == "si" and unit == "Pa":
        return Shown("kPa", 1e-3)
    return shown(name, system)
