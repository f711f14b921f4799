"""The tables of an import: the account of its channels, and a proposed map."""

from __future__ import annotations

from coupled.record.importing.account import ImportAccount
from coupled.record.importing.suggest.propose import Proposal
from coupled.tables.table import Cell, Mark, Table


def account_table(account: ImportAccount) -> Table:
    """Return the range, RMS and noise of each channel, and its faults."""
    rows = []
    for name, found in account.channels.items():
        numbers = (f"{value:.4g}" for value in (found.least, found.greatest, found.rms))
        doubts = list(found.doubts)
        if found.filled_cells:
            doubts.append(f"{found.filled_cells} empty cells filled")
        verdict: Cell = Mark("; ".join(doubts), "bad") if doubts else "ok"
        rows.append((name, *numbers, f"{found.noise:.2g}", verdict))
    heads = ("channel", "least", "greatest", "rms", "noise", "verdict")
    return Table(heads, tuple(rows), align="lrrrrl")


def proposal_table(proposal: Proposal) -> Table:
    """Return the column that a proposed map takes for each channel."""
    return Table(("channel", "from"), tuple(proposal.mapped.items()), align="l")
