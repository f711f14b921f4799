"""Output of commands: consoles, error messages, JSON."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
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
    """The reader of the standard output has closed it, as `head` does."""


class SafeConsole(Console):
    """A console that prints control characters in names and headers of files as `?`.

    An overlong word is cut. A closed pipe of the output ends the command.
    """

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the segments to print, with printable text."""
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                yield Segment(printable(segment.text), segment.style)

    def render_str(self, text: str, **how: Any) -> Text:
        """Return a word as text, cut if it is overlong."""
        return super().render_str(_LONG_WORD.sub(r"\1…", text), **how)

    @contextmanager
    def widened(self, wide: bool) -> Iterator[None]:
        """Print lines and tables at their full width, not the terminal's, if requested."""
        before = self.width
        if wide:
            self.width = WIDEST
        try:
            yield
        finally:
            self.width = before

    def on_broken_pipe(self) -> None:
        """Raise ReaderGoneError: the command line ends without a message."""
        raise ReaderGoneError


out = SafeConsole()
err = SafeConsole(stderr=True)


def say(text: str) -> None:
    """Print a line that may name a file, as it is."""
    out.print(text, markup=False, highlight=False, soft_wrap=True)


def say_note(text: str) -> None:
    """Print a note on standard error."""
    err.print(f"[yellow]note:[/] {escape(text)}", soft_wrap=True, highlight=False)


def say_error(text: str) -> None:
    """Print an error in one line."""
    err.print(f"[red]error:[/] {escape(text)}", soft_wrap=True, highlight=False)


def refuse_needless(command: str, given: Mapping[str, object], problem: str) -> None:
    """Raise InputError for an option that is given and has no effect."""
    for option, value in given.items():
        if value:
            raise InputError(command, option, problem)


def check_json(target: str, others: list[Path]) -> None:
    """Raise InputError if a JSON file cannot be written or is one of the others."""
    if target == "-" and sys.stdout is None:
        raise InputError("standard output", "--json", "is closed; give a file")
    if target and target != "-":
        check_target(Path(target), others, "is another file of this command; give another name")


def keep_json(table: Any, target: str, outputs: Outputs) -> None:
    """Write a table as JSON with the command's other files, if a file was requested."""
    if target not in ("", "-"):
        write_text(outputs.at(Path(target)), json_text(table))


def print_json(table: Any, target: str) -> None:
    """Print a table as JSON if the file is `-`.

    Letters that the terminal lacks, and control characters, are escaped.
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
    """Write a table as JSON if requested; `-` prints it."""
    with Outputs() as outputs:
        keep_json(table, target, outputs)
    print_json(table, target)
