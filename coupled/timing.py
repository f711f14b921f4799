"""Processor time of a command by part, printed by the hidden option `coupled --timing`.

The time before the first timed part is for loading modules and reading files.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

_began: list[float] = []
_spent: dict[str, float] = {}


@contextmanager
def timed(part: str) -> Iterator[None]:
    """Add the processor time of this context to a part; parts are not nested."""
    start = time.process_time()
    if not _began:
        _began.append(start)
    try:
        yield
    finally:
        _spent[part] = _spent.get(part, 0.0) + time.process_time() - start


def parts() -> dict[str, float]:
    """Return the processor seconds of each part, loading first, the rest last."""
    now = time.process_time()
    loading = _began[0] if _began else now
    return {"load": loading, **_spent, "rest": now - loading - sum(_spent.values())}
