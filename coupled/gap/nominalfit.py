"""The results of a fit of a nominal rig, and their JSON."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from coupled.gap.search.found import Alike
from coupled.record.channels import ControlName
from coupled.results import TableResult, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True)
class Number:
    """A fitted parameter: value in the file, fitted value, and half of its 95 % interval.

    `half` is None if the parameter is undetermined. `least` is the lower bound.
    """

    key: str
    filed: float
    found: float
    half: float | None
    least: float = -math.inf
    at_bound: bool = False

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval, cut at the lower bound; None if undetermined."""
        if self.half is None:
            return None
        return max(self.found - self.half, self.least), self.found + self.half

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        ends = self.interval or (None, None)
        known = {"filed": self.filed, "found": self.found, "low": ends[0], "high": ends[1]}
        return known | ({"at_bound": True} if self.at_bound else {})


@dataclass(frozen=True)
class ChannelFit:
    """The prediction error of a channel on held-out stretches, rms in its unit.

    `before` is the error with the rig file, `after` with the fitted rig, `floor` the noise floor,
    and `moves` the standard deviation of the channel.
    """

    file: str
    channel: str
    before: float
    after: float
    floor: float
    moves: float

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {
            "record": self.file,
            "channel": self.channel,
            "before": self.before,
            "after": self.after,
            "floor": self.floor,
            "moves": self.moves,
        }


@dataclass(frozen=True)
class NominalFit(TableResult):
    """A nominal rig fitted to records: its parameters, and which of them are not identifiable."""

    control: ControlName
    rig: Rig
    numbers: tuple[Number, ...]
    alike: tuple[Alike, ...]
    channels: tuple[ChannelFit, ...]
    doubts: tuple[str, ...] = ()  # reasons against fitted values, a sentence each

    def __repr__(self) -> str:
        doubts = f", {len(self.doubts)} doubts" if self.doubts else ""
        known = len(self.numbers) - len(self.unknown)
        of = f"{known} of {len(self.numbers)} numbers determined"
        return f"NominalFit({self.rig.name}, {self.control}: {of}{doubts})"

    def to_polars(self) -> pl.DataFrame:
        """Return a row per parameter: key, filed and fitted value, and 95 % interval."""
        return frame_of([{"key": one.key} | one.as_dict() for one in self.numbers])

    @property
    def unknown(self) -> tuple[str, ...]:
        """The keys of undetermined parameters."""
        return tuple(number.key for number in self.numbers if number.half is None)

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {
            "control": self.control,
            "numbers": {number.key: number.as_dict() for number in self.numbers},
            "alike": [one.as_dict() for one in self.alike],
            "undetermined": list(self.unknown),
            "channels": [one.as_dict() for one in self.channels],
            "doubts": list(self.doubts),
        }
