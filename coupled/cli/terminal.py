"""What every command says and how: consoles, progress, one line of a fault, JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from coupled.errors import InputError
from coupled.files import check_target, write_text

out = Console()
err = Console(stderr=True)


def say(text: str) -> None:
    """Print a line that may name a file, as it is."""
    out.print(text, markup=False, highlight=False, soft_wrap=True)


def say_error(text: str) -> None:
    """Print the one line of a fault."""
    err.print(f"[red]error:[/] {escape(text)}", soft_wrap=True, highlight=False)


@contextmanager
def progress() -> Iterator[Callable[[str, int, int], None]]:
    """Show progress on the terminal while work goes on; nothing where there is none."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task("starting (the first start compiles the physics)", total=None)

        def advance(label: str, done: int, total: int) -> None:
            bar.update(task, description=escape(label), completed=done, total=total)

        yield advance


def check_json(target: str, others: list[Path]) -> None:
    """Refuse a JSON file that could not be written, or that is one of the others."""
    if target and target != "-":
        path = Path(target)
        check_target(path, others)
        if path.absolute() in [other.absolute() for other in others]:
            raise InputError(path, "--json", "is another file of this command")


def give_json(table: Any, target: str) -> None:
    """Write a table as JSON where it was asked for; - prints it."""
    if not target:
        return
    text = json.dumps(table, indent=2, ensure_ascii=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
    else:
        write_text(Path(target), text)
