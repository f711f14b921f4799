"""A matrix in which each column is a channel, in a file of any format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.record.importing.formats.columns import Numbers


def columns_of_matrix(
    path: Path, matrix: str, table: Any, names: list[str] | str, words: list[str]
) -> dict[str, Numbers]:
    """Return the columns of the variable `matrix`, shape (rows, columns), by their `words`.

    `names` is the map's own `log.names`. Raises InputError if they do not match.
    """
    if not isinstance(table, np.ndarray) or table.ndim != 2 or table.dtype.kind not in "biuf":
        raise InputError(path, matrix, "is no matrix of numbers; log.matrix names one")
    if not words:
        problem = "holds no names; log.names is a list of them or the variable that holds them"
        raise InputError(path, str(names), problem)
    if len(words) != table.shape[1]:
        problem = f"has {table.shape[1]} columns, and {len(words)} names"
        raise InputError(path, matrix, problem)
    if len(set(words)) < len(words):
        raise InputError(path, matrix, "two of its columns have one name")
    return {word: table[:, i].astype(np.float64) for i, word in enumerate(words)}
