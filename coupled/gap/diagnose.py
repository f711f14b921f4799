"""A diagnosis: where the gap lies, which effects cause it, how far it shrinks.

The verdict is `no_gap` where every stage stays within its floor, `effect` where the effects
found close the gap, `ambiguous` where the record cannot tell the first of them from another, and
`unexplained` where structure is left, or none of the library's effects earns its place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.gap.air import can_tell_air, spread_of_air
from coupled.gap.airframe import airframe_outputs, needs, trim_speed
from coupled.gap.case import Case, Tell
from coupled.gap.checks import check_record, check_trim
from coupled.gap.choose import Choice, bar, search
from coupled.gap.effects import EFFECTS, SETTINGS, STAGES, parameter_name
from coupled.gap.output import CLEAR, Output, stage_gaps, stage_limits
from coupled.gap.shrink import shrink
from coupled.gap.stages import Reader, compensation_gap
from coupled.gap.surfaces import surface_points
from coupled.gap.where import remains, where
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.rig.rig import Rig

# What the search is sure of is right in so many of 100 blind trials; where structure is left, an
# effect found may only imitate what is there.
SURE, DOUBT = 0.97, 0.3


@dataclass(frozen=True)
class Diagnosis:
    """What was found: the JSON's content, the rig with the effects, and what it rests on."""

    found: dict[str, Any]
    improved: Rig
    nominal: Rig
    control: ControlName
    outputs: tuple[Output, ...]
    choice: Choice


def diagnose(
    rig: Rig,
    records: Mapping[str, Record],
    control: ControlName,
    tell: Tell | None = None,
) -> Diagnosis:
    """Hold records of one rig, by their files' names, against it.

    Raises InputError where a record and the rig cannot be held against each other.
    """
    for file, record in records.items():
        check_record(rig, record, control, file)
        if rig.flight is not None:
            check_trim(trim_speed(rig), record, file)
    readers = [
        Reader(rig, record, control, surface_points, i) for i, record in enumerate(records.values())
    ]
    outputs = [output.halved(rig) for output in _outputs(readers)]
    if not outputs:
        lacking = sorted({n for r in readers for names in r.missing().values() for n in names})
        file = next(iter(records))
        raise InputError(file, "", "lets no stage be judged; it lacks " + ", ".join(lacking))
    airs = can_tell_air(list(records.values()))
    library = [effect for effect in EFFECTS if airs or effect.name != "vertical_gust"]

    def refloored(other: Rig) -> Sequence[Output]:
        return _outputs([replace(reader, rig=other) for reader in readers])

    choice = search(rig, control, outputs, library, tell, refloored)
    case = Case(rig, control, outputs, tell, refloored)
    after = case.gaps(choice.fit.rig)
    stages = _stages(readers, outputs, after, choice)
    _tell_where(stages, readers, outputs, choice)
    found = {
        "verdict": _verdict(choice, stages),
        "stages": stages,
        "effects": _effects(choice, control, _spread_of_air(readers, choice), stages),
        "rivals": [
            [s.effect.name, *(r.effect.name for r in s.rivals)] for s in choice.steps if s.rivals
        ],
        "shrink": shrink(case, choice),
        "settings": {
            setting.parameters[0].field: choice.fit.values[f"{setting.name}.factor"]
            for setting in SETTINGS.values()
            if f"{setting.name}.factor" in choice.fit.values
        },
    }
    return Diagnosis(found, choice.fit.rig, rig, control, tuple(outputs), choice)


def _outputs(readers: Sequence[Reader]) -> list[Output]:
    found: list[Output] = []
    for reader in readers:
        found += reader.outputs()
        found += airframe_outputs(reader.rig, reader.record, reader.number)
    return found


def _lacking(readers: Sequence[Reader]) -> dict[str, list[str]]:
    """Return the channels that each stage lacks in every record."""
    each = [reader.missing() for reader in readers]
    shared = {stage: names for stage, names in each[0].items() if all(stage in m for m in each)}
    shared.pop("multiplier", None)
    if readers[0].rig.flight is None:
        shared.pop("surface", None)
    return shared


def _stages(
    readers: Sequence[Reader],
    outputs: Sequence[Output],
    last: Mapping[str, float],
    choice: Choice,
) -> dict[str, Any]:
    lacking = _lacking(readers)
    before = _joined(stage_gaps(outputs, readers[0].rig))
    settled = _joined(stage_gaps(outputs, choice.settled.rig))
    after, limits = _joined(last), _joined(stage_limits(outputs))
    blamed = {step.effect.stage for step in choice.steps}
    found: dict[str, Any] = {}
    for stage in STAGES:
        if stage in before and stage not in lacking:
            guilty = stage in blamed or after[stage] > bar(settled[stage], limits[stage])
            found[stage] = {"gap": before[stage], "settled": settled[stage]}
            found[stage] |= {"limit": limits[stage]}
            found[stage] |= {"left": after[stage], "guilty": guilty}
        elif stage in lacking:
            found[stage] = {"judged": False, "missing": lacking[stage]}
        elif stage == "schedule":
            found[stage] = {"judged": False, "missing": [], "why": "constant gradient"}
        elif stage == "surface" and readers[0].rig.flight is not None:
            why = "the aircraft moves it, too"
            found[stage] = {"judged": False, "missing": [], "why": why}
    scale = [before[stage] for stage in ("loader", "linkage") if stage in before]
    if scale:
        found["sensing"] = {"gap": max(scale) if "sensing" in blamed else 1.0}
        found["sensing"]["guilty"] = "sensing" in blamed
    if "compensation" not in lacking:
        gap = max(compensation_gap(r) for r in readers if "compensation" not in r.missing())
        found["compensation"] = {"gap": gap, "guilty": gap > CLEAR}
    if readers[0].rig.flight is not None and "airframe" not in before:
        missing = [name for name in needs(readers[0].rig) if name not in readers[0].record]
        found["airframe"] = {"judged": False, "missing": missing}
    return found


def _tell_where(
    stages: dict[str, Any], readers: Sequence[Reader], outputs: Sequence[Output], choice: Choice
) -> None:
    """Add to each guilty stage where in it the gap lies, by the output where it is widest."""
    shown = {"sensing": ("loader", "linkage", "multiplier"), "loader": ("loader", "multiplier")}
    for stage, found in stages.items():
        ours = [o for o in outputs if o.stage in shown.get(stage, (stage,))]
        if found.get("guilty") and ours:
            # Without what its settings explain, unless at the end of their tolerance they hide it.
            hidden = found.get("settled", np.inf) <= found.get("limit", 0.0)
            rig = readers[0].rig if hidden else choice.settled.rig
            widest = max(ours, key=lambda o: o.gap(rig))
            reader = readers[widest.record]
            found["where"] = where(widest, rig, reader.record, reader.control)
            if _left(found):
                most = max(ours, key=lambda o: o.gap(choice.fit.rig))
                told = readers[most.record].record
                found["remains"] = remains(most, choice.fit.rig, told, reader.control)


def _joined(gaps: Mapping[str, float]) -> dict[str, float]:
    """Return gaps by the contract's stages: F_mod is the loader's, though judged apart."""
    joined: dict[str, float] = {}
    for stage, gap in gaps.items():
        name = "loader" if stage == "multiplier" else stage
        joined[name] = max(joined.get(name, 0.0), gap)
    return joined


def _left(found: Mapping[str, Any]) -> bool:
    """Tell whether a stage still holds structure that the effects found do not explain."""
    return "left" in found and found["left"] > bar(found["settled"], found["limit"])


def _verdict(choice: Choice, stages: dict[str, Any]) -> str:
    blamed = {step.effect.stage for step in choice.steps}
    left = [
        stage
        for stage, found in stages.items()
        if found.get("guilty") and (stage not in blamed or _left(found))
    ]
    if left:
        return "unexplained"
    if not choice.steps:
        return "no_gap"
    return "ambiguous" if any(step.rivals for step in choice.steps) else "effect"


def _spread_of_air(readers: Sequence[Reader], choice: Choice) -> float:
    """Return the relative standard error of the rms of the gusts, where they were found."""
    if all(effect.name != "vertical_gust" for effect in choice.fit.effects):
        return 0.0
    each = [spread_of_air(reader.record, 1.0 / reader.rig.frame_rate) for reader in readers]
    return float(np.sqrt(np.sum(np.square(each)))) / len(each)


def _effects(
    choice: Choice, control: ControlName, air: float, stages: Mapping[str, Any]
) -> list[dict[str, Any]]:
    found = []
    for step in sorted(choice.steps, key=lambda s: -s.gain):
        effect, values = step.effect, {}
        for p in effect.free:
            key = f"{effect.name}.{p.name}"
            value, low, high = choice.fit.values[key], choice.fit.low[key], choice.fit.high[key]
            if effect.name == "vertical_gust":  # a record meets a sample of the gusts
                low = value - math.hypot(value - low, 1.96 * air * value)
                high = value + math.hypot(high - value, 1.96 * air * value)
            values[parameter_name(p, control)] = {
                "value": value,
                "low": low if math.isfinite(low) else None,
                "high": high if math.isfinite(high) else None,
            }
        found.append(
            {
                "name": effect.name,
                "stage": effect.stage,
                "probability": step.probability * (DOUBT if _left(stages[effect.stage]) else SURE),
                "parameters": values,
            }
        )
    return found
