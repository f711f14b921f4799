"""The conditions of a version's records, and of one record in its key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from coupled.blind.twin.twin import Bristles


@dataclass(frozen=True)
class Realism:
    """Properties of a version's rigs and loggers that the nominal rig does not have.

    presliding_m    bounds of the presliding length of friction, drawn log-uniform; None for
                    bristles of 0.3 to 1.5 μJ
    coloured_noise  share of the records in which half of the channels have noise with a corner
    corner_Hz       bounds of that corner frequency, drawn log-uniform
    skewed_clock    share of the records with late time stamps of force or motion
    wheels          share of the records with the force on a wheel, too
    """

    presliding_m: tuple[float, float] | None = None
    coloured_noise: float = 0.0
    corner_Hz: tuple[float, float] = (8.0, 40.0)
    skewed_clock: float = 0.0
    wheels: float = 0.0


PLAIN = Realism()
# Conditions that a record of version 1 does not have.
LATER = ("presliding_m", "elastic_share", "corner_Hz", "force_skew_s", "motion_skew_s")


@dataclass(frozen=True)
class Conditions:
    """The conditions of a record in its key.

    level_N        of the pilot's force
    noise          standard deviation of each channel's noise, SI
    bristle_J      friction times the bristles' length; of version 1
    presliding_m   the bristles' length, if drawn by itself
    elastic_share  share of that length below which nothing slips
    corner_Hz      of the channels with noise of a first-order lag
    force_skew_s, motion_skew_s  delays of the time stamps of force and motion
    """

    duration_s: float
    excitation: tuple[str, ...]
    level_N: float
    noise: Mapping[str, float]
    bristle_J: float | None = None
    presliding_m: float | None = None
    elastic_share: float = 0.0
    corner_Hz: Mapping[str, float] = field(default_factory=dict)
    force_skew_s: float = 0.0
    motion_skew_s: float = 0.0

    @property
    def bristles(self) -> Bristles:
        """The bristles of the rig's friction."""
        if self.bristle_J is not None:
            return Bristles(energy_J=self.bristle_J)
        return Bristles(self.presliding_m, elastic_share=self.elastic_share)

    def as_dict(self) -> dict[str, Any]:
        """Return the conditions for the key, those of the record's version."""
        left_out = {"bristle_J"} if self.bristle_J is None else LATER
        table = asdict(self) | {"excitation": list(self.excitation)}
        return {name: value for name, value in table.items() if name not in left_out}
