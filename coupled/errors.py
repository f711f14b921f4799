"""Errors of user input or of a flight, reported as one line each."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TextIO

LONGEST = 200  # characters of a user's text repeated in a message
LONGEST_VALUE = 60  # characters of a value repeated in a message
LONGEST_MESSAGE = 3000  # characters of a whole message
MISSING = "is missing"  # problem of a required key
LISTED = 100  # known names listed in a hint
_SEARCHED = 2000  # known names searched for a hint


def printable(text: str) -> str:
    """Return text with a question mark for each character that a terminal would interpret.

    These are escape sequences, other control characters and invalid bytes. Spaces, tabs and line
    ends are kept.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else "?" for c in text)


def shown(text: str, longest: int = LONGEST) -> str:
    """Return a user's text for a message: on one line, printable, and cut if long."""
    plain = printable(text[: longest + 1]).replace("\n", "?").replace("\t", "?")
    return plain if len(plain) <= longest else plain[:longest] + "…"


def shown_value(value: object) -> str:
    """Return a value of a file or of a call for a message, cut if long."""
    if isinstance(value, int) and abs(value) > 10**300:
        return "an integer of hundreds of digits"
    text = f"of type {type(value).__name__}"
    plain = isinstance(value, (bool, int, float, str, list, tuple, dict, set, type(None)))
    if plain or getattr(value, "shape", None) == ():  # a numpy scalar
        with suppress(ValueError):  # Python refuses to write integers of thousands of digits
            text = repr(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."


def say_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a library's warning as one line, without the code location.

    Meant as `warnings.showwarning`.
    """
    print(f"note: {_sentence(str(message))}", file=file or sys.stderr)


def _sentence(text: str) -> str:
    """Return a message on one line, with long words and long messages cut."""
    cut = " ".join(shown(word) for word in text[: 100 * LONGEST_MESSAGE].split())
    return shown(cut, LONGEST_MESSAGE)


class InputError(ValueError):
    """An error in the user's input. Its text is the one line that a user sees.

    Parameters: the `file` with the error, the `key` in the file (dotted; may be empty), and the
    `problem`, with a hint to correct it. `more` are further errors of the same file.

    >>> import coupled
    >>> try:
    ...     coupled.load_rig("t38")
    ... except coupled.InputError as error:
    ...     print(error)
    t38: is no shipped rig; did you mean t37?
    """

    def __init__(
        self, file: object, key: str, problem: str, more: Sequence[InputError] = ()
    ) -> None:
        self.more = tuple(more)
        self.file, self.key = shown(str(file)), shown(str(key))
        self.problem = _sentence(str(problem))
        where = f"{self.file}: {self.key}: " if self.key else f"{self.file}: "
        super().__init__(where + self.problem)

    def __reduce__(
        self,
    ) -> tuple[type[InputError], tuple[str, str, str, tuple[InputError, ...]]]:
        """Pickle the error, to pass it between processes."""
        return InputError, (self.file, self.key, self.problem, self.more)

    @property
    def every(self) -> tuple[InputError, ...]:
        """The error itself and the further errors of the same file."""
        return (self, *self.more)


class MissingKeyError(InputError, KeyError):
    """A missing key, channel or similar name."""

    __str__ = InputError.__str__


@contextmanager
def collected(faults: list[InputError]) -> Iterator[None]:
    """Collect an InputError of this context in `faults`, so that later errors are found too."""
    try:
        yield
    except InputError as error:
        faults += [InputError(one.file, one.key, one.problem) for one in error.every]


def together(faults: Sequence[InputError]) -> InputError:
    """Return the errors of a file as one error: the first, with the others in `more`."""
    every = [one for fault in faults for one in fault.every]
    hints = " ".join(one.problem for one in every)
    found: dict[tuple[str, str], InputError] = {}
    for one in every:
        name = one.key.rpartition(".")[2]
        renamed = f"give {name} instead" in hints or f"did you mean {name}?" in hints
        wrong = any(
            other.key.startswith(f"{one.key}.")
            or (other.key == one.key and other.problem != MISSING)
            for other in every
        )
        if one.problem == MISSING and (renamed or wrong):
            continue  # present under another name, or with an error
        found.setdefault((one.key, one.problem), InputError(one.file, one.key, one.problem))
    first, *others = found.values()
    return InputError(first.file, first.key, first.problem, others)


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint with the known name most similar to `word`, or a list of known names."""
    names = [shown(name) for name in islice(known, _SEARCHED + 1)]
    begun = [name for name in names if word and name.startswith(f"{word}_")]
    if begun:  # its unit was omitted
        return f"did you mean {_quoted(min(begun, key=len))}?"
    plain = {name.casefold(): name for name in names}
    match = difflib.get_close_matches(word[:LONGEST].casefold(), plain, n=1, cutoff=0.6)
    if match:
        return f"did you mean {_quoted(plain[match[0]])}?"
    more = ", …" if len(names) > LISTED else ""
    return "known: " + listed(sorted(names)[:LISTED]) + more


def joined(words: Sequence[str]) -> str:
    """Return words as a list in prose: a, b and c."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def listed(names: Iterable[str]) -> str:
    """Return names separated by commas; names that contain a comma are quoted."""
    return ", ".join(_quoted(shown(name)) for name in names)


def _quoted(name: str) -> str:
    """Return a name quoted if it contains a comma."""
    return f'"{name}"' if "," in name else name
