"""Whether the unit of a surface's position, and not the surface, is the cause of what was found.

A position in shares of the full travel makes the model's surface move too far, by the inverse of
its travel in radians, and a wrong effectiveness explains all of it. Simulators log both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from coupled.gap.findings.result import EffectResult, OtherCause
from coupled.gap.stages.surfaces import surface_channel, surface_points
from coupled.gap.thresholds import TINY
from coupled.record.channels import CONTROL_NAMES, SURFACES, ControlName
from coupled.rig.rig import Rig
from coupled.units import DEGREE_rad


def in_other_unit(rig: Rig, effects: Sequence[EffectResult]) -> list[OtherCause]:
    """Return the units of surfaces that may explain effects.

    They are a surface's effectiveness and, since a trim has the wrong unit too, its zero.
    """
    found = list[OtherCause]()
    for control in CONTROL_NAMES if rig.flight is not None else ():
        surface = SURFACES[control]
        ours = [one for one in effects if one.name == f"{surface}_effectiveness"]
        for unit in (unit for one in ours for unit in _possible(rig, control, one)):
            words = (
                f"{surface_channel(control)} may be in {unit} instead of rad, which acts like this "
                f"{surface} effectiveness: check it, and set unit or scale in the import map."
            )
            found.append(OtherCause(frozenset((ours[0].name, f"{surface}_zero")), words))
    return found


def _possible(rig: Rig, control: ControlName, effect: EffectResult) -> list[str]:
    """Return the units whose size in rad the interval of an effectiveness includes.

    An interval that includes 0 shows no unit.
    """
    (p,) = effect.parameters
    if p.low is None or p.high is None or p.low <= 0.0:
        return []
    return [unit for unit, low, high in _units(rig, control) if p.low <= high and p.high >= low]


def _units(rig: Rig, control: ControlName) -> Iterator[tuple[str, float, float]]:
    """Yield units of a surface's position, and the range of their size in rad."""
    yield "degrees", DEGREE_rad, DEGREE_rad
    points = surface_points(rig, control)
    if points is None:
        return
    low, high = sorted(abs(float(end)) for end in points[1][[0, -1]])
    travel = f"{low:.3g} rad" if high - low < TINY else f"{low:.3g} to {high:.3g} rad"
    for unit, share in (("shares", 1.0), ("per cent", 0.01)):
        yield f"{unit} of its travel ({travel})", share * low, share * high
