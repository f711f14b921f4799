"""What a user did, or a flight met, that ends the work: one line each."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

LONGEST = 200  # characters of a user's word that a message repeats


def _shown(text: str) -> str:
    """Return a user's word on one line, cut if it is endless."""
    plain = "".join(c if c.isprintable() else "?" for c in text)
    return plain if len(plain) <= LONGEST else plain[:LONGEST] + "…"


class InputError(ValueError):
    """Input that cannot be used. Its text is the one line that a user sees.

    Parameters: `file` where the fault stands, `key` within it (dotted; may be
    empty), and `problem`, which also says what would be right.
    """

    def __init__(self, file: object, key: str, problem: str) -> None:
        self.file, self.key, self.problem = _shown(str(file)), _shown(key), problem
        where = f"{self.file}: {self.key}: " if key else f"{self.file}: "
        super().__init__(where + " ".join(problem.split()))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        """Let it pass from one process to another."""
        return InputError, (self.file, self.key, self.problem)


def nearest(word: str, known: Iterable[str]) -> str:
    """Return a hint that names the known word most like `word`, or lists them all."""
    known = list(known)
    plain = {name.casefold(): name for name in known}
    word = word[:LONGEST].casefold()
    match = difflib.get_close_matches(word, plain, n=1, cutoff=0.6)
    return f"did you mean {plain[match[0]]}?" if match else "known: " + ", ".join(sorted(known))
