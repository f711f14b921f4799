"""The loader as JSBSim components: δc over one of its substeps (equations: `rig/loader`).

    m·δc'' + c·δc' + friction·Sgn(δc') + breakout·Sgn(δc) + G_B·δc + k₃·δc³ + F_mod = F + F_ext

The smooth part is stepped by the implicit midpoint rule, like the rig's own. Friction and breakout
are set-valued here too, and implicit: with u = δc' at the middle of the step h,
A = 2m/h + c + h·k/2 and W = A·δc' + the forces but for friction and breakout,

    A·u + F_c·Sgn(u) + F_BO·Sgn(δc + h·u) ∋ W

has one solution in closed form, since the left side rises with u and jumps only at u = 0 and at
u₀ = −δc/h: u = max(min(u₁, a), min(u₂, b), u₃), where a ≤ b are the two jumps and u₁ ≥ u₂ ≥ u₃ the
solutions below, between and above both. So a control inside its friction or its breakout does not
move, at any rate. In contrast to the rig's own loader, an event counts for the whole substep in
which it falls.
"""

from __future__ import annotations

from dataclasses import dataclass

from coupled.exporting.controlexport import ControlExport
from coupled.exporting.curve import curve_force, curve_slope
from coupled.exporting.expression import (
    Expr,
    either,
    equal,
    exponential,
    greater,
    least,
    most,
    size,
    within,
)


@dataclass(frozen=True)
class Motion:
    """The state of the loader: δc in d, δc' in d/s, and a lagged F_mod, N."""

    computed: Expr
    rate: Expr
    felt: Expr | None = None


def held(made: ControlExport) -> bool:
    """Return whether F_mod does not follow δc within a substep: it is digital, or lags."""
    loader = made.control.loader
    return loader.multiplier == "digital" or loader.modifying_lag > 0.0


def modifying(made: ControlExport, at: Expr, *, smooth: bool) -> Expr:
    """Return F_mod at δc = `at` by the host's last output; `smooth` without F_extra."""
    own, schedule = made.own, made.control.schedule
    force = curve_force(made, at) if made.control.schedule.curved else own("host/first") * at
    if made.control.loader.multiplier == "hybrid":
        force = force + own("host/offset") if _has_offset(made) else force
    if schedule.break_deflection > 0.0:
        edge = own("host/break")
        beyond = most(size(at) - edge, 0.0) * (own("host/second") - own("host/first"))
        beyond = either(greater(edge, 0.0), beyond, 0.0)
        force = force + either(greater(at, 0.0), beyond, -beyond)
    if not smooth and has_extra(made):
        extra = own("host/extra")
        force = force + either(greater(at, 0.0), extra, either(equal(at, 0.0), 0.0, -extra))
    return force


def _has_offset(made: ControlExport) -> bool:
    loader = made.control.loader
    return loader.multiplier_offset != 0.0 or loader.multiplier_drift != 0.0


def has_extra(made: ControlExport) -> bool:
    """Return whether F_mod has a breakout of its own, F_extra of appendix C."""
    control = made.control
    exact = control.compensation.breakout_term == "exact"
    return exact and (control.assumed_breakout > 0.0 or control.schedule.break_deflection > 0.0)


def add_loader(made: ControlExport, place: str, before: Expr, after: Expr, was: Motion) -> Motion:
    """Add one substep, over which the force is linear from `before` to `after`, N.

    `place` is the prefix of its components' names; `was` is the loader's state before.
    """
    system, loader, h = made.system, made.control.loader, made.own("step-s")
    mass, damping = inertia(made)
    x, v = was.computed, was.rate
    felt = _feel(made, f"{place}/felt", was.felt, x) if held(made) else None
    middle = system.add(f"{place}/middle", x + 0.5 * h * v)
    stiffness, elastic = _spring(made, middle)
    if felt is not None:
        elastic = elastic + felt
    inert = system.add(f"{place}/inertia", 2.0 * mass / h + damping + 0.5 * h * stiffness)
    push = 0.5 * (before + after) + made.own("external-N") - elastic - damping * v
    pushed = system.add(f"{place}/push", inert * v + push)
    halfway, neutral = _halfway(made, place, was, inert, pushed)
    reached = x + h * halfway
    if neutral is not None:
        reached = either(equal(halfway, neutral), 0.0, reached)
    control = made.control
    aft, forward = control.stop_to(1.0), control.stop_to(-1.0)
    out = f"{place}/computed"
    computed = system.add(out, within(reached, -forward, aft))
    rate = _rate(made, v, halfway)
    if neutral is not None:
        slow = _too_slow(made, 2.0 * halfway - v, 0.5 * (before + after) + made.own("external-N"))
        rate = either(equal(halfway, neutral), either(slow, 0.0, 2.0 * halfway - v), rate)
    rate = either(equal(computed, aft), 0.0, either(equal(computed, -forward), 0.0, rate))
    moving = system.add(f"{place}/rate", rate)
    if felt is not None and loader.modifying_lag > 0.0:
        felt = _feel(made, f"{place}/felt-after", felt, computed)
    return Motion(computed, moving, felt)


def inertia(made: ControlExport) -> tuple[Expr | float, Expr | float]:
    """Return m and c: the file's, or those set by the host from the gradient."""
    loader, host = made.control.loader, made.control.compensation
    mass: Expr | float = loader.mass
    damping: Expr | float = loader.damping
    if host.inertia_gradient is not None:
        mass = made.own("host/mass") if host.mass_factor else mass
        damping = made.own("host/damping") if host.damping_factor else damping
    return mass, damping


def _spring(made: ControlExport, at: Expr) -> tuple[Expr, Expr]:
    """Return slope and force of the smooth springs at δc = `at`."""
    loader, schedule, own = made.control.loader, made.control.schedule, made.own
    stiffness = 3.0 * loader.cubic * at * at + loader.basic_gradient
    elastic = loader.basic_gradient * at + loader.cubic * at * at * at
    if held(made):
        return stiffness, elastic
    slope = curve_slope(made, at) if made.control.schedule.curved else own("host/first")
    if schedule.break_deflection > 0.0:
        edge = own("host/break")
        beyond = greater(edge, 0.0) * greater(size(at), edge)
        slope = either(beyond, own("host/second"), slope)
    return stiffness + slope, elastic + modifying(made, at, smooth=True)


def _halfway(
    made: ControlExport, place: str, was: Motion, inert: Expr, pushed: Expr
) -> tuple[Expr, Expr | None]:
    """Return u, and with a breakout also u₀, which moves the control to neutral."""
    system, loader, h = made.system, made.control.loader, made.own("step-s")
    preload = breakout(made)
    dry = max(loader.friction, loader.breakaway) > 0.0
    neutral = None if preload is None else system.add(f"{place}/to-neutral", -was.computed / h)
    friction: Expr | float = loader.friction
    if loader.breakaway > loader.friction:
        level = _level(made, was.rate)
        first = _solved(inert, pushed, level, preload, neutral)
        guess = system.add(f"{place}/guess", first)
        friction = either(equal(guess, 0.0), level, _level(made, guess))
        friction = system.add(f"{place}/friction", friction)
    solved = _solved(inert, pushed, friction if dry else None, preload, neutral)
    return system.add(f"{place}/halfway", solved), neutral


def _level(made: ControlExport, rate: Expr) -> Expr:
    """Return friction's size at a speed: F_c + (F_s − F_c)·exp(−(v/v_s)²)."""
    loader = made.control.loader
    ratio = rate / loader.stribeck_rate
    return loader.friction + (loader.breakaway - loader.friction) * exponential(-(ratio * ratio))


def breakout(made: ControlExport) -> Expr | float | None:
    """Return the preload about neutral, N: the loader's, and a hybrid's from the host."""
    own = made.control.loader.breakout
    if has_extra(made) and not held(made):
        return made.own("host/extra") + own
    return own if own > 0.0 else None


def _solved(
    inert: Expr,
    pushed: Expr,
    friction: Expr | float | None,
    preload: Expr | float | None,
    neutral: Expr | None,
) -> Expr:
    """Return u of A·u + F_c·Sgn(u) + F_BO·Sgn(δc + h·u) ∋ W."""
    if friction is None and preload is None:
        return pushed / inert
    if preload is None or neutral is None:
        assert friction is not None
        return (pushed - within(pushed, -1.0 * friction, friction)) / inert
    if friction is None:
        low, high = (pushed + preload) / inert, (pushed - preload) / inert
        return most(least(low, neutral), high)
    both = friction + preload
    # Friction jumps at u = 0, the preload at u₀: which comes first from below.
    first = either(greater(neutral, 0.0), preload - friction, friction - preload)
    return most(
        least((pushed + both) / inert, least(neutral, 0.0)),
        least((pushed + first) / inert, most(neutral, 0.0)),
        (pushed - both) / inert,
    )


def _rate(made: ControlExport, v: Expr, halfway: Expr) -> Expr:
    """Return δc' at the end of a substep: 2u − δc', or 0 where friction holds it."""
    loader = made.control.loader
    after = 2.0 * halfway - v
    if max(loader.friction, loader.breakaway) > 0.0:
        after = either(greater(0.0, v * after), 0.0, after)
        after = either(equal(halfway, 0.0), 0.0, after)
    return after


def _too_slow(made: ControlExport, rate: Expr, pull: Expr) -> Expr:
    """Return whether a control at neutral with this speed is stopped there in a substep."""
    preload = breakout(made)
    assert preload is not None
    mass, _ = inertia(made)
    surplus = made.control.loader.friction + preload - size(pull)
    return 1.0 - greater(mass * size(rate), made.own("step-s") * surplus)


def _feel(made: ControlExport, name: str, felt: Expr | None, at: Expr) -> Expr:
    """Return F_mod on the loader if it is held: at once, or advanced by half a substep."""
    digital = made.control.loader.multiplier == "digital"
    wanted = made.own("host/held") if digital else modifying(made, at, smooth=False)
    lag = made.control.loader.modifying_lag
    if felt is None or lag == 0.0:
        return wanted
    gain = 1.0 - exponential((-0.5 / lag) * made.own("step-s"))
    return made.system.add(name, felt + gain * (wanted - felt))
