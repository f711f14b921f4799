"""A log of two sensors, its map, and the record that an import makes of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from coupled.record.importing.account import ImportAccount
from coupled.record.importing.convert import import_log
from coupled.record.record import Record

ROWS = 600
RNG = np.random.default_rng(3)
TIME_s = np.arange(ROWS) / 60.0
DEFLECTION_m = 0.03 * np.sin(TIME_s) + 2e-5 * RNG.standard_normal(ROWS)
GRADIENT = 560.0
FORCE_N = GRADIENT * 0.03 * np.sin(TIME_s) + 0.1 * RNG.standard_normal(ROWS)

MAP = """
[clock]
from = "T"
unit = "ms"

[channels.column_force_N]
from = "F"
unit = "lbf"
sign = -1

[channels.column_computed_m]
from = "D"
unit = "in"
"""


def text(time_ms: Any = None, force: Any = None, deflection: Any = None, form: str = ".12g") -> str:
    columns = (
        1000.0 * TIME_s if time_ms is None else time_ms,
        -FORCE_N / 4.4482216152605 if force is None else force,
        DEFLECTION_m / 0.0254 if deflection is None else deflection,
    )
    rows = [",".join(format(x, form) for x in row) for row in zip(*columns, strict=True)]
    return "T,F,D\n" + "\n".join(rows) + "\n"


GOOD = text()
LINES = GOOD.splitlines()


def imported(
    folder: Path, log: str | bytes = GOOD, log_map: str = MAP, name: str = "log.csv"
) -> tuple[Record, ImportAccount]:
    (folder / name).write_bytes(log.encode() if isinstance(log, str) else log)
    (folder / "map.toml").write_text(log_map, encoding="utf-8")
    return import_log(folder / name, folder / "map.toml")


def edited(row: int, line: str) -> str:
    """Return the valid log with one line replaced."""
    return "\n".join([*LINES[:row], line, *LINES[row + 1 :]])
