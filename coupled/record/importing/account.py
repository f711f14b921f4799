"""The account of an import: its clock, each channel's figures and doubts, unused columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from coupled.record.record import Record


@dataclass(frozen=True)
class ClockAccount:
    """How the rows of a log became frames; `method` is whether they were interpolated."""

    log_rows: int
    rows_used: int
    log_rate_Hz: float
    least_step_s: float
    greatest_step_s: float
    stamp_rounding_s: float
    start_s: float
    frame_rate_Hz: float
    frames: int
    method: Literal["rows as they are", "pchip"]
    missing_rows: int


@dataclass(frozen=True)
class ChannelAccount:
    """A channel's source in the log, its figures in its own unit, and doubts about it."""

    source: str
    least: float
    greatest: float
    rms: float
    noise: float
    doubts: tuple[str, ...]
    filled_cells: int

    @classmethod
    def constant(cls, value: float) -> ChannelAccount:
        """Return the account of a channel that no log holds."""
        return cls(f"value {value:g}", value, value, abs(value), 0.0, (), 0)

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        table = asdict(self)
        return {"from": table.pop("source"), **table, "doubts": list(self.doubts)}


@dataclass(frozen=True)
class ImportAccount:
    """The account of an import; `unmapped` are the log's columns that the map leaves out."""

    clock: ClockAccount
    channels: Mapping[str, ChannelAccount]
    unmapped: tuple[str, ...]
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON for a record's manifest."""
        return {
            "clock": asdict(self.clock),
            "channels": {name: found.as_dict() for name, found in self.channels.items()},
            "unmapped": list(self.unmapped),
            "warnings": list(self.warnings),
        }


def log_rate_of(record: Record) -> float | None:
    """Return the rows in a second of the log that a record was imported from; None if unknown."""
    rate: object = record.manifest
    for key in ("import", "clock", "log_rate_Hz"):
        rate = rate.get(key) if isinstance(rate, Mapping) else None
    return rate if isinstance(rate, float) else None
