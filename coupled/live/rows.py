"""The channels of a live flight in addition to a batch flight's, one value per frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from coupled.live.link import Link
from coupled.record.channels import LOADER_TIME, VALIDITY, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig


class Rows:
    """The validity of each row, and the time of its sample by the loader's clock.

    `always` records the validity even if every row is fresh; `timed` records the loader's time,
    which has no meaning in lock-step.
    """

    def __init__(self, frames: int, always: bool, timed: bool) -> None:
        self._always, self._timed = always, timed
        self.validity = np.zeros(frames, np.uint8)
        self.loader_time_s = np.full(frames, math.nan)

    def append_to(self, record: Record, first: int) -> Record:
        """Return a record with these channels appended; its first row is frame `first`.

        A simulated loader's validity is left out if all rows are fresh.
        """
        rows = slice(first, first + len(record))
        added: dict[str, Any] = {}
        if self._always or self.validity[: rows.stop].any():
            added[VALIDITY] = self.validity[rows]
        if self._timed and math.isfinite(self.loader_time_s[0]):
            added[LOADER_TIME] = self.loader_time_s[rows] - self.loader_time_s[0]
        if not added:
            return record
        names = (*record.channels, *added)
        data = np.column_stack((record.data, *added.values()))
        return Record(names, data, {**record.manifest, "channels": list(names)})


def only_measured(
    record: Record, link: Link, rig: Rig, measures_deflection: Sequence[bool]
) -> Record:
    """Return a record without the channels that its loader did not measure; δ by control.

    F_mod of a hybrid loader is removed too: its own multiplier computes it from the current δc, and
    the value of the host would look like a product held over the frame.
    """
    lacking: set[str] = set()
    for (name, control), grip in zip(rig.controls.items(), measures_deflection, strict=True):
        lacking |= {channel(name, "force_step"), channel(name, "stop"), channel(name, "hand_force")}
        if control.loader.multiplier == "hybrid":
            lacking.add(channel(name, "modifying_force"))
        if not link.measures_force:
            lacking.add(channel(name, "force"))
        if not grip:
            lacking.add(channel(name, "deflection"))
    kept = [i for i, name in enumerate(record.channels) if name not in lacking]
    names = tuple(record.channels[i] for i in kept)
    manifest = {**record.manifest, "channels": list(names)}
    return Record(names, np.ascontiguousarray(record.data[:, kept]), manifest)
