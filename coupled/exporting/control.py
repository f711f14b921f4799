"""One control of a rig as a JSBSim system, stage by stage in the order of the signal chain."""

from __future__ import annotations

import math

from coupled.exporting.controlexport import ControlExport, add_clock, stepping
from coupled.exporting.expression import Expr, Value, either, equal, prop, sine, within
from coupled.exporting.host import (
    BENCH_PRESSURE,
    add_estimate,
    add_external,
    add_inertia,
    add_modification,
    add_reading,
    add_schedule,
)
from coupled.exporting.linkage import Grip, add_hand, add_servo, add_weights, begin, deflection
from coupled.exporting.loader import Motion, add_loader, held
from coupled.exporting.surface import add_surface
from coupled.exporting.system import System
from coupled.record.channels import CONTROL_NAMES, ControlName
from coupled.rig.declaration import Given, Hand
from coupled.rig.packing import crossed_bends
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.sensing import SENSING

HAND_rad_per_s = 6.0  # bandwidth of the hand on an axis, as that of a run's clamp
_CONVERTERS = ("computed", "force", "product", "gradient")


def control_system(rig: Rig, name: ControlName, substeps: int) -> System:
    """Return the system of one control, whose loader takes `substeps` steps in a run of JSBSim."""
    made = ControlExport(rig, name, substeps)
    add_clock(made)
    _add_inputs(made)
    add_weights(made)
    _add_motion(made)
    steps = _converters(made)
    add_schedule(made)
    add_modification(made, steps)
    add_inertia(made)
    add_reading(made, steps)
    add_estimate(made, _crossed(made, assumed=True))
    add_external(made)
    add_surface(made)
    return made.system


def clamp_gains(made: ControlExport, gradient: float) -> tuple[float, float, float]:
    """Return stiffness, damping and integral of a hand that holds the grip at a position."""
    loader, w = made.control.loader, HAND_rad_per_s
    return w * loader.damping, w * loader.mass, w * gradient


def _add_inputs(made: ControlExport) -> None:
    """Add the inputs: a force, or a position that a hand holds; and the switches."""
    system, d, host = made.system, made.d, made.control.compensation
    data, own = made.control, made.own
    given = system.declare("force-N", 0.0, "the pilot's force on the grip, N")
    system.declare("hand", 0.0, "1: a hand holds the grip at hand-deflection plus axis")
    place = f"hand-deflection-{d}"
    wanted = system.declare(place, 0.0, f"position at which the hand holds the grip, {d}")
    gains = clamp_gains(made, max(made.control.schedule.gradients))
    for gain, unit, value in zip(
        ("stiffness", "damping", "integral"),
        (f"N_per_{d}", f"N_s_per_{d}", f"N_per_{d}_s"),
        gains,
        strict=True,
    ):
        system.declare(f"hand-{gain}-{unit}", value, f"the hand's {gain}, {unit}")
    for switch, on, what in (
        ("deflection-correction", host.deflection, "1: δ̂ = δc + K̂·F; 0: δ̂ = δc"),
        ("gradient-correction", host.gradient, "1: ΔG by eq. (12); 0: ΔG = G_T − G_B"),
        ("bend", True, "1: the structure bends; 0: it is rigid"),
    ):
        system.declare(switch, float(on), what)
    if made.rig.flight is None:
        system.declare(BENCH_PRESSURE, 0.0, "the host's dynamic pressure, Pa")
    system.channel("input", "A given force, or a hand moved by the axis of the command.")
    command = prop(made.command)
    system.add(
        "trim-norm",
        either(stepping(), own("trim-norm"), command),
        out="the command in trim, to which the loader's is added",
    )
    moved = within(made.sign * (command - own("trim-norm")), -1.0, 1.0)
    axis = either(equal(command, own("command-norm")), own("axis-norm"), moved)
    system.add(
        "axis-norm",
        either(stepping(), axis, 0.0),
        f"Any other value of {made.command} is a joystick's: pull, right, right foot positive.",
        out="the joystick's axis, ±1 the whole travel",
    )
    led: tuple[tuple[str, Expr], ...] = (
        ("force-given-N", given),
        ("hand/target", wanted + _axis_position(data, own("axis-norm"))),
    )
    for name, asked in led:
        before = system.add(f"{name}-before", made.kept(name))
        now = system.add(name, asked)
        system.add(f"{name}-step", (now - before) / float(made.substeps))
    rate = own("hand/target-step") / own("step-s")
    system.add("hand/target-rate", either(own("live"), rate, 0.0))
    for gain, unit in (
        ("stiffness", f"N_per_{d}"),
        ("damping", f"N_s_per_{d}"),
        ("integral", f"N_per_{d}_s"),
    ):
        system.add(f"hand/{gain}-now", own("hand") * own(f"hand-{gain}-{unit}"))


def _axis_position(data: Control, axis: Expr) -> Expr:
    """Return the position of the grip by a joystick's axis, d: ±1 is the travel of either side."""
    if data.pull == data.push and data.stop_to(1.0) == data.stop_to(-1.0) == data.pull:
        return data.pull * axis
    pulled = within(data.pull * axis, 0.0, data.stop_to(1.0))
    return pulled + within(data.push * axis, -data.stop_to(-1.0), 0.0)


def _add_motion(made: ControlExport) -> None:
    """Add hand, loader and linkage over the run's time, substep by substep."""
    system, d, own = made.system, made.d, made.own
    says = f"hand, loader and linkage, {made.substeps} substeps of h"
    system.channel("loader", says)
    grip = begin(made)
    lags = made.control.loader.modifying_lag > 0.0
    now = Motion(
        system.add("step-0/computed", made.kept(f"loader-{d}")),
        system.add("step-0/rate", made.kept("rate")),
        system.add("step-0/felt", made.kept("felt-N")) if lags and held(made) else None,
    )
    lagged = system.add("step-0/lead", made.kept("lead-N")) if _leads(made) else None
    late = _delayed(made, grip.force)
    for i in range(1, made.substeps + 1):
        place = f"step-{i}"
        script = own("force-given-N-before") + float(i) * own("force-given-N-step")
        target = own("hand/target-before") + float(i) * own("hand/target-step")
        before, after = grip.force, grip.force + own("force-given-N-step")
        if late is not None:
            before, after = late[i - 1], late[i]
        if lagged is not None:
            before, after, lagged = _led(made, i, after, lagged)
        was, now = now, add_loader(made, place, before, after, now)
        grip = add_servo(made, place, was, now, grip)
        grip = add_hand(made, place, script, target, grip)
    _give(made, now, grip, lagged)


def _leads(made: ControlExport) -> bool:
    host = made.control.compensation
    return host.inertia_gradient is not None and host.force_lead is not None


def _led(made: ControlExport, i: int, after: Expr, lagged: Expr) -> tuple[Expr, Expr, Expr]:
    """Return the force with the host's lead at both ends of substep i, and z, N."""
    lag, h, own = made.control.compensation.force_lead_lag, made.own("step-s"), made.own
    now = made.system.add(f"step-{i}/lead", lagged + h / (h + lag) * (after - lagged))
    ahead = made.system.add(f"step-{i}/led", after + own("host/lead") / lag * (after - now))
    return made.kept("led-N") if i == 1 else own(f"step-{i - 1}/led"), ahead, now


def _delayed(made: ControlExport, start: Expr) -> list[Expr] | None:
    """Return the force at each node of the run behind a transport delay, N; None without one.

    It is linear between the ends of runs.
    """
    delay, n = made.control.loader.delay, made.substeps
    if delay == 0.0:
        return None
    runs = delay * made.rig.frame_rate * made.steps
    add, own = made.system.add, made.own
    count = math.floor(runs) + 2
    for j in range(count, 1, -1):  # the oldest first, so that each takes the last run's value
        add(
            f"late/back-{j}",
            made.kept(f"late/back-{j - 1}"),
            "F at the ends of past runs" * (j == count),
        )
    add("late/back-1", start)
    end = add("late/back-0", start + float(n) * own("force-given-N-step"))
    past = [end, *(own(f"late/back-{j}") for j in range(1, count + 1))]
    found = []
    for i in range(n + 1):
        back = runs + 1.0 - i / n
        whole = math.floor(back)
        share = back - whole
        found.append(add(f"late/at-{i}", (1.0 - share) * past[whole] + share * past[whole + 1]))
    return found


def _give(made: ControlExport, now: Motion, grip: Grip, lagged: Expr | None) -> None:
    """Add the results of the run: positions of loader and grip, for the next run and as output."""
    system, d, add = made.system, made.d, made.system.add
    system.channel("linkage", "δ = x + K·F, and the state for the next run")
    add(f"loader-{d}", now.computed, out=f"δc, {d}")
    add("rate", now.rate)
    if now.felt is not None:
        add("felt-N", now.felt)
    if lagged is not None:
        add("lead-N", lagged)
        add("led-N", made.own(f"step-{made.substeps}/led"))
    add(f"servo-{d}", grip.position, out=f"the servo's position, {d}")
    add("servo-rate", grip.rate)
    if made.control.loader.play > 0.0:
        add(f"grip-{d}", grip.grip)
    add("force-held-N", grip.force, out="F, the force on the grip, N")
    add("hand-integral-N", grip.integral)
    if grip.carried is not None:
        add("carried-N", grip.carried)
    true: Value = deflection(made, grip.grip, grip.force, grip.carried)
    others = _crossed(made, assumed=False)
    if others is not None:
        true = true + made.own("bend") * others
    length = made.control.length
    if made.control.loader.arc_geometry:
        true = length * sine(true / length)
    add(f"deflection-{d}", true, out=f"δ at the grip, {d}")


def _crossed(made: ControlExport, *, assumed: bool) -> Expr | None:
    """Return the bend here by the other controls' forces, true or as assumed by the host, d."""
    if made.rig.structure.stands_apart:
        return None
    names = [name for name in CONTROL_NAMES if name in made.rig.controls]
    row = crossed_bends(made.rig, made.name, [str(name) for name in names])[assumed]
    force = "force-read-N" if assumed else "force-held-N"
    found: Expr | None = None
    for name, bent in zip(names, row, strict=True):
        if bent != 0.0:
            term = bent * prop(f"coupled/{name}/{force}")
            found = term if found is None else found + term
    return found


def _converters(made: ControlExport) -> dict[str, tuple[float, float]]:
    """Return step and range of each converter, computed by `rig/sensing`."""
    rig = made.rig
    frame_s = 1.0 / rig.frame_rate
    given = Given(made.control, Hand(), frame_s, frame_s / rig.substeps, rig.substeps)
    return {
        of: (
            float(str(SENSING.value(f"{of}_step", given))),
            float(str(SENSING.value(f"{of}_range", given))),
        )
        for of in _CONVERTERS
    }
