"""The change of the flight by each effect: the improved rig is flown with and without it.

All flights use the record's force. The size of a gap does not show its importance for the flight:
a loader gap of 100 may hardly move the aircraft. With and without the effects, the flights differ
in pitch rate, load factor and surface. Each effect's share of this difference is its Shapley value
(`shapley`). The effect with the largest share should be corrected first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.display import percent
from coupled.gap.chain import AIRFRAME
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.flown import Again
from coupled.gap.findings.result import labelled
from coupled.gap.findings.shapley import shapley_subsets
from coupled.gap.stages.surfaces import surface_channel
from coupled.gap.thresholds import IN_FLIGHT_LEAST
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
LOAD = "load_factor"
Owned = tuple[ControlName | None, str]
RATES: Mapping[ControlName, tuple[str, ...]] = {
    "column": ("pitch_rate_rad_per_s", LOAD),
    "wheel": ("roll_rate_rad_per_s",),
    "pedals": ("yaw_rate_rad_per_s",),
}


@dataclass(frozen=True)
class EffectInFlight:
    """The change of the flight by one effect, by channel.

    `shares` are of the power of the change by all effects, and sum to 1; negative if the effect
    counteracts the others. `changes` are the RMS differences if the effect is removed, in the
    channel's unit. `of_motion` is the same over the RMS of the channel's motion, with all effects
    or with none, whichever is larger. `share` is over all channels, each normalised by its motion.
    `control` is that of the effect where several are judged; None for the airframe.
    """

    name: str
    share: float
    shares: Mapping[str, float]
    changes: Mapping[str, float]
    of_motion: Mapping[str, float]
    control: ControlName | None = None

    @property
    def shows(self) -> bool:
        """Whether removing the effect changes any channel by at least `IN_FLIGHT_LEAST`."""
        return any(value >= IN_FLIGHT_LEAST for value in self.of_motion.values())

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {
            "name": self.name,
            "share": self.share,
            "shares": dict(self.shares),
            "changes": dict(self.changes),
            "of_motion": dict(self.of_motion),
        }


def in_flight(
    effects: Sequence[Owned],
    rig_with: Callable[[Sequence[int]], Rig],
    controls: Sequence[ControlName],
    again: Again,
) -> tuple[EffectInFlight, ...] | None:
    """Return the change of the flight by each effect, largest first; None if it cannot be flown.

    `effects` are the control and the name of each, `rig_with` returns the rig with those of the
    given indices, `controls` are the judged ones. Time stamps of the recorder are set to zero,
    since they do not affect the flight.
    """
    if rig_with(()).flight is None or not effects:
        return None
    subsets, weights = shapley_subsets(count := len(effects))
    flights = []
    for subset in subsets:
        kept = [i for i in range(count) if subset & 1 << i]
        flown = again.fly(_unstamped(rig_with(kept), controls))
        if flown is None:
            return None
        flights.append(flown)
    known = (BY_NAME.get(name) for _, name in effects)  # a term of the model is not in the library
    turning = RATES if any(e is None or e.stage == AIRFRAME for e in known) else controls
    shown = [*(name for c in turning for name in RATES[c]), *map(surface_channel, controls)]
    names = [name for name in shown if name in flights[-1]]
    rows = min(len(flown) for flown in flights)
    whole = np.array([flights[-1][name][:rows] for name in names])
    each = np.array([[flown[name][:rows] for name in names] for flown in flights])
    power = np.mean((each - whole) ** 2, axis=2)  # (subsets, channels)
    # An effect may suppress a motion, so the motion is the larger with or without effects.
    moved = np.mean((each - each[:, :, :1]) ** 2, axis=2)
    motion = np.sqrt(np.maximum(moved[0], moved[-1]))
    shares = weights @ power
    changed = np.flatnonzero((motion > 0.0) & (power[0] > (1e-3 * IN_FLIGHT_LEAST * motion) ** 2))
    weight = 1.0 / motion[changed] ** 2
    total = float(power[0, changed] @ weight)

    def of(i: int) -> EffectInFlight:
        without = np.sqrt(power[subsets.index(subsets[-1] - (1 << i))])
        relative = np.divide(without, motion, out=np.zeros_like(without), where=motion > 0.0)
        control, name = effects[i]
        return EffectInFlight(
            name,
            float(shares[i, changed] @ weight) / total if total > 0.0 else 0.0,
            {names[c]: float(shares[i, c] / power[0, c]) for c in changed},
            dict(zip(names, without.tolist(), strict=True)),
            dict(zip(names, relative.tolist(), strict=True)),
            control,
        )

    return tuple(sorted(map(of, range(count)), key=lambda one: -one.share))


def _unstamped(rig: Rig, controls: Sequence[ControlName]) -> Rig:
    """Return a rig whose recorder stamps all channels without delay."""
    stamps = {f"controls.{name}.sensing.force_stamp_s": 0.0 for name in controls}
    late = rig.flight is not None and rig.flight.motion_stamp != 0.0
    late = late or any(rig.controls[name].sensing.force_stamp != 0.0 for name in controls)
    return rig.changed({"flight.motion_stamp_s": 0.0, **stamps}) if late else rig


def in_words(effects: Sequence[EffectInFlight]) -> str:
    """Return in words how the effects change the flight, and which to correct first."""
    shown = [effect for effect in effects if effect.shows]
    if not shown:
        return "In flight it hardly shows: no channel of the motion changes by 1 %."
    if len(effects) == 1:
        (only,) = effects
        parts = [f"the {_plain(n)} by {_per_cent(v)}" for n, v in only.of_motion.items()]
        return f"In flight it changes {_listed(parts)} of their rms."
    parts = [f"{labelled(e.name, e.control)} {_per_cent(e.share)}" for e in effects]
    first = labelled(effects[0].name, effects[0].control)
    return f"Shares of the change in flight: {_listed(parts)}. Correct {first} first."


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else ", ".join(parts[:-1]) + " and " + parts[-1]


def _plain(name: str) -> str:
    for unit in ("_rad_per_s", "_rad"):
        name = name.removesuffix(unit)
    return name.replace("_", " ")


def _per_cent(share: float) -> str:
    return percent(share, 0 if abs(share) >= 0.095 else 1)
