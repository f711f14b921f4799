"""What a user did, or a flight met, that ends the work: one line each."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from typing import TextIO

LONGEST = 200  # characters of a user's word that a message repeats
LONGEST_VALUE = 60  # characters of a value that a message repeats
LONGEST_MESSAGE = 3000  # characters of a whole message
MISSING = "is missing"  # the problem of a key that must be given
LISTED = 100  # known words that a hint lists
_SEARCHED = 2000  # known words that a hint is sought among


def printable(text: str) -> str:
    """Return text with a question mark for each character that a terminal would act on.

    Escape sequences, other control characters and bytes that are no text go; spaces,
    tabs and the ends of lines stay.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else "?" for c in text)


def shown(text: str, longest: int = LONGEST) -> str:
    """Return a user's word as a message repeats it: on one line, printable, and cut if long."""
    plain = printable(text[: longest + 1]).replace("\n", "?").replace("\t", "?")
    return plain if len(plain) <= longest else plain[:longest] + "…"


def shown_value(value: object) -> str:
    """Return a value of a file or of a call as a message repeats it, cut if long."""
    if isinstance(value, int) and abs(value) > 10**300:
        return "an integer of hundreds of digits"
    text = f"of type {type(value).__name__}"
    plain = isinstance(value, (bool, int, float, str, list, tuple, dict, set, type(None)))
    if plain or getattr(value, "shape", None) == ():  # a number of numpy
        with suppress(ValueError):  # of an integer of thousands of digits, which Python writes not
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
    """Print a library's warning as one line, without the place in the code that it comes from.

    To be set as `warnings.showwarning`.
    """
    print(f"note: {_sentence(str(message))}", file=file or sys.stderr)


def _sentence(text: str) -> str:
    """Return a message on one line, its long words cut, and the whole cut if it is endless."""
    cut = " ".join(shown(word) for word in text[: 100 * LONGEST_MESSAGE].split())
    return shown(cut, LONGEST_MESSAGE)


class InputError(ValueError):
    """Input that cannot be used. Its text is the one line that a user sees.

    Parameters: `file` where the fault stands, `key` within it (dotted; may be
    empty), and `problem`, which also says what would be right. `more` are further
    faults of the same file, each a line of its own.

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
        """Let it pass from one process to another."""
        return InputError, (self.file, self.key, self.problem, self.more)

    @property
    def every(self) -> tuple[InputError, ...]:
        """The fault, and the further ones of its file."""
        return (self, *self.more)


class MissingKeyError(InputError, KeyError):
    """A key, a channel or the like that is not there."""

    __str__ = InputError.__str__


@contextmanager
def collected(faults: list[InputError]) -> Iterator[None]:
    """Keep the faults of what is done within, so that those of the rest are found, too."""
    try:
        yield
    except InputError as error:
        faults += [InputError(one.file, one.key, one.problem) for one in error.every]


def together(faults: Sequence[InputError]) -> InputError:
    """Return the faults of a file as one that is raised: the first, with the others."""
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
            continue  # it is there, by another name or with a fault of its own
        found.setdefault((one.key, one.problem), InputError(one.file, one.key, one.problem))
    first, *others = found.values()
    return InputError(first.file, first.key, first.problem, others)


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint that names the known word most like `word`, or lists the first of them."""
    names = [shown(name) for name in islice(known, _SEARCHED + 1)]
    begun = [name for name in names if word and name.startswith(f"{word}_")]
    if begun:  # its unit was left out
        return f"did you mean {_quoted(min(begun, key=len))}?"
    plain = {name.casefold(): name for name in names}
    match = difflib.get_close_matches(word[:LONGEST].casefold(), plain, n=1, cutoff=0.6)
    if match:
        return f"did you mean {_quoted(plain[match[0]])}?"
    more = ", …" if len(names) > LISTED else ""
    return "known: " + listed(sorted(names)[:LISTED]) + more


def listed(names: Iterable[str]) -> str:
    """Return names in a row, those with a comma in them in quotes."""
    return ", ".join(_quoted(shown(name)) for name in names)


def _quoted(name: str) -> str:
    """Return a name as a list of names shows it, so that its commas are its own."""
    return f'"{name}"' if "," in name else name
