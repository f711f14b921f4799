"""The report of an import on a terminal of 80 columns."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from coupled.cli.tables.whole import print_whole
from coupled.record.importing.account import ClockAccount, ImportAccount
from coupled.record.importing.suggest.propose import Proposal

LISTED = 12  # unmapped columns named on the terminal; the manifest has all


def print_account(console: Console, account: ImportAccount) -> None:
    """Print the clock, a row for each channel, and what was omitted."""
    console.print(clock_in_words(account.clock), highlight=False)
    table = Table(box=None, pad_edge=False)
    table.add_column("channel", no_wrap=True)
    for head in ("least", "greatest", "rms", "noise"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("verdict")
    for name, found in account.channels.items():
        figures = [f"{value:.4g}" for value in (found.least, found.greatest, found.rms)]
        doubts = list(found.doubts)
        if found.filled_cells:
            doubts.append(f"{found.filled_cells} empty cells filled")
        verdict = f"[yellow]{escape('; '.join(doubts))}[/]" if doubts else "ok"
        table.add_row(escape(name), *figures, f"{found.noise:.2g}", verdict)
    print_whole(console, table)
    for warning in account.warnings:
        console.print(f"[yellow]{escape(warning)}[/]", highlight=False)
    left = account.unmapped
    if left:
        more = f" and {len(left) - LISTED} more" if len(left) > LISTED else ""
        console.print(f"not mapped: {escape(', '.join(left[:LISTED]))}{more}", highlight=False)


def print_proposal(console: Console, proposal: Proposal) -> None:
    """Print the column of each channel in a proposed map, and its open questions."""
    table = Table(box=None, pad_edge=False)
    table.add_column("channel", no_wrap=True)
    table.add_column("from")
    for channel, column in proposal.mapped.items():
        table.add_row(escape(channel), escape(column))
    print_whole(console, table)
    for question in proposal.questions:
        console.print(f"[yellow]to answer:[/] {escape(question)}", highlight=False)
    for warning in proposal.warnings[:LISTED]:
        console.print(f"[yellow]{escape(warning)}[/]", highlight=False)
    if proposal.unmapped:
        console.print(f"not used: {escape(', '.join(proposal.unmapped[:LISTED]))}", highlight=False)


def clock_in_words(clock: ClockAccount) -> str:
    """Return a text on how rows of the log became frames of the record."""
    rows = f"{clock.rows_used} of {clock.log_rows} rows at {clock.log_rate_Hz:.4g} Hz"
    if clock.method == "pchip":
        steps = f"{1e3 * clock.least_step_s:.3g} to {1e3 * clock.greatest_step_s:.3g} ms"
        how = f"{steps} apart, interpolated (PCHIP)"
    else:
        how = "even, taken as they are"
    frames = f"{clock.frames} frames at {clock.frame_rate_Hz:g} Hz"
    return f"clock: {rows}, {how};\n       {frames}"
