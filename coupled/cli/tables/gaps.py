"""A diagnosis on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from coupled.gap.words import in_figures


def print_stages(console: Console, diagnosis: dict[str, Any]) -> None:
    """Print the stages of a diagnosis: residual over floor, and what is left of it."""
    table = Table("stage", box=None)
    for head in ("residual over floor", "with the effects", ""):
        table.add_column(head, justify="right")
    for stage, found in diagnosis["stages"].items():
        if "gap" not in found:
            lacks = "lacks " + ", ".join(found["missing"])
            table.add_row(stage, "not judged", "", found.get("why", lacks))
            continue
        left = f"{found['left']:.2f}" if "left" in found else ""
        settled = found["gap"] > 1.2 and not found["guilty"] and found.get("settled", 9.0) < 1.2
        remark = "guilty" if found["guilty"] else ("within its settings" if settled else "")
        table.add_row(stage, f"{found['gap']:.2f}", left, remark)
    console.print()
    console.print(table)


def print_closed_loop(console: Console, diagnosis: dict[str, Any]) -> None:
    """Print how far the flights with the record's pilot stay from it, before and after."""
    if "closed_loop" not in diagnosis:
        return
    table = Table("flown again with the record's pilot, rms off by", box=None)
    for head in ("rig as filed", "improved"):
        table.add_column(head, justify="right")
    for name, found in diagnosis["closed_loop"].items():
        table.add_row(name, f"{found['before']:.3g}", f"{found['after']:.3g}")
    console.print()
    console.print(table)


def print_power(console: Console, sizes: Sequence[dict[str, Any]]) -> None:
    """Print the least size of each effect that the records would have shown."""
    table = Table("effect", "stage", "would have shown from", box=None)
    for item in sizes:
        if not item.get("judged", True):
            told = "its stage is not judged"
        elif not item["shows"]:
            told = "no size that it may have"
        else:
            numbers = item["parameters"].items()
            each = (f"{name} {in_figures(name, value)}" for name, value in numbers)
            told = ", ".join(each) or "it would show"
        table.add_row(item["name"], item["stage"], told)
    console.print()
    console.print(table)


def print_summary(console: Console, found: Sequence[dict[str, Any]]) -> None:
    """Print a line a record: verdict, effects, stages."""
    table = Table("record", "verdict", "effects", "guilty", "closed", box=None)
    for item in found:
        names = ", ".join(effect["name"] for effect in item["effects"])
        guilty = ", ".join(stage for stage, s in item["stages"].items() if s.get("guilty"))
        closed = item["shrink"].get("closed")
        table.add_row(
            item["record"],
            item["verdict"],
            names,
            guilty,
            "" if closed is None else f"{closed:.3f}",
        )
    console.print(table)
