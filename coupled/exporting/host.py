"""The host as JSBSim components, once a frame: schedule, ΔG, its readings, δ̂.

The equations are those of `rig/schedule`, `modification`, `sensing` and `compensation`.
"""

from __future__ import annotations

from typing import Any

from coupled.exporting.controlexport import ControlExport
from coupled.exporting.curve import add_curve, sloped
from coupled.exporting.expression import (
    Expr,
    below,
    either,
    greater,
    looked_up,
    prop,
    within,
)
from coupled.exporting.loader import has_extra, modifying
from coupled.rig.equations import total_to_computed
from coupled.units import PSF_Pa

PRESSURE = "aero/qbar-psf"
LOAD_FACTOR = "accelerations/Nz"
BENCH_PRESSURE = "dynamic-pressure-Pa"  # of a rig without aircraft


def pressure(made: ControlExport) -> Expr:
    """Return q̄ in Pa."""
    return prop(PRESSURE) * PSF_Pa if made.rig.flight is not None else made.own(BENCH_PRESSURE)


def converted(value: Expr, step: float, full_scale: float) -> Expr:
    """Return a value after a converter of this step and range; unchanged for step 0."""
    if step == 0.0:
        return value
    return within(step * below(value / step + 0.5), -full_scale, full_scale - step)


def add_schedule(made: ControlExport) -> None:
    """Add the schedule's q̄, and G_T of its table."""
    schedule, d = made.control.schedule, made.d
    made.system.channel("schedule", "G_T(q̄), linear between the table's rows, constant beyond")
    got = schedule.pressure_scale * pressure(made)
    if schedule.pressure_lag > 0.0:
        before = made.own("schedule/pressure-Pa")
        lagged = before + made.frame_gain(schedule.pressure_lag) * (got - before)
        got = either(made.own("live"), lagged, got)
    at = made.add_at_frame("schedule/pressure-Pa", got)
    if schedule.curved:
        return
    tables = {f"gradient-N_per_{d}": schedule.total_gradient}
    if schedule.second_gradient is not None:
        tables[f"second-gradient-N_per_{d}"] = schedule.second_gradient
    for name, table in tables.items():
        says = f"G_T, the specified gradient, N/{d}"
        looked = looked_up(at, schedule.dynamic_pressure, sloped(schedule, table))
        made.add_at_frame(name, looked, out=says if name.startswith("gradient") else "")


def add_modification(made: ControlExport, steps: dict[str, tuple[float, float]]) -> None:
    """Add ΔG, eq. (12) or G_T − G_B, the break and F_extra of appendix C, and the host's output.

    `steps` are its converters' steps and ranges by their names in `rig/sensing`.
    """
    control, d, add = made.control, made.d, made.system.add
    made.system.channel("modification", "ΔG = G_T/(1 − K̂·G_T) − G_B, eq. (12), where corrected")
    loader, host, sensing, schedule = (
        *(control.loader, control.compensation),
        *(control.sensing, control.schedule),
    )
    hybrid = loader.multiplier == "hybrid"
    made_force = 1.0 / sensing.modifying_scale
    scale = made_force * (sensing.computed_scale if hybrid else 1.0)

    def sent(delta: Expr) -> Expr:
        return converted(delta, *steps["gradient"]) if hybrid else delta

    if schedule.curved:
        add_curve(made, scale, sent)
        _add_offset(made)
        return
    first = made.own(f"gradient-N_per_{d}")
    two = schedule.second_gradient is not None
    second = made.own(f"second-gradient-N_per_{d}") if two else first
    bend = add("host/assumed-bend", made.own("gradient-correction") * host.bend)
    preload: Expr | float = control.assumed_breakout if host.breakout_term == "exact" else 0.0
    edge: Expr | float = 0.0
    if schedule.break_deflection > 0.0:
        broken = schedule.break_deflection
        edge = add("host/edge", broken - bend * (preload + first * broken))
        early = add("host/edge-within-bend", 1.0 - greater(edge, 0.0))
        preload = add("host/preload", preload + early * (first - second) * broken)
        first = add("host/first-asked", either(early, second, first))
        edge = either(early, 0.0, edge)
    assumed: Any = bend  # the report's functions work on expressions as on numbers
    asked: dict[str, Any] = {"first": first, "second": second}
    on_computed = {name: total_to_computed(each, assumed) for name, each in asked.items()}
    if has_extra(made):
        more = on_computed["first"] * bend * preload + (preload - control.assumed_breakout)
        made.add_at_frame("host/extra", made_force * more, "F_extra, which appendix C leaves out")
    for name, gradient in on_computed.items():
        if name == "second" and not two:
            continue
        delta = scale * (gradient - control.assumed_basic_gradient)
        made.add_at_frame(f"host/{name}", sent(delta))
    if schedule.break_deflection > 0.0:
        made.add_at_frame("host/break", edge / (sensing.computed_scale if hybrid else 1.0))
    _add_offset(made)


def _add_offset(made: ControlExport) -> None:
    """Add the offset of an analog multiplier, and its drift."""
    loader = made.control.loader
    if loader.multiplier == "hybrid" and (loader.multiplier_offset or loader.multiplier_drift):
        drift = loader.multiplier_drift / made.rig.frame_rate
        frames = either(made.own("live"), made.own("host/frames") + 1.0, 0.0)
        count = made.add_at_frame("host/frames", frames)
        made.add_at_frame("host/offset", loader.multiplier_offset + drift * count)


def add_inertia(made: ControlExport) -> None:
    """Add m, c and the lead on the force by the gradient, if the host sets them."""
    host, loader = made.control.compensation, made.control.loader
    if host.inertia_gradient is None:
        return
    made.system.channel("inertia", "m, c and the force's lead, by the gradient")
    at = made.own(f"gradient-N_per_{made.d}")
    for name, factors, whole in (
        ("mass", host.mass_factor, loader.mass),
        ("damping", host.damping_factor, loader.damping),
        ("lead", host.force_lead, 1.0),
    ):
        if factors:
            table = looked_up(at, host.inertia_gradient, factors)
            made.add_at_frame(f"host/{name}", whole * table)


def add_reading(made: ControlExport, steps: dict[str, tuple[float, float]]) -> None:
    """Add the host's readings of δc and F, and the product of a digital host."""
    sensing, d = made.control.sensing, made.d
    made.system.channel("reading", "δc and F as the host reads them, eq. (2)")
    read = converted(sensing.read_scale * made.own(f"loader-{d}"), *steps["computed"])
    made.add_at_frame(f"computed-{d}", read, out=f"δc as the host reads it, {d}")
    force = converted(sensing.force_scale * made.own("force-held-N"), *steps["force"])
    made.add_at_frame("force-read-N", force, out="F as the host reads it, N")
    if made.control.loader.multiplier == "digital":
        product = modifying(made, made.own(f"computed-{d}"), smooth=False)
        made.add_at_frame("host/held", converted(product, *steps["product"]))
        given = made.own("host/held")
    else:
        given = modifying(made, made.own(f"loader-{d}"), smooth=False)
    made.add_at_frame("modifying-force-N", given, out="F_mod of the host, N")


def add_estimate(made: ControlExport, others: Expr | None) -> None:
    """Add δ̂ = δc + K̂·F, eq. (1) solved for δ; `others` is the bend by other controls, d."""
    d, host = made.d, made.control.compensation
    made.system.channel("compensation", "δ̂ = δc + K̂·F where corrected, else δ̂ = δc")
    bent = host.bend * made.own("force-read-N")
    if others is not None:
        bent = bent + others
    estimate = made.own(f"computed-{d}") + made.own("deflection-correction") * bent
    made.add_at_frame(f"estimate-{d}", estimate, out=f"δ̂, the input of the surface, {d}")


def add_external(made: ControlExport) -> None:
    """Add the constant forces of the next frame: an offset, and the bob weight's."""
    loader = made.control.loader
    made.system.channel("bob weight", "−b·(n_z − 1), and a constant force")
    external = Expr("v", text=repr(loader.offset))
    if made.rig.flight is not None and loader.bob_weight != 0.0:
        external = loader.offset - loader.bob_weight * (prop(LOAD_FACTOR) - 1.0)
    made.add_at_frame("external-N", external)
