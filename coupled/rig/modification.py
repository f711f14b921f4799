"""Gradient modification: what the host adds to the basic gradient (figures 2 and 5).

The pilot is to feel F = F_BO + G₁·δ up to δ₁ and the slope G₂ beyond (appendix C).
The loader itself gives F_BO + G_B·δc, so the host adds

    F_mod = ΔG·δc,    ΔG = G_T − G_B                      without compensation
                      ΔG = G_T/(1 − K·G_T) − G_B          eq. (12), with it

since the loader sees δc = δ − K·F. With a breakout, solving that for δ gives
δ = (δc + K·F_BO)/(1 − K·G₁): eq. (11) needs one more term, a breakout of

    F_extra = G₁·K·F_BO/(1 − K·G₁)

which appendix C leaves out. `exact` adds it; as printed, the pilot feels K·G·F_BO too
little at every deflection, G being the slope there. The break lies at δc₁ = δ₁ − K·F(δ₁).
The host asks for ΔF in volts, v₂ = S₂·ΔF: a scale S₂ that is off makes another force of it.
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig.compiled import layout, stage


class ModificationParameters(Protocol):
    """What the host believes of the loader, and which corrections it makes."""

    basic_gradient: float  # G_B as the host believes it, N/d
    bend: float  # K̂, d/N
    breakout: float  # F_BO as the host believes it, N
    break_deflection: float  # δ₁, d; 0 for one segment
    compensated: int  # gradient compensation, eq. (12), on or off
    exact: int  # with the breakout's term, or as printed
    digital: int  # the product ΔG·δc is made by the host and held over a frame
    made: float  # ΔF as made over ΔF as asked for: S₂ believed over real


class ModificationState(Protocol):
    """F_mod as a function of δc, over one frame."""

    first: float  # ΔG below the break, N/d
    second: float  # ΔG beyond it
    break_computed: float  # δc₁, d; 0 for one segment
    breakout: float  # F_extra, N
    held: float  # the digital product, N


MODIFICATION_PARAMETERS = layout(ModificationParameters)
MODIFICATION_STATE = layout(ModificationState)


@stage
def total_to_computed(gradient: float, bend: float) -> float:
    """Return the gradient on δc, N/d, that is felt as `gradient` on δ: eq. (12)'s first term."""
    return gradient / (1.0 - bend * gradient)


@stage
def set_gradients(
    p: ModificationParameters, s: ModificationState, first: float, second: float
) -> None:
    """Set the modification for the gradients G₁ and G₂ that the schedule asks for, N/d."""
    s.break_computed = p.break_deflection
    s.breakout = 0.0
    if p.compensated:
        if p.break_deflection > 0.0:
            s.break_computed -= p.bend * (p.breakout * p.exact + first * p.break_deflection)
        if p.exact:
            s.breakout = total_to_computed(first, p.bend) * p.bend * p.breakout
        first = total_to_computed(first, p.bend)
        second = total_to_computed(second, p.bend)
    s.first = p.made * (first - p.basic_gradient)
    s.second = p.made * (second - p.basic_gradient)
    s.breakout *= p.made


@stage
def smooth_force(s: ModificationState, computed: float) -> float:
    """Return F_mod in N without its breakout, at δc in d."""
    force = s.first * computed
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
