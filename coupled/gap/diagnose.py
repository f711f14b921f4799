"""A diagnosis: where the gap lies, which effects cause it, how far it shrinks.

The verdict is `no_gap` where every stage stays within its floor, `effect` where the effects
found close the gap, `ambiguous` where the record cannot tell the first of them from another, and
`unexplained` where structure is left, or none of the library's effects earns its place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from coupled.channels import ControlName, channel
from coupled.errors import InputError
from coupled.gap.airframe import NEEDS, airframe_output, surface_points
from coupled.gap.choose import CLEAR, Choice, gaps, search, stretches
from coupled.gap.effects import STAGES, parameter_name
from coupled.gap.fit import fit, touched
from coupled.gap.stages import Output, Reader, compensation_gap
from coupled.record import Record
from coupled.rig.parameters import Rig

Floats = NDArray[np.float64]
LEAST_s = 10.0  # a shorter record holds too few stretches to hold any out
CLOSED = 0.95  # share of the excess residual that an explanation must take
BOOTSTRAPS = 400


def diagnose(
    rig: Rig, record: Record, control: ControlName, file: object = "record"
) -> tuple[dict[str, Any], Rig]:
    """Return a diagnosis, as its JSON has it, and the rig with the effects found.

    Raises InputError where the record and the rig cannot be held against each other.
    """
    _check(rig, record, control, file)
    reader = Reader(rig, record, control, surface_points)
    airframe = airframe_output(rig, record) if control == "column" else None
    outputs = reader.outputs() + ([] if airframe is None else [airframe])
    if not outputs:
        lacking = sorted({name for names in reader.missing().values() for name in names})
        raise InputError(file, "", "lets no stage be judged; it lacks " + ", ".join(lacking))
    choice = search(rig, control, outputs)
    if choice.steps:
        # What noise leaves depends on the rig: the improved one has floors of its own.
        improved = replace(reader, rig=choice.fit.rig).outputs()
        choice = replace(choice, after={**choice.after, **gaps(improved, choice.fit.rig)})
    stages = _stages(reader, outputs, choice)
    diagnosis = {
        "verdict": _verdict(choice, stages),
        "stages": stages,
        "effects": _effects(choice, control),
        "rivals": [[s.effect.name, *s.rivals] for s in choice.steps if s.rivals],
        "shrink": _shrink(rig, control, outputs, choice),
    }
    return diagnosis, choice.fit.rig


def _check(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    if control not in rig.controls:
        raise InputError(file, control, f"the rig has no {control}")
    time = record.time_s
    steps = np.diff(time)
    rate = 1.0 / float(np.median(steps))
    if abs(rate / rig.frame_rate - 1.0) > 1e-3:
        raise InputError(
            file, "time_s", f"runs at {rate:.4g} Hz, the rig at {rig.frame_rate:g} Hz: another rig?"
        )
    gap = np.flatnonzero(np.abs(steps * rig.frame_rate - 1.0) > 0.01)
    if gap.size:
        raise InputError(file, "time_s", f"has a gap or a jump after {time[gap[0]]:.3f} s")
    if len(time) < LEAST_s * rig.frame_rate:
        raise InputError(file, "", f"is {time[-1] - time[0]:.1f} s long; {LEAST_s:g} s are needed")
    for name in record.channels:
        if not np.all(np.isfinite(record[name])):
            row = int(np.argmax(~np.isfinite(record[name])))
            raise InputError(file, name, f"row {row + 2} holds no number")
    _check_channels(rig, record, control, file)


def _check_channels(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Refuse a channel that is stuck, a copy of another, or in another unit."""
    names = [channel(control, q) for q in ("force", "computed", "deflection")]
    present = [name for name in names if name in record]
    for i, name in enumerate(present):
        if np.ptp(record[name]) == 0.0:
            raise InputError(file, name, "never changes: a sensor that is stuck")
        for other in present[:i]:
            if np.array_equal(record[name], record[other]):
                raise InputError(file, name, f"is a copy of {other}")
    gradient, pressure = channel(control, "gradient"), "dynamic_pressure_Pa"
    told = gradient in record and pressure in record
    if told and np.ptp(record[pressure]) == 0.0 and np.ptp(record[gradient]) > 0.0:
        raise InputError(file, pressure, f"never changes, while {gradient} does: it is stuck")
    data = rig.controls[control]
    for name in present[1:] if names[0] in present else present:
        most = float(np.max(np.abs(record[name])))
        if most > 3.0 * data.travel:
            raise InputError(
                file, name, f"reaches {most:.3g}, beyond {data.travel:g}: is it in another unit?"
            )
    _check_force_unit(rig, record, control, file)


def _check_force_unit(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Refuse a force whose size against gradient and deflection is that of pounds."""
    names = [channel(control, q) for q in ("force", "computed", "gradient")]
    if any(name not in record for name in names):
        return
    force, computed, gradient = (record[name] for name in names)
    expected = gradient * computed
    if not expected.any():
        return
    ratio = float(force @ expected) / float(expected @ expected)
    if abs(ratio * 4.448 - 1.0) < 0.25:
        raise InputError(
            file, names[0], f"is {ratio:.2f} of what deflection and gradient say: it is in pounds"
        )


def _stages(reader: Reader, outputs: Sequence[Output], choice: Choice) -> dict[str, Any]:
    lacking = reader.missing()
    lacking.pop("multiplier", None)
    if reader.rig.flight is None:
        lacking.pop("surface", None)
    before: dict[str, float] = {}
    after: dict[str, float] = {}
    for output in outputs:
        # F_mod alone says nothing of the loader's motion.
        stage = "loader" if output.stage == "multiplier" else output.stage
        before[stage] = max(before.get(stage, 0.0), choice.before[output.channel])
        after[stage] = max(after.get(stage, 0.0), choice.after[output.channel])
    blamed = {step.effect.stage for step in choice.steps}
    found: dict[str, Any] = {}
    for stage in STAGES:
        if stage in before and stage not in lacking:
            left = not _closed(before[stage], after[stage])
            guilty = stage in blamed or (before[stage] > CLEAR and left)
            found[stage] = {"gap": before[stage], "left": after[stage], "guilty": guilty}
        elif stage in lacking:
            found[stage] = {"judged": False, "missing": lacking[stage]}
        elif stage == "schedule":  # a gradient that never changes tells nothing of it
            found[stage] = {"judged": False, "missing": []}
    scale = [choice.before[o.channel] for o in outputs if o.stage in ("loader", "linkage")]
    if scale:
        found["sensing"] = {"gap": max(scale) if "sensing" in blamed else 1.0}
        found["sensing"]["guilty"] = "sensing" in blamed
    if "compensation" not in lacking:
        gap = compensation_gap(reader)
        found["compensation"] = {"gap": gap, "guilty": gap > CLEAR}
    if reader.rig.flight is not None and "airframe" not in before:
        missing = [name for name in NEEDS if name not in reader.record]
        found["airframe"] = {"judged": False, "missing": missing}
    return found


def _closed(before: float, after: float) -> bool:
    """Tell whether an explanation takes the gap: to its floor, or all but a twentieth of it."""
    return after <= CLEAR or (before > 1.0 and (before - after) / (before - 1.0) >= CLOSED)


def _verdict(choice: Choice, stages: dict[str, Any]) -> str:
    blamed = {step.effect.stage for step in choice.steps}
    left = [
        stage
        for stage, found in stages.items()
        if found.get("guilty")
        and (stage not in blamed or not _closed(found["gap"], found.get("left", 1.0)))
        and stage != "sensing"
    ]
    if left:
        return "unexplained"
    if not choice.steps:
        return "no_gap"
    return "ambiguous" if choice.steps[0].rivals else "effect"


def _effects(choice: Choice, control: ControlName) -> list[dict[str, Any]]:
    found = []
    for step in sorted(choice.steps, key=lambda s: -s.gain):
        effect, values = step.effect, {}
        for p in effect.free:
            key = f"{effect.name}.{p.name}"
            low, high = choice.fit.low[key], choice.fit.high[key]
            values[parameter_name(p, control)] = {
                "value": choice.fit.values[key],
                "low": low if math.isfinite(low) else None,
                "high": high if math.isfinite(high) else None,
            }
        found.append(
            {
                "name": effect.name,
                "stage": effect.stage,
                "probability": step.probability,
                "parameters": values,
            }
        )
    return found


def _shrink(
    rig: Rig, control: ControlName, outputs: Sequence[Output], choice: Choice
) -> dict[str, Any]:
    """Return how far the widest gap shrinks, fitted on every other stretch, held out between."""
    number = stretches(len(outputs[0].measured), rig.frame_rate)
    fitted_on = number % 2 == 0
    effects = choice.fit.effects
    found = fit(rig, control, outputs, effects, fitted_on, choice.fit.values).rig
    pool = touched(outputs, effects) if effects else list(outputs)
    worst = max(pool, key=lambda output: choice.before[output.channel])
    old, new = worst.residual(rig) ** 2, worst.residual(found) ** 2
    held = np.unique(number[~fitted_on])
    means = np.array([[old[number == b].mean(), new[number == b].mean()] for b in held])
    before, after = np.sqrt(means.mean(axis=0))
    result = {
        "channel": worst.channel,
        "before": float(before * worst.floor),
        "after": float(after * worst.floor),
        "floor": worst.floor,
        "stretches": len(held),
    }
    if effects and before > 1.0:
        picks = np.random.default_rng(7).integers(0, len(held), (BOOTSTRAPS, len(held)))
        drawn = np.sqrt(means[picks].mean(axis=1))
        closed = (drawn[:, 0] - drawn[:, 1]) / np.maximum(drawn[:, 0] - 1.0, 1e-9)
        result["closed"] = float((before - after) / (before - 1.0))
        result["low"], result["high"] = np.percentile(closed, [2.5, 97.5]).tolist()
    return result


def in_words(diagnosis: dict[str, Any], control: str) -> str:
    """Return the two or three sentences that an engineer can repeat."""
    verdict, effects = diagnosis["verdict"], diagnosis["effects"]
    guilty = [stage for stage, found in diagnosis["stages"].items() if found.get("guilty")]
    if verdict == "no_gap":
        unjudged = [stage for stage, found in diagnosis["stages"].items() if "gap" not in found]
        but = f" Not judged: {', '.join(unjudged)}." if unjudged else ""
        within = "every stage that could be judged stays within its noise"
        return f"No gap in the {control}: {within}.{but}"
    named = "; ".join(_one_in_words(effect) for effect in effects)
    shrink = diagnosis["shrink"]
    share = f" It closes {100 * shrink['closed']:.0f} % of the gap." if "closed" in shrink else ""
    if verdict == "unexplained":
        also = f" Found nevertheless: {named}." if effects else ""
        return f"A gap in the {', '.join(guilty)} that no effect of the library explains.{also}"
    rivals = "; ".join(" or ".join(group) for group in diagnosis["rivals"])
    doubt = f" The record cannot tell {rivals}." if verdict == "ambiguous" else ""
    return f"The gap lies in the {', '.join(guilty)}: {named}.{share}{doubt}"


def _one_in_words(effect: dict[str, Any]) -> str:
    numbers = ", ".join(
        f"{name} {found['value']:.4g}"
        + (
            f" ({found['low']:.4g} to {found['high']:.4g})"
            if found["low"] is not None and found["high"] is not None
            else ""
        )
        for name, found in effect["parameters"].items()
    )
    name = cast(str, effect["name"]).replace("_", " ")
    return f"{name}, {numbers}" if numbers else name
