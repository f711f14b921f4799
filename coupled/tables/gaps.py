"""A diagnosis on a terminal of 80 columns."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table


def print_stages(console: Console, diagnosis: dict[str, Any]) -> None:
    """Print the stages of a diagnosis: residual over floor, and what is left of it."""
    table = Table("stage", box=None)
    for head in ("residual over floor", "with the effects", ""):
        table.add_column(head, justify="right")
    for stage, found in diagnosis["stages"].items():
        if "gap" not in found:
            lacks = "lacks " + ", ".join(found["missing"])
            table.add_row(stage, "not judged", "", lacks if found["missing"] else "at rest")
            continue
        left = f"{found['left']:.2f}" if "left" in found else ""
        table.add_row(stage, f"{found['gap']:.2f}", left, "guilty" if found["guilty"] else "")
    console.print()
    console.print(table)
