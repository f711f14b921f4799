"""One flight of a comparison, and the figures of its outcome."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from coupled.display import percent
from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.record import Record
from coupled.results import Result


@dataclass(frozen=True)
class Outcome:
    """The figures of one flight; SI, shares without unit, None if there is none."""

    case: str
    configuration: str
    control: str
    asked_norm: float  # command for the deflection, of ±1, limited to the surface's travel
    reached_norm: float  # surface command reached, likewise limited
    hand_travel_norm: float  # the hand's deflection, a pull positive, of the control's travel
    loss: float  # lost share of the command
    loss_closed_form: float  # the same by the rig's statics
    felt_ratio: float  # force felt over force specified, without breakout
    felt_ratio_closed_form: float
    force_N: float  # largest force of the pilot's hand
    force_step_N: float  # largest jump of the modifying force from frame to frame
    peak_rate_rad_per_s: float | None  # of pitch, roll or yaw, to the pilot's side
    peak_load_factor: float | None
    time_to_attitude_s: float | None  # from the pilot's start
    ended_early: str  # the reason, or empty
    surface_stop_norm: float | None = None  # command at its stop, if more is commanded
    loader_rests: bool = False  # the hand force is below breakout and friction

    def as_dict(self) -> dict[str, Any]:
        """Return the figures by name for JSON (no NaN)."""
        items = asdict(self).items()
        return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in items}


@dataclass(frozen=True)
class Flight(Result):
    """One flight: its manoeuvre, its record, and the figures of its outcome.

    `configuration` is one of the manoeuvre's, or the name of an unchanged rig.
    """

    manoeuvre: Manoeuvre
    configuration: str
    record: Record
    outcome: Outcome

    @property
    def ended_early(self) -> str:
        """Why and when the flight ended early, or an empty string."""
        return self.outcome.ended_early

    def __repr__(self) -> str:
        ended = f", ended early: {self.ended_early}" if self.ended_early else ""
        loss, seconds = self.outcome.loss, self.manoeuvre.duration_s
        lost = f", {percent(loss)} authority lost" if math.isfinite(loss) else ""
        return f"Flight({self.manoeuvre.label}, {self.configuration}: {seconds:g} s{lost}{ended})"
