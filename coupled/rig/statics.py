"""The rig at rest: force, deflection and the host's estimate, in closed form.

With breakout, two segments and a stiffening bend, over δc, the equilibrium of the loader is

    F(δc) = F_BO + F_L + k₃·δc³ + ripple + weight + F_mod − F_offset + b·(n_z − 1) − Σ_j leak_j·F_j

which is eq. (9) solved for F; the structure δ = δc + bend(F), and with a soft backlash
+ sgn(F)·play/2 + F/k. F_mod is the multiplier's output: from δc with an analog one, from δc as the
host reads it with a digital one. The schedule has its own q̄; drifts are those at `time_s`.

The relation is set-valued where something holds the loader still: at neutral the breakout, for any
F between F(0−) and F(0+); at its stop for any F beyond that at the stop.

Effects that form a band about this line are left out: friction, the bend's hysteresis, whose middle
is used, and a rigid backlash, half of its width to either side. `equations` has the linear case.
Forces held on other controls bend a common structure: δ = δc + bend(F) + Σ_j K_ij·F_j, and δ̂
includes the host's K̂_ij·F_j. The line is computed by the stages of a flight, in one kernel that is
cached on disk.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ControlName
from coupled.rig.compensation import estimate
from coupled.rig.compiled import (
    carray,
    entry,
    function_at,
    machine_code,
    pointer,
    seldom,
    stage,
)
from coupled.rig.control import CONTROL, ControlArray, ControlParameters, ControlState
from coupled.rig.crossing import leaks
from coupled.rig.equations import basic_force, specified_force
from coupled.rig.frame import set_feel, set_product
from coupled.rig.linkage import LinkageParameters, bend, contact_displacement
from coupled.rig.modification import smooth_force
from coupled.rig.packing import crossed_bends, pack
from coupled.rig.rig import Rig
from coupled.rig.schedule import gradients
from coupled.rig.sensing import scaled_computed, scaled_force
from coupled.rig.springs import curved, limited, ripple, weight
from coupled.rig.surface import static_command

Floats = NDArray[np.float64]
loader_force = stage(basic_force)  # eq. (8)


# What `static_at` computes: F at each δc; δ, δ̂ and the command for each δc and F; δc and F at δ.
_ALONG, _MADE_OF, _POINT = range(3)
_ROWS = 5  # δc, F, δ, δ̂ and the command
_NO_FORCE_N = 1e-9  # rounding of zero force
_HALVINGS = 200  # from the widest force to the last digit of a double, and more


@dataclass(frozen=True)
class Statics:
    """The static line of one control at one dynamic pressure; arrays of one shape.

    `computed` δc, `deflection` δ and `estimate` δ̂ in d, `force` F and `specified` (the specified
    force at that δ) in N; `command` of the surface about trim, in ±1.
    """

    computed: Floats
    force: Floats
    deflection: Floats
    estimate: Floats
    command: Floats
    specified: Floats


@dataclass(frozen=True)
class Others:
    """Effects of the forces held on other controls at one control.

    The bend here, `bent`, and the host's correction for it, `added`, both in d, and the crosstalk
    on its loader, `leaked`, N.
    """

    bent: float
    added: float
    leaked: float


def crossed(rig: Rig, control: str, others_N: Mapping[str, float]) -> Others:
    """Return the effects of the forces held on other controls, {control: N}, at a control."""
    names = [str(name) for name in rig.controls]
    bends, assumed = crossed_bends(rig, control, names)
    force = np.array([others_N.get(name, 0.0) for name in names])
    gauges = [data.sensing for data in rig.controls.values()]
    scaled = [
        g.force_scale * float(g.force_curve.at(f)) for g, f in zip(gauges, force, strict=True)
    ]
    read = np.array(scaled) + np.array([gauge.force_zero for gauge in gauges])
    share = np.array(
        leaks(control, rig.controls[cast(ControlName, control)].loader.crosstalk, names)
    )
    return Others(float(bends @ force), float(assumed @ read), float(share @ force))


def static_line(
    rig: Rig,
    control: str,
    pressure_Pa: float,
    computed: Floats,
    others_N: Mapping[str, float] | None = None,
) -> Statics:
    """Return the static line at given δc in d, none of them zero.

    `others_N` are the forces held on other controls, {control: N}.
    """
    others = crossed(rig, control, others_N or {})
    packed = pack(rig, only=control)
    rows = np.full((_ROWS, len(computed)), np.nan)
    rows[0] = computed
    given = _Given(float(pressure_Pa), others.leaked, others.bent, others.added)
    _run(_ALONG, packed, 0, given, rows)
    return _line(rig, control, packed, 0, given, rows)


def static_point(
    rig: Rig,
    control: str,
    pressure_Pa: float,
    deflection: float,
    others_N: Mapping[str, float] | None = None,
    time_s: float = 0.0,
    load_factor: float = 1.0,
) -> Statics:
    """Return the point of the static line with the grip at δ in d.

    If the loader rests in its breakout or at its stop, the grip is moved by the structure alone,
    and inside a backlash without a force. On a rigid structure δ must not be zero. `time_s` since
    the start determines drifts of scale and multiplier; `load_factor` in g, +1 in level flight,
    acts on a bob weight.
    """
    packed, frame = pack(rig, only=control), round(time_s * rig.frame_rate)
    packed["state"]["modification"]["frames"] = frame
    others = crossed(rig, control, others_N or {})
    wanted = float(deflection) - others.bent
    weight = rig.controls[cast(ControlName, control)].loader.bob_weight * (load_factor - 1.0)
    leaked = others.leaked - weight
    given = _Given(float(pressure_Pa), leaked, others.bent, others.added, wanted)
    rows = np.full((_ROWS, 1), np.nan)
    _run(_POINT, packed, frame, given, rows)
    point = _line(rig, control, packed, frame, given, rows)
    loader = rig.controls[cast(ControlName, control)].loader
    if loader.play * loader.play_stiffness > 0.0 and abs(point.force[0]) < _NO_FORCE_N:
        at = np.array([float(deflection)])  # inside the backlash
        return replace(
            point, deflection=at, specified=specified_force(rig, control, pressure_Pa, at)
        )
    return point


class _Given(NamedTuple):
    """Numbers for `static_at`: q̄ in Pa, forces in N, deflections in d.

    `leaked` is others' crosstalk on the loader, `bent` the bend by their forces, `added` the host's
    correction for it, `wanted` the δ of a point.
    """

    pressure: float
    leaked: float
    bent: float
    added: float
    wanted: float = 0.0


def _run(what: int, packed: ControlArray, frame: int, given: _Given, rows: Floats) -> None:
    """Run `static_at` on arrays."""
    numbers = np.array(given)
    arrays = (packed.ctypes.data, numbers.ctypes.data, rows.ctypes.data)
    place = np.array([*arrays, rows.shape[1], frame])
    _static()(place.ctypes.data, what)


@lru_cache(maxsize=1)
def _static() -> Callable[[int, int], float]:
    return function_at(machine_code(static_at, 0, 0))


def _line(
    rig: Rig, control: str, packed: ControlArray, frame: int, given: _Given, rows: Floats
) -> Statics:
    """Return the line of δc and F, the first two rows."""
    _run(_MADE_OF, packed, frame, given, rows)
    computed, force, deflection, estimates, commands = rows
    wanted = specified_force(rig, control, given.pressure, deflection)
    return Statics(computed, force, deflection, estimates, commands, wanted)


@stage
def _set(p: ControlParameters, s: ControlState, pressure: float) -> int:
    """Set the modification of the state's frame; return that frame."""
    m, frame = s.modification, s.modification.frames
    s.schedule.pressure = p.schedule.pressure_scale * pressure
    first, second = gradients(p.schedule, s.schedule.pressure)
    set_feel(p, s, first, second, 1.0, 0.0)
    set_product(p, m, 0.0, 0.0)
    return int(frame)


@stage
def _force(
    p: ControlParameters, s: ControlState, computed: float, frame: int, side: float
) -> float:
    """Return F in N at δc in d, beyond the breakout on a side, at a frame."""
    m, most = s.modification, p.sensing.product_range
    force = side * p.loader.breakout + loader_force(p.loader.basic_gradient, computed)
    force += p.loader.cubic * computed**3 + ripple(p.loader, computed) - p.loader.offset
    force += curved(p.loader, computed)
    force += weight(p.loader, computed)
    if p.modification.digital:
        read = scaled_computed(p.sensing, computed, frame)
        product = smooth_force(m, read) + side * m.breakout
        if most > 0.0:
            product = min(max(product, -most), most)
        return force + limited(p.loader, product)
    if p.loader.held:
        return force + limited(p.loader, smooth_force(m, computed) + side * m.breakout)
    return force + side * m.breakout + limited(p.loader, smooth_force(m, computed))


@stage
def _yields(p: LinkageParameters, force: float) -> float:
    """Return the displacement of the grip from δc under a force in N, d."""
    return bend(p, force) + contact_displacement(p, force)


@seldom
def _along(
    controls: ControlArray, pressure: float, leaked: float, computed: Floats, out: Floats
) -> None:
    """Write F in N at each δc, shape (n,), with `leaked` as others' crosstalk on the loader, N."""
    p, s = controls[0].parameters, controls[0].state
    frame = _set(p, s, pressure)
    for i in range(len(computed)):
        side = 1.0 if computed[i] > 0.0 else -1.0
        out[i] = _force(p, s, computed[i], frame, side) - leaked


@seldom
def _made_of(
    controls: ControlArray,
    pressure: float,
    frame: int,
    computed: Floats,
    force: Floats,
    beside: tuple[float, float],
    out: Floats,
) -> None:
    """Write δ and δ̂ in d and the surface's command, shape (3, n), for each δc and F.

    `beside` is the bend by other controls' forces, and the host's correction for it, d.
    """
    p = controls[0].parameters
    for i in range(len(computed)):
        out[0, i] = computed[i] + _yields(p.linkage, force[i]) + beside[0]
        force_read = scaled_force(p.sensing, force[i]) + p.sensing.force_zero
        read = scaled_computed(p.sensing, computed[i], frame)
        made = estimate(p.compensation, read, force_read) + beside[1]
        out[1, i] = made
        out[2, i] = static_command(p.surface, made, pressure) + p.surface.offset


@seldom
def _force_for(p: LinkageParameters, by: float, low: float, high: float) -> float:
    """Return the F in N between two bounds that displaces the grip by `by`, d; else a bound."""
    if _yields(p, high) <= by:
        return high
    if _yields(p, low) >= by:
        return low
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if _yields(p, middle) < by:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@seldom
def _point_at(
    controls: ControlArray, pressure: float, leaked: float, deflection: float
) -> tuple[float, float]:
    """Return the δc in d and the F in N with the grip at δ, by bisection of δc.

    If the loader is held still, at neutral or at its stop, the structure alone determines F.
    """
    p, s = controls[0].parameters, controls[0].state
    frame = _set(p, s, pressure)
    up = _force(p, s, 0.0, frame, 1.0) - leaked
    down = _force(p, s, 0.0, frame, -1.0) - leaked
    side = 1.0
    if deflection <= _yields(p.linkage, up):
        if deflection >= _yields(p.linkage, down):
            return 0.0, _force_for(p.linkage, deflection, down, up)
        side = -1.0
    near, far = 0.0, p.loader.aft if side > 0.0 else p.loader.forward
    stopped = _force(p, s, side * far, frame, side) - leaked
    over = side * (deflection - side * far - _yields(p.linkage, stopped))
    if over > 0.0:
        most = side * (abs(stopped) + 1.0)
        for _ in range(_HALVINGS):
            if side * (deflection - side * far - _yields(p.linkage, most)) <= 0.0:
                low, high = min(stopped, most), max(stopped, most)
                return side * far, _force_for(p.linkage, deflection - side * far, low, high)
            most *= 2.0
        return side * far, stopped  # a rigid structure, or rounding
    while True:
        middle = 0.5 * (near + far)
        x = side * middle
        force = _force(p, s, x, frame, side) - leaked
        if middle in (near, far):
            return x, force
        if side * (x + _yields(p.linkage, force) - deflection) > 0.0:
            far = middle
        else:
            near = middle


@entry
def static_at(address: int, what: int) -> float:
    """Compute `_ALONG`, `_MADE_OF` or `_POINT` on the arrays at `address`; return 0."""
    at = carray(pointer(address), 5, np.int64)
    controls = carray(pointer(at[0]), (1,), CONTROL)
    given = carray(pointer(at[1]), 5, np.float64)
    rows = carray(pointer(at[2]), (_ROWS, at[3]), np.float64)
    if what == _ALONG:
        _along(controls, given[0], given[1], rows[0], rows[1])
    elif what == _MADE_OF:
        beside = (given[2], given[3])
        _made_of(controls, given[0], at[4], rows[0], rows[1], beside, rows[2:])
    else:
        rows[0, 0], rows[1, 0] = _point_at(controls, given[0], given[1], given[4])
    return 0.0
