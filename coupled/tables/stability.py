"""The table of the stability limits of a rig."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from coupled.authority.stability.aircraft import BobWeight
from coupled.authority.stability.limits import Limit, StabilityLimits
from coupled.authority.stability.planes import Kind
from coupled.display import System, in_system
from coupled.record.channels import unit_of
from coupled.tables.table import NONE, Mark, Row, Table, interval, number
from coupled.units import MILLISECOND_s

_WORDS: dict[Kind, tuple[str, float]] = {
    "assumed": ("K̂/K, free hand", 1.0),
    "frame": ("frame of a digital product, ms", 1.0 / MILLISECOND_s),
    "hand": ("hand's stiffness, K·k", 1.0),
    "servo": ("servo, grip held fast, Hz", 1.0),
    "gauge": ("gauge in a hand with K·k = 1, Hz", 1.0),
    "mass": ("mass beyond the gauge over m, free hand", 1.0),
}


def limits_table(
    limits: Sequence[StabilityLimits], bob: BobWeight | None, system: System = "si"
) -> Table:
    """Return the limits of each control at its stiffest gradient, simulated and by theory."""
    rows: list[Row] = []
    for control in limits:
        unit = in_system(f"N/{unit_of(control.control)}", system)
        gradient = f"{unit.written(control.gradient)} {unit.unit}"
        rows.append((f"{control.control}, {gradient}, K·G_T = {control.share:.3g}",))
        rows += [_limit(limit) for limit in control.limits]
        for growth in control.filed:
            side = "yes" if growth.simulated < 0.0 else Mark("no", "bad")
            numbers = (f"{growth.simulated:.2f}", f"{growth.theory:.2f}")
            rows.append((f"as filed, {growth.hand}: growth, 1/s", side, *numbers, ""))
    if bob is not None:
        rows += _bob_weight(bob, system)
    heads = ("", "stable", "simulated", "theory", "filed")
    return Table(heads, tuple(rows), align="llr")


def _limit(limit: Limit) -> Row:
    words, factor = _WORDS[limit.kind]
    own = NONE if limit.filed is None else f"{factor * limit.filed:.3g}"
    filed = Mark(f"{own} unstable", "bad") if limit.outside else own
    if limit.simulated is None:
        ends = interval(factor * limit.least, factor * limit.greatest, ".3g")
        return words, limit.stable, f"({ends})", "", filed
    theory = None if limit.theory is None else factor * limit.theory
    return words, limit.stable, number(factor * limit.simulated), number(theory), filed


def _bob_weight(bob: BobWeight, system: System) -> Iterator[Row]:
    """Yield the limit of a bob weight, for a free hand."""
    unit = in_system("N/g", system)
    yield (f"column through the aircraft, {bob.rate_rad_per_s:.3g} rad/s",)
    flown = NONE if bob.simulated_N_per_g is None else unit.written(bob.simulated_N_per_g)
    words = f"bob weight, free hand, {unit.unit} (filed: {unit.written(bob.own_N_per_g, 3)})"
    yield words, "below", flown, unit.written(bob.theory_N_per_g), ""
