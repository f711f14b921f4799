"""How wide a trial's gap is under its nominal rig, measured as a diagnosis measures it."""

from __future__ import annotations

from coupled.gap.airframe import airframe_outputs, surface_points
from coupled.gap.stages import Reader
from coupled.record import Record
from coupled.rig.parameters import Rig


def stage_gaps(rig: Rig, record: Record, airframe: bool = True) -> dict[str, float]:
    """Return each stage's rms residual over its floor under the nominal rig.

    The loader's is the larger of its motion's and its multiplier's, and sensing, which has no
    output of its own, stands at the widest of those that a wrong scale shows in. `airframe`
    says whether to fly for the airframe's, which takes longest.
    """
    outputs = Reader(rig, record, "column", surface_points).outputs()
    if airframe:
        outputs += airframe_outputs(rig, record)
    gaps: dict[str, float] = {}
    for output in outputs:
        stage = "loader" if output.stage == "multiplier" else output.stage
        gaps[stage] = max(output.gap(rig), gaps.get(stage, 0.0))
    shown = [gaps[stage] for stage in ("loader", "linkage") if stage in gaps]
    return gaps | ({"sensing": max(shown)} if shown else {})
