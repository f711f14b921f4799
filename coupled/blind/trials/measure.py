"""The gap of a trial under its nominal rig, measured as in a diagnosis."""

from __future__ import annotations

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.fit import fit_alone
from coupled.gap.signals.output import Output
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.record.record import Record
from coupled.rig.rig import Rig


def outputs_of(rig: Rig, record: Record, airframe: bool) -> list[Output]:
    """Return the outputs of a record; `airframe`: with those that need a flight."""
    outputs = Reader(rig, record, "column", surface_points).outputs()
    return outputs + (airframe_outputs(rig, record) if airframe else [])


def stage_gaps(rig: Rig, record: Record, airframe: bool = True) -> dict[str, float]:
    """Return each stage's RMS residual over its noise floor under the nominal rig.

    The loader's is the larger of its motion's and its multiplier's. Sensing has no output of its
    own, so its gap is the largest of those in which a wrong scale shows. `airframe`: with the
    airframe's, which takes longest.
    """
    gaps: dict[str, float] = {}
    for output in outputs_of(rig, record, airframe):
        stage = "loader" if output.stage == "multiplier" else output.stage
        gaps[stage] = max(output.gap(rig), gaps.get(stage, 0.0))
    shown = [gaps[stage] for stage in ("loader", "linkage") if stage in gaps]
    return gaps | ({"sensing": max(shown)} if shown else {})


# Two effects that are one law if the gradient is proportional to q̄.
SAME_LAW = {"pressure_scale": "schedule_slope", "schedule_slope": "pressure_scale"}
ALIKE = 0.02  # noise floors: largest additional residual of the other effect


def alike(rig: Rig, record: Record, effect: str) -> tuple[str, ...]:
    """Return the effects that no record of this rig at these pressures can discriminate from it."""
    if effect not in SAME_LAW:
        return ()
    outputs = outputs_of(rig, record, airframe=False)
    ours = [output for output in outputs if output.stage == "schedule"]
    left = {}
    for name in (effect, SAME_LAW[effect]):
        found = fit_alone(rig, "column", ours, [BY_NAME[name]])
        left[name] = max(output.gap(found.rig) for output in ours)
    return (SAME_LAW[effect],) if left[SAME_LAW[effect]] - left[effect] < ALIKE else ()
