"""Limits of stability on a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from coupled.authority.stability.aircraft import BobWeight
from coupled.authority.stability.limits import Limit, StabilityLimits
from coupled.authority.stability.planes import Kind
from coupled.cli.tables.whole import print_whole
from coupled.display import System, in_system
from coupled.record.channels import unit_of
from coupled.units import MILLISECOND_s

_WORDS: dict[Kind, tuple[str, float]] = {
    "assumed": ("K̂/K, free hand", 1.0),
    "frame": ("frame of a digital product, ms", 1.0 / MILLISECOND_s),
    "hand": ("hand's stiffness, K·k", 1.0),
    "servo": ("servo, grip held fast, Hz", 1.0),
    "gauge": ("gauge in a hand with K·k = 1, Hz", 1.0),
    "mass": ("mass beyond the gauge over m, free hand", 1.0),
}


def print_limits(
    console: Console,
    limits: Sequence[StabilityLimits],
    bob: BobWeight | None,
    system: System = "si",
) -> None:
    """Print the limits of each control at its stiffest gradient, simulated and by theory."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for head in ("", "stable", "simulated", "theory", "filed"):
        table.add_column(head, justify="left" if head in ("", "stable") else "right")
    for control in limits:
        unit = in_system(f"N/{unit_of(control.control)}", system)
        gradient = f"{unit.written(control.gradient)} {unit.unit}"
        head = f"{control.control}, {gradient}, K·G_T = {control.share:.3g}"
        table.add_row(f"[bold]{head}[/]")
        for limit in control.limits:
            table.add_row(*_row(limit))
        for growth in control.filed:
            word = f" as filed, {growth.hand}: growth, 1/s"
            side = "yes" if growth.simulated < 0.0 else "[red]no[/]"
            table.add_row(word, side, f"{growth.simulated:.2f}", f"{growth.theory:.2f}")
    if bob is not None:
        table.add_row(f"[bold]column through the aircraft, {bob.rate_rad_per_s:.3g} rad/s[/]")
        unit = in_system("N/g", system)
        flown = "–" if bob.simulated_N_per_g is None else unit.written(bob.simulated_N_per_g)
        word = f" bob weight, free hand, {unit.unit} (filed: {unit.written(bob.own_N_per_g, 3)})"
        table.add_row(word, "below", flown, unit.written(bob.theory_N_per_g))
    print_whole(console, table)


def _row(limit: Limit) -> tuple[str, ...]:
    word, factor = _WORDS[limit.kind]
    own = "–" if limit.filed is None else f"{factor * limit.filed:.3g}"
    if limit.outside:
        own = f"[red]{own} unstable[/]"
    if limit.simulated is None:
        ends = f"{factor * limit.least:.3g} to {factor * limit.greatest:.3g}"
        return f" {word}", limit.stable, f"({ends})", "", own
    theory = "–" if limit.theory is None else f"{factor * limit.theory:.4g}"
    return f" {word}", limit.stable, f"{factor * limit.simulated:.4g}", theory, own
