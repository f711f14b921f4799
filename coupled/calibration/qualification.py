"""A control's checks in the form of a qualification test guide.

A test is a row of the rule's table, a case of it a dynamic pressure, with its conditions,
tolerances and results. Numbers are those of 14 CFR Part 60, appendix A, table A2A: 2.a is static,
2.b a release.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from coupled.calibration.checks import ControlCheck
from coupled.calibration.documentation import Documentation, FeelCondition
from coupled.calibration.sweeps import THROW, HELD_s, RELEASE_s, SWEEP_s
from coupled.campaign.tolerances import (
    COUNTED,
    FORCE_SHARE,
    HEIGHT_SHARE,
    STATIC,
    TIME_SHARE,
    SURFACE_rad,
)
from coupled.display import System, in_system, pressure_in
from coupled.record.channels import CONTROL_NAMES, ControlName, unit_of
from coupled.rig.equations import specified_gradient
from coupled.rig.guesses import guess_note
from coupled.units import POUND_N, DEGREE_rad, KNOT_m_per_s

NOT_GIVEN = "not given"
_ROUNDING = 1e-6  # of the tolerance: a value below it is printed as 0
Kind = Literal["static", "release"]
_SEA_LEVEL_kg_per_m3 = 1.225
_STATIC = ("breakout", "force", "surface")
_SUBJECT = {"static": "position against force", "release": "let go"}
Rows = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Issue:
    """The subject and issue of a document; all but the hash is given by the user.

    The date is not taken from a clock, so that the same rig gives the same document.
    """

    rig_file: str
    rig_sha256: str
    reference: str
    date: str = ""
    revision: str = ""


@dataclass(frozen=True)
class FeelTest:
    """One case of one test: its conditions, method and results."""

    number: str
    title: str
    kind: Kind
    control: ControlName
    condition: FeelCondition
    conditions: Rows
    tolerances: Rows
    checks: tuple[ControlCheck, ...]

    @property
    def passed(self) -> bool:
        """Whether every check of the case is within its tolerance."""
        return all(check.passed for check in self.checks)


def written(number: float) -> str:
    """Return a number in three digits, or as an integer if it is large."""
    return f"{number:.0f}" if abs(number) >= 100.0 else f"{number:.3g}"


def check_numbers(check: ControlCheck, system: System = "si") -> tuple[str, str, str, str]:
    """Return what a check measured, its reference, its tolerance, and their unit, as text."""
    unit = in_system(check.unit, system)
    values = (check.measured, check.reference, check.tolerance)
    least = _ROUNDING * check.tolerance
    measured, reference, allowed = (
        written(unit.factor * value if abs(value) > least else 0.0) for value in values
    )
    return measured, reference, allowed, unit.unit


def cover_rows(documents: Sequence[Documentation], issue: Issue, version: str) -> Rows:
    """Return the content of a document's cover, in rows of name and value."""
    rig = documents[0].rig
    note = guess_note(rig.controls, [found.control for found in documents])
    return (
        ("rig", rig.name),
        *((("guesses", note),) if note else ()),
        ("rig file", issue.rig_file),
        ("SHA-256 of the rig file", issue.rig_sha256),
        ("aircraft model", "none, on the bench" if rig.flight is None else rig.flight.model),
        ("controls", ", ".join(found.control for found in documents)),
        ("reference", issue.reference),
        ("rule", "14 CFR Part 60, appendix A, table A2A, 2.a and 2.b.1 to 2.b.3"),
        ("revision", issue.revision or NOT_GIVEN),
        ("date", issue.date or NOT_GIVEN),
        ("made by", f"coupled {version}, a simulation of the rig that the file describes"),
    )


def feel_tests(found: Documentation, reference: str, system: System = "si") -> Iterator[FeelTest]:
    """Yield a control's tests, the static ones first, a case for each dynamic pressure.

    `reference` names the reference of the results.
    """
    kinds: tuple[Kind, ...] = ("static", "release")
    for kind in kinds:
        for i, condition in enumerate(found.conditions, 1):
            checks = tuple(
                check
                for check in found.checks
                if check.pressure_Pa == condition.pressure_Pa and _kind(check) == kind
            )
            yield FeelTest(
                number=f"{_entry(found.control, kind)}-{i}",
                title=f"{found.control}, {_SUBJECT[kind]}",
                kind=kind,
                control=found.control,
                condition=condition,
                conditions=(*_conditions(found, condition, system), *_method(kind, reference)),
                tolerances=tuple(_tolerances(found, kind)),
                checks=checks,
            )


def _kind(check: ControlCheck) -> Kind:
    return "static" if check.name.startswith(_STATIC) else "release"


def _entry(control: ControlName, kind: Kind) -> str:
    """Return the entry of the rule's table: column, wheel and pedals are 1, 2 and 3."""
    return f"2.{'a' if kind == 'static' else 'b'}.{CONTROL_NAMES.index(control) + 1}"


def _conditions(
    found: Documentation, condition: FeelCondition, system: System
) -> Iterator[tuple[str, str]]:
    """Yield the conditions of a test."""
    rig, data, d = found.rig, found.rig.controls[found.control], unit_of(found.control)
    pressure = condition.pressure_Pa
    airspeed = math.sqrt(2.0 * pressure / _SEA_LEVEL_kg_per_m3)
    yield (
        "feel pressure q̄",
        f"{pressure_in(pressure, system, 3)}, {airspeed:.1f} m/s ({airspeed / KNOT_m_per_s:.0f} kt)"
        " equivalent airspeed, held",
    )
    gradient = float(specified_gradient(data.schedule, pressure))
    unit = in_system(f"N/{d}", system)
    yield "specified gradient G_T there", f"{unit.written(gradient)} {unit.unit}"
    on = {True: "on", False: "off"}
    host = data.compensation
    yield (
        "compensation",
        f"as filed: deflection {on[host.deflection]}, gradient {on[host.gradient]}",
    )
    others = [name for name in rig.controls if name != found.control]
    free = f"{', '.join(others)}: no force on them" if others else "none on this rig"
    yield "other controls", free
    aircraft = "none, on the bench" if rig.flight is None else rig.flight.model
    yield "aircraft", f"{aircraft}; it does not fly: a hand drives the loader, q̄ is held"


def _method(kind: Kind, reference: str) -> Rows:
    """Return the method of a test, and its reference."""
    if kind == "static":
        how = f"from neutral to one stop, to the other and back in {SWEEP_s:g} s, at an even rate"
    else:
        how = f"held {HELD_s:g} s at {100 * THROW:g} % of the travel, let go from rest; both ways,"
        how += f" {RELEASE_s:g} s of each"
    recorded = "force of the hand and true deflection at the grip, position of the surface"
    return (("method", how), ("recorded", recorded), ("reference", reference))


def _tolerances(found: Documentation, kind: Kind) -> Iterator[tuple[str, str]]:
    """Yield the tolerances of the rule."""
    if kind == "static":
        allowed = STATIC[found.control]
        yield "breakout", f"±{allowed.breakout_N:.1f} N ({allowed.breakout_N / POUND_N:g} lb)"
        pounds = f"±{allowed.force_N:.1f} N ({allowed.force_N / POUND_N:g} lb)"
        yield "force", f"±{100 * FORCE_SHARE:g} % or {pounds}, the wider"
        surface = found.rig.controls[found.control].surface
        if found.surface_rad is not None:
            yield surface, f"±{SURFACE_rad[surface] / DEGREE_rad:g}°"
        return
    yield "first zero crossing, or 90 % to 10 %", f"±{100 * TIME_SHARE:g} % of the time"
    yield "period n", f"±{100 * TIME_SHARE:g}·(n + 1) %"
    yield "overshoots", f"±{100 * HEIGHT_SHARE:g} % of the first; above {100 * COUNTED:g} %, ±1"
