"""Gradient modification: the force that the host adds to the basic gradient (figures 2 and 5).

The pilot is to feel F = F_BO + G₁·δ up to δ₁ and the slope G₂ beyond (appendix C). The loader
itself gives F_BO + G_B·δc, so the host adds the difference, eqs. (9) and (10):

    F_mod = ΔG·δc  (11),    ΔG = G_T − G_B                      without compensation
                            ΔG = G_T/(1 − K·G_T) − G_B          eq. (12), with it

since the loader measures δc = δ − K·F. With a breakout, solving that for δ gives
δ = (δc + K·F_BO)/(1 − K·G₁): eq. (11) needs one more term, a breakout of

    F_extra = G₁·K·F_BO/(1 − K·G₁)

which appendix C leaves out. `exact` adds it; as printed, the pilot feels K·G·F_BO too little at
every deflection, G being the slope there.

The break is at δc₁ = δ₁ − K·F(δ₁). This is the author's interpretation, since the report's flow
chart is lost, and its text says only that the bend is included. If K·F(δ₁) ≥ δ₁ the break is within
the bend by the breakout: δc leaves neutral at the force at which δ = K·F(δ), which is on the second
segment, so that G₂ applies from there on and F_extra adds the rest,

    F_extra = F₀/(1 − K·G₂) − F_BO,    F₀ = F_BO + (G₁ − G₂)·δ₁

Below that force the loader is at neutral and the grip moves by the bend alone, δ = K·F, whatever is
specified: no F_mod(δc) can change it.

A specified curve is the same with any number of segments. On each side of neutral the nodes (δ, F)
become (δc, F_mod) with δc = δ − K·F, and eq. (12) gives the slope of each segment:

    F_mod = F_BO + f(δ̂) − (F_BO + G_B·δc),    δ̂ = δc + K·F

Segments within the bend by the breakout are omitted, and F_extra is F − F_BO at δc = 0. If it
differs between the two sides, half of the difference is added to the offset. K·G < 1 for each
segment, so δc rises with δ (`rig` checks it).

The host commands ΔF in volts, v₂ = S₂·ΔF, so an error of S₂ scales the force. With the analog
multiplier (figures 3 and 5) the host sends ΔG, scaled by Ŝ₂/Ŝ₁, and the product uses v₁ = S₁·δc,
eq. (2). So an error of the electronics' S₁ is felt,

    ΔF = ΔG·δc·(S₁/Ŝ₁)·(Ŝ₂/S₂),

and the break is where v₁ corresponds to δc₁. A digital product uses δc as the host reads it, to the
same effect.

An analog multiplier adds an offset to F_mod, which drifts in time, F_offset + r·t, updated at each
frame. The host's output may be late by a part of the frame; until then the last frame's ΔG applies
(or its product, if the host computes the product).
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig import equations
from coupled.rig.compiled import layout, seldom, stage
from coupled.rig.declaration import Declaration, Given
from coupled.rig.parameters import MAX_NODES
from coupled.rig.schedule import ScheduleParameters, force_at
from coupled.rig.sensing import converted

Floats = NDArray[np.float64]

computed_deflection = stage(equations.computed_deflection)  # eq. (1)
total_to_computed = stage(equations.total_to_computed)  # eq. (12), without its − G_B
felt_gradient = stage(equations.felt_gradient)  # its inverse


class ModificationParameters(Protocol):
    """The host's assumptions on the loader, and its corrections."""

    basic_gradient: float  # G_B as the host assumes it, N/d
    bend: float  # K̂, d/N
    breakout: float  # F_BO as the host assumes it, N
    break_deflection: float  # δ₁, d; 0 for one segment
    compensated: int  # gradient compensation, eq. (12), on or off
    exact: int  # with the breakout's term, or as printed
    digital: int  # the product ΔG·δc is computed by the host and held over a frame
    made: float  # ΔF over the ΔF ordered: S₂ assumed over real
    multiplied: float  # δc in the analog multiplier over δc: S₁ real over assumed
    offset: float  # of the analog multiplier at the start, N
    drift: float  # N a frame
    late: int  # substeps after t_k at which the host's output arrives


class ModificationState(Protocol):
    """F_mod as a function of δc, over one frame."""

    first: float  # ΔG below the break, N/d
    second: float  # ΔG beyond it
    break_computed: float  # δc₁, d; 0 for one segment
    breakout: float  # F_extra, N
    held: float  # the digital product, N
    offset: float  # of the analog multiplier, N
    frames: int  # since the start
    last_first: float  # the same of the frame before
    last_second: float
    last_break_computed: float
    last_breakout: float
    last_held: float
    last_offset: float
    curved: int  # a curve is specified, in place of `first`, `second` and `break_computed`
    page: int  # of this frame in the three arrays, the other being the last frame's
    node_at: Floats  # |δc| where a segment begins, d, by page and side, pull first; infinite: none
    node_force: Floats  # F_mod there without breakout and offset, N, positive along δc
    node_slope: Floats  # dF_mod/dδc of the segment, N/d


def _analog(g: Given) -> float:
    return float(g.control.loader.multiplier == "hybrid")


def _multiplied(given: Given) -> float:
    """Return S₁/Ŝ₁ of the analog multiplier; a digital product has it in the δc as read."""
    control = given.control
    return control.sensing.computed_scale if control.loader.multiplier == "hybrid" else 1.0


MODIFICATION = Declaration(
    layout(ModificationParameters),
    section="control.compensation",
    derived={
        "basic_gradient": lambda g: g.control.assumed_basic_gradient,
        "breakout": lambda g: g.control.assumed_breakout,
        "break_deflection": lambda g: g.control.schedule.break_deflection,
        "compensated": lambda g: g.control.compensation.gradient,
        "exact": lambda g: g.control.compensation.breakout_term == "exact",
        "digital": lambda g: g.control.loader.multiplier == "digital",
        "made": lambda g: 1.0 / g.control.sensing.modifying_scale,
        "multiplied": _multiplied,
        "offset": lambda g: _analog(g) * g.control.loader.multiplier_offset,
        "drift": lambda g: _analog(g) * g.control.loader.multiplier_drift * g.frame_s,
        "late": lambda g: min(round(g.control.sensing.gradient_skew / g.substep_s), g.substeps - 1),
    },
    state=layout(
        ModificationState,
        **dict.fromkeys(("node_at", "node_force", "node_slope"), (2, 2, MAX_NODES)),
    ),
    fixed=(
        *("first", "second", "break_computed", "breakout", "offset"),
        *("node_at", "node_force", "node_slope"),
        *("last_first", "last_second", "last_break_computed", "last_breakout", "last_offset"),
    ),
)


@stage
def assumed_bend(p: ModificationParameters) -> float:
    """Return the K̂ in ΔG, d/N; 0 without gradient compensation."""
    return p.bend if p.compensated else 0.0


@stage
def assume(p: ModificationParameters, bend: float) -> None:
    """Set the K̂ in ΔG, d/N; 0 is without gradient compensation."""
    p.bend = bend
    p.compensated = 1


@stage
def set_gradients(
    p: ModificationParameters, s: ModificationState, first: float, second: float
) -> None:
    """Set the modification for the gradients G₁ and G₂ of the schedule, N/d.

    Eq. (12) for each segment; appendix C, with the breakout's term or as printed.
    """
    s.offset = p.offset + p.drift * s.frames
    s.frames += 1
    bend = assumed_bend(p)
    preload = p.breakout if p.exact else 0.0
    s.break_computed = 0.0
    if p.break_deflection > 0.0:
        force = preload + first * p.break_deflection
        s.break_computed = computed_deflection(p.break_deflection, force, bend)
        if s.break_computed <= 0.0:
            # The force at the break bends further than δ₁: the loader's first motion is beyond it,
            # on the second segment's line F = preload + G₂·δ.
            s.break_computed = 0.0
            preload += (first - second) * p.break_deflection
            first = second
    s.breakout = 0.0
    if p.exact:
        s.breakout = p.made * (
            total_to_computed(first, bend) * bend * preload + (preload - p.breakout)
        )
    made = p.made * p.multiplied
    s.first = made * (total_to_computed(first, bend) - p.basic_gradient)
    s.second = made * (total_to_computed(second, bend) - p.basic_gradient)
    s.break_computed /= p.multiplied


@seldom
def set_curve(
    p: ModificationParameters,
    s: ModificationState,
    schedule: ScheduleParameters,
    pressure: float,
    share: float,
) -> None:
    """Set the modification for a share of the curve at the schedule's pressure in Pa.

    It follows `set_gradients`, which sets the offset.
    """
    s.curved = 1
    up = _set_side(p, s, schedule, pressure, share, 1.0)
    down = _set_side(p, s, schedule, pressure, share, -1.0)
    if p.exact:
        s.breakout = p.made * (0.5 * (up + down) - p.breakout)
        s.offset += p.made * 0.5 * (up - down)


@stage
def _set_side(
    p: ModificationParameters,
    s: ModificationState,
    schedule: ScheduleParameters,
    pressure: float,
    share: float,
    side: float,
) -> float:
    """Set the nodes on one side of neutral; return the size of F at δc = 0 there, N."""
    bend, made = assumed_bend(p), p.made * p.multiplied
    row = 0 if side > 0.0 else 1
    at, forces = s.node_at[s.page, row], s.node_force[s.page, row]
    slopes = s.node_slope[s.page, row]
    last, step = schedule.nodes - 1, 1 if side > 0.0 else -1
    mirrored = schedule.deflection[0] == 0.0
    node = 0
    if mirrored:
        step = 1
    else:
        while schedule.deflection[node] != 0.0:
            node += 1
    begun, size = p.breakout if p.exact else 0.0, 0.0
    computed, force, at_neutral, count = computed_deflection(size, begun, bend), 0.0, begun, 0
    while True:
        after = node + step
        ends = after in (0, last)
        wide = abs(schedule.deflection[after]) - size
        rise = abs(force_at(schedule, after, pressure)) - abs(force_at(schedule, node, pressure))
        total = total_to_computed(share * rise / wide, bend)
        size, begun = size + wide, begun + share * rise
        reached = computed_deflection(size, begun, bend)
        if reached > 0.0 or ends:
            if count == 0:
                at_neutral = begun - total * reached
                computed = 0.0
            at[count], forces[count] = computed / p.multiplied, force
            slopes[count] = made * (total - p.basic_gradient)
            force += slopes[count] * (reached - computed) / p.multiplied
            computed = reached
            count += 1
        if ends:
            break
        node = after
    for unused in range(count, MAX_NODES):
        at[unused] = math.inf
    return at_neutral


@seldom
def convert_curve(s: ModificationState, step: float, full_scale: float) -> None:
    """Send the slopes of a curve through the host's converter."""
    if step == 0.0:
        return
    for side in range(2):
        at, forces = s.node_at[s.page, side], s.node_force[s.page, side]
        slopes = s.node_slope[s.page, side]
        for node in range(MAX_NODES):
            slopes[node] = converted(slopes[node], step, full_scale)
            if node + 1 < MAX_NODES and at[node + 1] < math.inf:
                forces[node + 1] = forces[node] + slopes[node] * (at[node + 1] - at[node])


@seldom
def local_gradient(p: ModificationParameters, s: ModificationState, computed: float) -> float:
    """Return the specified curve's G_T at δc as read, d, in N/d: the inverse of eq. (12)."""
    sent = slope(s, computed / p.multiplied) / (p.made * p.multiplied)
    return felt_gradient(sent + p.basic_gradient, assumed_bend(p))


@stage
def _segment(s: ModificationState, computed: float) -> tuple[int, int]:
    """Return side and number of the curve's segment at δc in d."""
    side, size = 0 if computed >= 0.0 else 1, abs(computed)
    node = 0
    while node + 1 < MAX_NODES and s.node_at[s.page, side, node + 1] <= size:
        node += 1
    return side, node


@seldom
def _along_curve(s: ModificationState, computed: float) -> float:
    """Return F_mod of a curve in N, without breakout and offset, at δc in d."""
    side, node = _segment(s, computed)
    beyond = abs(computed) - s.node_at[s.page, side, node]
    force = s.node_force[s.page, side, node] + s.node_slope[s.page, side, node] * beyond
    return float(-force if side else force)


@seldom
def _slope_of_curve(s: ModificationState, computed: float) -> float:
    """Return dF_mod/dδc of a curve at δc in d, N/d."""
    side, node = _segment(s, computed)
    return float(s.node_slope[s.page, side, node])


@stage
def keep_last(s: ModificationState) -> None:
    """Store the values at the end of a frame, for a host with a late output."""
    s.page = 1 - s.page
    s.last_first, s.last_second, s.last_break_computed = s.first, s.second, s.break_computed
    s.last_breakout, s.last_held, s.last_offset = s.breakout, s.held, s.offset


@stage
def exchange_last(s: ModificationState) -> None:
    """Exchange this frame's output and the last one's."""
    s.page = 1 - s.page
    s.first, s.last_first = s.last_first, s.first
    s.second, s.last_second = s.last_second, s.second
    s.break_computed, s.last_break_computed = s.last_break_computed, s.break_computed
    s.breakout, s.last_breakout = s.last_breakout, s.breakout
    s.held, s.last_held = s.last_held, s.held
    s.offset, s.last_offset = s.last_offset, s.offset


@stage
def smooth_force(s: ModificationState, computed: float) -> float:
    """Return F_mod in N without its breakout, at δc in d: eq. (11), two segments, with offset."""
    if s.curved:
        return s.offset + _along_curve(s, computed)
    force = s.first * computed + s.offset
    if s.break_computed > 0.0:
        beyond = abs(computed) - s.break_computed
        if beyond > 0.0:
            more = (s.second - s.first) * beyond
            force += more if computed > 0.0 else -more
    return force


@stage
def slope(s: ModificationState, computed: float) -> float:
    """Return dF_mod/dδc in N/d."""
    if s.curved:
        return _slope_of_curve(s, computed)
    if s.break_computed > 0.0 and abs(computed) > s.break_computed:
        return s.second
    return s.first


@stage
def modifying_force(s: ModificationState, computed: float) -> float:
    """Return F_mod in N at δc in d, its breakout included."""
    force = smooth_force(s, computed)
    if computed > 0.0:
        force += s.breakout
    elif computed < 0.0:
        force -= s.breakout
    return force
