"""Gradient modification: what the host adds to the basic gradient (figures 2 and 5).

The pilot is to feel F = F_BO + G₁·δ up to δ₁ and the slope G₂ beyond (appendix C).
The loader itself gives F_BO + G_B·δc, so the host adds what lacks, eqs. (9) and (10):

    F_mod = ΔG·δc  (11),    ΔG = G_T − G_B                      without compensation
                            ΔG = G_T/(1 − K·G_T) − G_B          eq. (12), with it

since the loader sees δc = δ − K·F. With a breakout, solving that for δ gives
δ = (δc + K·F_BO)/(1 − K·G₁): eq. (11) needs one more term, a breakout of

    F_extra = G₁·K·F_BO/(1 − K·G₁)

which appendix C leaves out. `exact` adds it; as printed, the pilot feels K·G·F_BO too
little at every deflection, G being the slope there.

The break lies at δc₁ = δ₁ − K·F(δ₁): the author's reading, since the report's flow chart is
lost, and its text says only that the bend is included. Where K·F(δ₁) ≥ δ₁ it lies within what
the breakout bends: δc leaves neutral at the force at which δ = K·F(δ), which is on the second
segment, so that G₂ holds from there on and F_extra fills up to it,

    F_extra = F₀/(1 − K·G₂) − F_BO,    F₀ = F_BO + (G₁ − G₂)·δ₁

Below that force the loader stands at neutral and the grip moves by the bend alone, δ = K·F,
whatever is specified: no F_mod(δc) can give it.

The host asks for ΔF in volts, v₂ = S₂·ΔF: a scale S₂ that is off makes another force of it.
With the analog multiplier (figures 3 and 5) the host sends ΔG, scaled by Ŝ₂/Ŝ₁, and the product
is made of v₁ = S₁·δc, eq. (2). So a wrong S₁ of the loader's electronics is felt,

    ΔF = ΔG·δc·(S₁/Ŝ₁)·(Ŝ₂/S₂),

and the break lies where v₁ says that δc is δc₁. A digital product is made of δc as the host
reads it, to the same effect.

An analog multiplier is not at zero where its product is: to F_mod it adds an offset, which
drifts in time, F_offset + r·t, set anew at each frame. What the host puts out may come late by
a part of the frame; until then the last frame's ΔG stands (or its product, where that is what
the host makes).
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig import equations
from coupled.rig.compiled import layout, stage
from coupled.rig.declaration import Declaration, Given

computed_deflection = stage(equations.computed_deflection)  # eq. (1)
total_to_computed = stage(equations.total_to_computed)  # eq. (12), without its − G_B


class ModificationParameters(Protocol):
    """What the host assumes of the loader, and which corrections it makes."""

    basic_gradient: float  # G_B as the host assumes it, N/d
    bend: float  # K̂, d/N
    breakout: float  # F_BO as the host assumes it, N
    break_deflection: float  # δ₁, d; 0 for one segment
    compensated: int  # gradient compensation, eq. (12), on or off
    exact: int  # with the breakout's term, or as printed
    digital: int  # the product ΔG·δc is made by the host and held over a frame
    made: float  # ΔF as made over ΔF as asked for: S₂ assumed over real
    multiplied: float  # δc as the analog multiplier has it over δc: S₁ real over assumed
    offset: float  # of the analog multiplier at the start, N
    drift: float  # N a frame
    late: int  # substeps after t_k at which what the host puts out arrives


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
    """Return S₁/Ŝ₁ of the analog multiplier; a digital product has it in the δc that is read."""
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
    """Return the K̂ by which ΔG is made, d/N; 0 without gradient compensation."""
    return p.bend if p.compensated else 0.0


@stage
def assume(p: ModificationParameters, bend: float) -> None:
    """Set the K̂ by which ΔG is made, d/N; 0 is without gradient compensation."""
    p.bend = bend
    p.compensated = 1


@stage
def set_gradients(
    p: ModificationParameters, s: ModificationState, first: float, second: float
) -> None:
    """Set the modification for the gradients G₁ and G₂ that the schedule asks for, N/d.

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
            # What holds at the break bends further than δ₁: the loader's first motion is
            # beyond it already, on the second segment's line F = preload + G₂·δ.
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
    """Keep what stands at the end of a frame, for a host whose output comes late."""
    s.last_first, s.last_second, s.last_break_computed = s.first, s.second, s.break_computed
    s.last_breakout, s.last_held, s.last_offset = s.breakout, s.held, s.offset


@stage
def exchange_last(s: ModificationState) -> None:
    """Exchange what this frame's output is with what the last one's was."""
    s.first, s.last_first = s.last_first, s.first
    s.second, s.last_second = s.last_second, s.second
    s.break_computed, s.last_break_computed = s.last_break_computed, s.break_computed
    s.breakout, s.last_breakout = s.last_breakout, s.breakout
    s.held, s.last_held = s.last_held, s.held
    s.offset, s.last_offset = s.last_offset, s.offset


@stage
def smooth_force(s: ModificationState, computed: float) -> float:
    """Return F_mod in N without its breakout, at δc in d: eq. (11), in two segments, and offset."""
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
