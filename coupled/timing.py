"""Where a command's processor time goes; `coupled --timing`, which the help leaves out, prints it.

What is done before the first part that is timed is loading modules and reading files.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

_began: list[float] = []
_spent: dict[str, float] = {}


@contextmanager
def timed(part: str) -> Iterator[None]:
    """Count what is done within as spent on a part; parts do not stand within each other."""
    start = time.process_time()
    if not _began:
        _began.append(start)
    try:
        yield
    finally:
        _spent[part] = _spent.get(part, 0.0) + time.process_time() - start


def parts() -> dict[str, float]:
    """Return processor seconds of each part so far, loading first, all else last."""
    now = time.process_time()
    loading = _began[0] if _began else now
    return {"load": loading, **_spent, "rest": now - loading - sum(_spent.values())}
