"""The kernels' numbers as functions of rig file numbers that an FMU may change in flight.

`pack` computes the kernels' numbers in Python, by the declarations of the stages. Most are a number
of the file, unchanged. The functions for the others are listed here, so that an FMU computes them
without Python. `numbers` compares both for the exported rig.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from coupled.rig.compiled import entry, stage
from coupled.rig.control import STAGES
from coupled.rig.declaration import first_order_gain
from coupled.rig.friction import CONTACT_DAMPING
from coupled.rig.parameters import Compensation, Control, stop_of
from coupled.rig.surface import COMMAND_SIGN

PRODUCT, GAIN, LARGER, STOP, LEAD, ANY, ROOT = range(7)
ARGUMENTS = 5

_gain = stage(first_order_gain)
_stop = stage(stop_of)


def number(law: int, factor: float, a: float, b: float, c: float, d: float, e: float) -> float:
    """Return a number of the kernels from those of a rig file, by its law."""
    found = 0.0
    if law == PRODUCT:
        found = factor * a * b / (c * d)
    elif law == GAIN:
        found = _gain(a, factor)
    elif law == LARGER:
        found = max(a, b)
    elif law == STOP:
        found = _stop(a, b)
    elif law == LEAD:
        found = factor / (factor + a)
    elif law == ROOT:
        found = factor * math.sqrt(a * b)
    elif law == ANY:
        found = 1.0 if max(a, b, c, d, e) > 0.0 else 0.0
    return found


computed_number = entry(number)


class Law(NamedTuple):
    """A law with its constant factor, and the names of its arguments; a missing one is 1."""

    law: int
    factor: float
    of: tuple[str, ...]


def _same(name: str, factor: float = 1.0) -> Law:
    return Law(PRODUCT, factor, (name,))


def _inverse(name: str, factor: float = 1.0) -> Law:
    return Law(PRODUCT, factor, ("", "", name))


def _any(*names: str) -> Law:
    return Law(ANY, 1.0, (*names, *names[:1] * (ARGUMENTS - len(names))))


def laws(control: Control, frame_s: float, substep_s: float) -> dict[str, Law]:
    """Return {number of the kernels, by its dotted place: its law} of a control.

    Arguments are dotted names of the rig's sections, `loader.mass`; an element of a table has its
    index, `schedule.total_gradient[0]`. Numbers that are not listed are constant in an FMU.
    """
    found = _unchanged(control) | _of_host(control, frame_s) | _of_tables(control, substep_s)
    found |= _of_loader(control, substep_s) | _of_friction(control) | _of_sensing(control, frame_s)
    found |= {
        "linkage.push": _same(f"loader.bend{'' if control.loader.bend_push is None else '_push'}"),
        "linkage.rate_limit": _same("loader.servo_rate_limit"),
        "linkage.acceleration_limit": _same("loader.servo_acceleration_limit"),
        "linkage.share": _same("loader.bend_hysteresis_share"),
        "linkage.width": _same("loader.bend_hysteresis_width"),
        "linkage.contact": _same("loader.play_stiffness"),
        "linkage.delay_substeps": _same("loader.servo_delay", 1.0 / substep_s),
        "services.pull": _same(_side(control, "pull")),
        "services.push": _same(_side(control, "push")),
        "surface.gain": _inverse(_side(control, "pull"), COMMAND_SIGN[control.surface]),
        "surface.gain_push": _inverse(_side(control, "push"), COMMAND_SIGN[control.surface]),
        "surface.stretch": _same("rigging.stretch_loss"),
        "surface.lag_gain": Law(GAIN, frame_s, ("rigging.lag",)),
        "surface.rate_step": _same("rigging.rate_limit", frame_s),
    }
    if control.loader.arc_geometry:
        found["linkage.arc_length"] = _same("length")
    return {f"parameters.{place}": law for place, law in found.items()} | _of_state(control)


def _side(control: Control, side: Literal["pull", "push"]) -> str:
    """Return the field with the travel of a side: its own, or that of both sides."""
    return f"travel_{side}" if getattr(control, f"travel_{side}") else "travel"


def _unchanged(control: Control) -> dict[str, Law]:
    """Return the laws of the kernels' numbers that are the file's as they are."""
    found = {}
    for stage_name, declared in STAGES.items():
        whole, _, section = declared.section.partition(".")
        if whole != "control" or not section:
            continue
        for name in declared.parameters.names or ():
            if name not in declared.derived and isinstance(
                getattr(getattr(control, section), name), float
            ):
                found[f"{stage_name}.{name}"] = _same(f"{section}.{name}")
    return found


def _assumed(host: Compensation, name: str) -> Law:
    """Return the law of a number that the host assumes, by default the loader's own."""
    return _same(f"{'loader' if getattr(host, name) is None else 'compensation'}.{name}")


def _of_host(control: Control, frame_s: float) -> dict[str, Law]:
    host, analog = control.compensation, control.loader.multiplier == "hybrid"
    found = {
        "schedule.pressure_lag_gain": Law(GAIN, frame_s, ("schedule.pressure_lag",)),
        "modification.basic_gradient": _assumed(host, "basic_gradient"),
        "modification.breakout": _assumed(host, "breakout"),
        "modification.break_deflection": _same("schedule.break_deflection"),
        "modification.compensated": _same("compensation.gradient"),
        "modification.made": _inverse("sensing.modifying_scale"),
        "compensation.bend": Law(PRODUCT, 1.0, ("compensation.bend", "compensation.deflection")),
    }
    if analog:
        found["modification.multiplied"] = _same("sensing.computed_scale")
        found["modification.offset"] = _same("loader.multiplier_offset")
        found["modification.drift"] = _same("loader.multiplier_drift", frame_s)
    return found


def _of_tables(control: Control, h: float) -> dict[str, Law]:
    host, schedule = control.compensation, control.schedule
    second = "total_gradient" if schedule.second_gradient is None else "second_gradient"
    columns = {
        "schedule.dynamic_pressure": "schedule.dynamic_pressure",
        "schedule.total_gradient": "schedule.total_gradient",
        "schedule.second_gradient": f"schedule.{second}",
        "inertia.gradient": "compensation.inertia_gradient",
        "inertia.mass_factor": "compensation.mass_factor",
        "inertia.damping_factor": "compensation.damping_factor",
        "inertia.force_lead": "compensation.force_lead",
    }
    found = {}
    for place, name in columns.items():
        section, _, field = name.partition(".")
        column = getattr(host if section == "compensation" else schedule, field)
        for row in range(len(column or [])):
            found[f"{place}[{row}]"] = _same(f"{name}[{row}]")
    if host.inertia_gradient is not None:
        found["inertia.lag"] = _same("compensation.force_lead_lag")
        found["inertia.lag_gain"] = Law(LEAD, h, ("compensation.force_lead_lag",))
    return found


def _of_loader(control: Control, h: float) -> dict[str, Law]:
    found = {
        "loader.ripple": _same("loader.ripple"),
        "loader.ripple_wave": _inverse("loader.ripple_period", 2.0 * math.pi),
        "loader.ripple_phase": _same("loader.ripple_phase"),
        "loader.relaxing": _same("loader.relaxing_stiffness"),
        "loader.relaxing_time": _same("loader.relaxing_time"),
        "loader.delay_substeps": _same("loader.delay", 1.0 / h),
        "loader.travel": _same("travel"),
        "loader.aft": Law(STOP, 1.0, (_side(control, "pull"), "loader.stop_aft")),
        "loader.forward": Law(STOP, 1.0, (_side(control, "push"), "loader.stop_forward")),
        "gauge.mass": _same("sensing.gauge_mass"),
        "gauge.delay_substeps": _same("sensing.gauge_delay", 1.0 / h),
        "gauge.samples": _same("sensing.gauge_sampling", h),
        "sensing.computed_skew": _same("sensing.computed_skew", 1.0 / h),
        "sensing.force_skew": _same("sensing.force_skew", 1.0 / h),
    }
    if control.loader.modifying_lag > 0.0:
        found["loader.lag_gain"] = Law(GAIN, 0.5 * h, ("loader.modifying_lag",))
    return found


def _of_friction(control: Control) -> dict[str, Law]:
    varying = ("loader.friction_pull", "loader.friction_push", "loader.friction_by_load")
    dry = _any("loader.friction", "loader.breakaway", *varying)
    stiffness = "loader.friction_stiffness"
    found = {
        "friction.running": _same("loader.friction"),
        "friction.breakaway": Law(LARGER, 1.0, ("loader.friction", "loader.breakaway")),
        "friction.pull": _same("loader.friction_pull"),
        "friction.push": _same("loader.friction_push"),
        "friction.by_load": _same("loader.friction_by_load"),
        "friction.elastic_share": _same("loader.friction_elastic_share"),
        "friction.dry": dry,
        "friction.varies": _any(*varying),
    }
    if control.loader.friction_stiffness == 0.0:
        return found | {"friction.rigid": dry}
    return found | {
        "friction.stiffness": _same(stiffness),
        "friction.compliance": _inverse(stiffness),
        "friction.contact_damping": Law(ROOT, CONTACT_DAMPING, (stiffness, "loader.mass")),
    }


def _of_sensing(control: Control, frame_s: float) -> dict[str, Law]:
    found = {
        "sensing.read_scale": Law(
            PRODUCT, 1.0, ("sensing.computed_scale", "sensing.deflection_scale")
        ),
        "sensing.scale_drift": _same("sensing.scale_drift", frame_s),
        "sensing.hum_turn": _same("sensing.hum_frequency", 2.0 * math.pi * frame_s),
    }
    if control.sensing.word_length == 0:
        return found
    s2 = ("sensing.s2", "sensing.modifying_scale")
    full = {
        "computed": ("sensing.full_scale", "", "sensing.s1"),
        "force": ("sensing.full_scale", "", "sensing.s3"),
        "product": ("sensing.full_scale", "", *s2),
        "gradient": ("sensing.s1", "sensing.computed_scale", *s2),
    }
    step = 2.0 / 2**control.sensing.word_length
    for of, names in full.items():
        found[f"sensing.{of}_range"] = Law(PRODUCT, 1.0, names)
        found[f"sensing.{of}_step"] = Law(PRODUCT, step, names)
    return found


def _of_state(control: Control) -> dict[str, Law]:
    """Return the laws of the state that holds a number of the file: m and c, unless scheduled."""
    if control.compensation.inertia_gradient is not None:
        return {}
    return {
        "state.loader.mass": _same("loader.mass"),
        "state.loader.damping": _same("loader.damping"),
    }
