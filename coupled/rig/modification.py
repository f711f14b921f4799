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

from typing import Protocol

from coupled.rig import equations
from coupled.rig.compiled import layout, stage
from coupled.rig.declaration import Declaration, Given

computed_deflection = stage(equations.computed_deflection)  # eq. (1)
total_to_computed = stage(equations.total_to_computed)  # eq. (12), without its − G_B


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
    state=layout(ModificationState),
    fixed=(
        *("first", "second", "break_computed", "breakout", "offset"),
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


@stage
def keep_last(s: ModificationState) -> None:
    """Store the values at the end of a frame, for a host with a late output."""
    s.last_first, s.last_second, s.last_break_computed = s.first, s.second, s.break_computed
    s.last_breakout, s.last_held, s.last_offset = s.breakout, s.held, s.offset


@stage
def exchange_last(s: ModificationState) -> None:
    """Exchange this frame's output and the last one's."""
    s.first, s.last_first = s.last_first, s.first
    s.second, s.last_second = s.last_second, s.second
    s.break_computed, s.last_break_computed = s.last_break_computed, s.break_computed
    s.breakout, s.last_breakout = s.last_breakout, s.breakout
    s.held, s.last_held = s.last_held, s.held
    s.offset, s.last_offset = s.last_offset, s.offset


@stage
def smooth_force(s: ModificationState, computed: float) -> float:
    """Return F_mod in N without its breakout, at δc in d: eq. (11), two segments, with offset."""
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
