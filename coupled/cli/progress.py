"""Progress of long work: a bar on a terminal, otherwise a line every ten seconds."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.markup import escape

from coupled.cli.process import was_interrupted
from coupled.cli.terminal import err

Advance = Callable[[str, int, int], None]
EVERY_s = 10.0  # between the lines without a terminal
MARK = "…"  # before each line, so that a log can be filtered


@contextmanager
def progress(first: str = "") -> Iterator[Advance]:
    """Show the progress of this context on standard error.

    The yielded function is called with a label, the amount done and the total. `first` is the label
    until then; by default that the command is starting.
    """
    with _bar(first or _starting()) if err.is_terminal else _lines(first) as show:

        def advance(label: str, done: int, total: int) -> None:
            if was_interrupted():  # a library may suppress it and the work continue
                raise KeyboardInterrupt
            show(label, done, total)

        yield advance


@contextmanager
def _bar(first: str) -> Iterator[Advance]:
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task(escape(first), total=None)

        def advance(label: str, done: int, total: int) -> None:
            bar.update(task, description=escape(label), completed=done, total=total or None)

        yield advance


@contextmanager
def _lines(first: str) -> Iterator[Advance]:
    """Print a line at intervals from a thread, even if the work reports nothing."""
    began, over = time.monotonic(), threading.Event()
    latest: list[tuple[str, int, int]] = [(first, 0, 0)]

    def tell() -> None:
        while not over.wait(EVERY_s):
            label, done, total = latest[0]
            label = label or _starting()
            share = f", {100 * done / total:.0f} %" if total else ""
            text = f"{MARK} {label}{share}, after {time.monotonic() - began:.0f} s"
            err.print(text, markup=False, highlight=False, soft_wrap=True)

    def advance(label: str, done: int, total: int) -> None:
        latest[0] = (label, done, total)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield advance
    finally:
        over.set()
        teller.join()


def _starting() -> str:
    """Return the text shown while a command loads; compilation takes most of this time."""
    from coupled.rig.compiled import compiled_before
    from coupled.rig.placed import step_frame_at

    if compiled_before(step_frame_at):
        return "starting"
    return "starting (the first start compiles the physics)"
