"""The library of effects: differences between a rig and its nominal model.

An entry is data, and holds all that a diagnosis uses of its effect: a name, the stage where it
acts, the keys of the rig file that it frees, with bounds and start values, and options of the
screen, the fit and the plot. The effects of loader, linkage and airframe have modules of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.airframe import AIRFRAME, MOTION_ZEROS
from coupled.gap.effects.effect import (
    BY_REGRESSOR,
    EXACT,
    UNIT,
    Effect,
    Sampled,
    added,
    entry,
    factor,
    keys_of,
    limit,
    regressor_unit,
    value,
)
from coupled.gap.effects.linkage import LINKAGE, without_servo
from coupled.gap.effects.loader import LOADER
from coupled.gap.effects.seen import hums
from coupled.gap.signals.missed import shares_missed, spread_of_missed, times_missed
from coupled.gap.thresholds import CLOCK_s
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

MOTION = "motion_skew"
# A time stamp error of the force, and a delay of the force.
STAMP, LAG = "force_skew", "transport_delay"
WHOLE_s = 1e4  # a zoom that shows the whole record

EFFECTS: tuple[Effect, ...] = (
    entry(
        *("schedule", "pressure_lag", ("pressure", "gradient", "loop", 6.0)),
        value("lag_s", "schedule.pressure_lag_s", 0, 10, 0.3),
    ),
    entry(
        *("schedule", "pressure_scale", ("pressure", "gradient", "law", WHOLE_s)),
        factor("schedule.pressure_scale", 1.05),
    ),
    entry(
        *("schedule", "schedule_slope", ("pressure", "gradient", "law", WHOLE_s)),
        factor("schedule.slope", 1.05),
    ),
    *LOADER,
    entry(
        *("sensing", "deflection_scale", ("computed", "computed_left")),
        factor("sensing.deflection_scale", 1.03),
    ),
    entry(
        *("sensing", "force_scale", ("force", "missing")),
        factor("sensing.force_scale", 1.03),
        outputs=("loader", "linkage"),
    ),
    entry(
        *("sensing", "force_zero", ("force", "missing")),
        added("offset_N", "sensing.force_zero_N", -100, 100, 1.0),
        outputs=("loader", "linkage"),
    ),
    entry(
        *("sensing", "deflection_zero", ("computed", "deflection_left")),
        added("offset_{d}", "sensing.deflection_zero_{d}", -0.2, 0.2, 1e-3),
        outputs=("linkage",),
    ),
    entry(
        *("sensing", "scale_drift", ("computed", "computed_left", "loop", WHOLE_s)),
        added("per_s", "sensing.scale_drift_per_s", -0.05, 0.05, 1e-3),
    ),
    entry(
        *("sensing", "mains_hum", ("", "computed_left", "time", 0.2)),
        added("amplitude_{d}", "sensing.hum_{d}", 0, 0.1, 1e-4),
        # The start sets the scale of difference steps, 0.1 Hz.
        value(
            *("frequency_Hz", "sensing.hum_frequency_Hz", 5, 1000, 0.1),
            role="other",
            kind="aliased",
            model_error=EXACT,
        ),
        value("phase_rad", "sensing.hum_phase_rad", -7, 7, 1.0, role="other", model_error=EXACT),
        seen=hums,
    ),
    entry(
        *("sensing", STAMP, ("speed", "missing")),
        added("delay_s", "sensing.force_stamp_s", -0.3, 0.3, 0.01, tolerance=CLOCK_s),
        outputs=("loader", "linkage"),
    ),
    entry(
        *("sensing", MOTION, ("elevator", "pitch_rate", "loop", 4.0)),
        added("delay_s", "flight.motion_stamp_s", -0.4, 0.4, 0.05, tolerance=CLOCK_s),
        outputs=("airframe",),
    ),
    *MOTION_ZEROS,
    *LINKAGE,
    entry(
        *("compensation", "dropped_frames", ("", "estimate_left", "time", 0.5)),
        added("share", "compensation.missed_share", 0, 0.9, 0.3, model_error=EXACT),
        outputs=("schedule", "multiplier", "compensation"),
        sampled=Sampled(spread_of_missed, times_missed),
        seen=shares_missed,
    ),
    entry(
        *("surface", "cable_stretch", ("pressure", "ratio")),
        added("loss_per_Pa", "rigging.stretch_loss_per_Pa", 0, 1e-2, 1e-5),
    ),
    entry(
        *("surface", "surface_lag", ("wanted_rate", "answer_left", "law", 1.5)),
        added("lag_s", "rigging.lag_s", 0, 3, 0.05),
    ),
    entry(
        *("surface", "surface_rate_limit", ("wanted_rate", "answer_rate", "law", 1.5)),
        limit("rate_norm_per_s", "rigging.rate_limit_norm_per_s", 1e-2, 50, 0.3, 0.55),
    ),
    entry(
        *("surface", "surface_freeplay", ("wanted", "answer_left", "loop")),
        added("play_norm", "rigging.play_norm", 0, 0.5, 0.01, kind="saturating"),
    ),
    *AIRFRAME,
    entry(
        *("surface", "rigging_offset", ("wanted", "answer_left")),
        added("offset_norm", "rigging.offset_norm", -0.5, 0.5, 0.01),
    ),
)
BY_NAME = {effect.name: effect for effect in EFFECTS}


def library_of(rig: Rig, control: ControlName) -> list[Effect]:
    """Return the library adapted to a rig; of an aircraft alone, the effects of its `flight`.

    A bob weight pulls with the load factor: with one, a time stamp error of the motion also shows
    in the loader. So do errors of a schedule that is a curve, which no channel records. A rig
    without a servo has other effects of a servo (`without_servo`). The effects of a regressor have
    its unit in their names; a rig that names none has none of them.
    """
    if not rig.controls:
        return [one for one in EFFECTS if all(p.key.startswith("flight.") for p in one.parameters)]
    data, further = rig.controls[control], dict[str, tuple[str, ...]]()
    every = list(EFFECTS) if data.loader.servo_frequency else without_servo(EFFECTS)
    if data.schedule.curved:
        of_schedule = (one.name for one in every if one.stage == "schedule")
        further |= dict.fromkeys(of_schedule, ("loader", "multiplier"))
    if rig.flight is not None and data.loader.bob_weight:
        further[MOTION] = ("loader",)
    every = _of_regressor(every, rig, control)
    return [
        replace(one, outputs=(*one.shows_in, *further[one.name])) if one.name in further else one
        for one in every
    ]


def _of_regressor(every: Sequence[Effect], rig: Rig, control: ControlName) -> list[Effect]:
    """Return a library with the effects of the regressor in its unit, or without them."""
    found = []
    for effect in every:
        if not keys_of([effect]) & {*BY_REGRESSOR}:
            found.append(effect)
        elif rig.controls[control].loader.regressor is not None:
            (p,) = effect.parameters
            name = p.name.replace(UNIT, regressor_unit(rig, control))
            found.append(replace(effect, parameters=(replace(p, name=name),)))
    return found
