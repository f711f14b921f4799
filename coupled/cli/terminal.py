"""What every command says and how: consoles, progress, one line of a fault, JSON."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.markup import escape
from rich.segment import Segment
from rich.text import Text

from coupled.errors import InputError, printable
from coupled.files import check_target, finite, json_text, write_text
from coupled.outputs import Outputs

WIDEST = 400  # columns of a table that is not fitted to the terminal
LONGEST_WORD = 1000  # characters of a word, a name or a path that is printed
_LONG_WORD = re.compile(rf"(\S{{{LONGEST_WORD}}})\S+")


class ReaderGoneError(Exception):
    """Whoever read the standard output has gone, as `head` does when it has enough."""


class SafeConsole(Console):
    """A console on which no name or header of a file acts: its control characters are `?`.

    A word without end is cut. A reader of the output that has gone ends the command.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the segments of what is printed, their text made printable."""
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)

    def render_str(self, text: str, **how: Any) -> Text:
        """Return a word as text, cut where it has no end."""
        return super().render_str(_LONG_WORD.sub(r"\1…", text), **how)

    @contextmanager
    def widened(self, wide: bool) -> Iterator[None]:
        """Print lines and tables at their own width where asked to, whatever the terminal's."""
        before = self.width
        if wide:
            self.width = WIDEST
        try:
            yield
        finally:
            self.width = before

    def on_broken_pipe(self) -> None:
        """Leave it to the command line, which ends in silence."""
        raise ReaderGoneError


out = SafeConsole()
err = SafeConsole(stderr=True)


def say(text: str) -> None:
    """Print a line that may name a file, as it is."""
    out.print(text, markup=False, highlight=False, soft_wrap=True)


def say_note(text: str) -> None:
    """Print a line that a user should know beside a command's output, on the error side."""
    err.print(f"[yellow]note:[/] {escape(text)}", soft_wrap=True, highlight=False)


def say_error(text: str) -> None:
    """Print the one line of a fault."""
    err.print(f"[red]error:[/] {escape(text)}", soft_wrap=True, highlight=False)


def check_json(target: str, others: list[Path]) -> None:
    """Refuse a JSON file that could not be written, or that is one of the others."""
    if target == "-" and sys.stdout is None:
        raise InputError("standard output", "--json", "is closed; give a file")
    if target and target != "-":
        check_target(Path(target), others, "is another file of this command; give another name")


def keep_json(table: Any, target: str, outputs: Outputs) -> None:
    """Write a table as JSON with the command's other files, where a file was asked for."""
    if target not in ("", "-"):
        write_text(outputs.at(Path(target)), json_text(table))


def print_json(table: Any, target: str) -> None:
    """Print a table as JSON where - was asked for.

    Where the terminal lacks a letter, or would act on one, JSON's own escapes stand for it.
    """
    if target != "-":
        return
    text = json_text(table)
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = json.dumps(finite(table), indent=2) + "\n"
    if sys.stdout.isatty() and printable(text) != text:
        text = json.dumps(finite(table), indent=2) + "\n"
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        raise ReaderGoneError from None


def give_json(table: Any, target: str) -> None:
    """Write a table as JSON where it was asked for; - prints it."""
    with Outputs() as outputs:
        keep_json(table, target, outputs)
    print_json(table, target)
