"""Authority: the loss by the bend in flight, and the effect of each correction.

One manoeuvre is flown in several configurations; an `Outcome` has the figures of one flight. Loss
and felt ratio are taken while the control is held still, at half or more of its largest deflection,
beside the closed form of the rig's statics there (without friction). Deflection and force are the
hand's own, not the readings of sensors; breakout and bob weight are subtracted before forces are
compared.

Authority is measured at the surface: a command beyond the surface's stop has no effect, and a
shortfall beyond it is no loss. A hand force below breakout and friction moves no loader, and has
neither a loss nor a felt ratio.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from coupled.arguments import public
from coupled.authority.figures import remarks
from coupled.authority.heldcontrol import (
    average_commands,
    average_forces,
    find_held_rows,
    loader_rests,
    predict_at_rest,
    true_deflection,
)
from coupled.authority.outcome import Flight, Outcome
from coupled.display import System
from coupled.errors import InputError, listed, nearest
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.channels import ATTITUDE, RATE, ControlName, channel
from coupled.record.record import Record
from coupled.results import TableResult, frame_of

if TYPE_CHECKING:
    import polars as pl

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

__all__ = ["AS_THE_RIG", "Comparison", "Flight", "Outcome", "compare", "fly_and_judge", "judge"]

_STILL = 1e-4  # rad/s of a rate, below which an aircraft does not turn
AS_THE_RIG = "as the rig file says"  # configuration name of an unchanged rig


@dataclass(frozen=True, repr=False)
class Comparison(Sequence[Flight], TableResult):
    """Flights of one run's cases, each in several configurations; a sequence of `Flight`."""

    flights: tuple[Flight, ...]

    @overload
    def __getitem__(self, index: int) -> Flight: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Flight, ...]: ...

    def __getitem__(self, index: int | slice) -> Flight | tuple[Flight, ...]:
        return self.flights[index]

    def __len__(self) -> int:
        return len(self.flights)

    def __repr__(self) -> str:
        lines = [*(f"  {flight!r}" for flight in self.flights), *self.remarks()]
        return "\n".join(["Comparison:", *lines])

    def remarks(self, system: System = "si") -> list[str]:
        """Return explanations of the figures, a sentence each, in units of a system.

        They cover surfaces at their stops, hand forces below breakout and friction, a K̂ of 0, and
        the loss of authority under a force that moves the surface as far as on the rigid rig.
        """
        return remarks(self.flights, system) if self.flights else []

    @public
    def flight(self, configuration: str, case: str | None = None) -> Flight:
        """Return the flight in a configuration; `case` is necessary if there are several.

        Raises InputError for a configuration or case that was not flown.
        """
        cases = list(dict.fromkeys(flight.outcome.case for flight in self.flights))
        if case is None and len(cases) > 1:
            raise InputError("comparison", "case", f"is needed; one of: {listed(cases)}")
        if case is not None and case not in cases:
            raise InputError("comparison", "case", f"no {case!r}; {nearest(case, cases)}")
        ours = {f.configuration: f for f in self.flights if case in (None, f.outcome.case)}
        if configuration not in ours:
            problem = f"no {configuration!r} was flown; {nearest(configuration, ours)}"
            raise InputError("comparison", "configuration", problem)
        return ours[configuration]

    @public
    def loss(self, configuration: str, case: str | None = None) -> float:
        """Return the lost share of the surface command, without unit; NaN if not moved."""
        return self.flight(configuration, case).outcome.loss

    @public
    def felt_ratio(self, configuration: str, case: str | None = None) -> float:
        """Return the force felt over the force specified; NaN if the control never moves."""
        return self.flight(configuration, case).outcome.felt_ratio

    def as_dict(self) -> list[dict[str, Any]]:
        """Return the figures of each flight for JSON."""
        return [flight.outcome.as_dict() for flight in self.flights]

    def to_polars(self) -> pl.DataFrame:
        """Return the figures, a row for each flight, with units in the names, null for none."""
        return frame_of(self.as_dict())


def compare(manoeuvres: Sequence[Manoeuvre], progress: Progress | None = None) -> Comparison:
    """Fly every case in every configuration that it requests.

    `progress` is called with a text, frames done and frames in all.
    """
    flights: list[Flight] = []
    jobs = [(m, configuration) for m in manoeuvres for configuration in m.configurations]
    total, before = sum(manoeuvre.frames for manoeuvre, _ in jobs), 0
    for manoeuvre, configuration in jobs:
        label = f"{manoeuvre.label}, {configuration}"

        def report(done: int, _: int, label: str = label, before: int = before) -> None:
            if progress is not None:
                progress(label, before + done, total)

        flight = fly_and_judge(manoeuvre.configured(configuration), configuration, report)
        flights.append(flight)
        before += manoeuvre.frames
        if flight.ended_early.startswith("interrupted"):
            break
    return Comparison(tuple(flights))


def fly_and_judge(
    manoeuvre: Manoeuvre,
    configuration: str = AS_THE_RIG,
    progress: Callable[[int, int], None] | None = None,
) -> Flight:
    """Fly a manoeuvre unchanged, and return the flight with `configuration` as its name.

    `progress` is called with frames done and frames in all.
    """
    record = fly(manoeuvre, progress, stops=True)
    return Flight(manoeuvre, configuration, record, judge(manoeuvre, configuration, record))


def judge(
    manoeuvre: Manoeuvre, configuration: str, record: Record, closed_forms: bool = True
) -> Outcome:
    """Return the figures of a flight's record; without the closed forms those are NaN."""
    control, rig = manoeuvre.control, manoeuvre.rig
    why = "" if record.ended_early is None else str(record.ended_early)
    nan = float("nan")
    deflection = true_deflection(rig, control, record)
    force = record[channel(control, "hand_force")]
    if len(record) < 2 or not (np.any(deflection) or np.any(force)):
        return Outcome(manoeuvre.label, configuration, control, *(nan,) * 9, None, None, None, why)
    rests = not manoeuvre.served and loader_rests(rig, control, record)
    moved = deflection if np.any(deflection) else force
    held = find_held_rows(record.time_s, moved)
    side = float(np.sign(np.mean(moved[held])))
    stop, shares = None, (nan,) * 6
    if not rests:
        commands = average_commands(rig, control, record, held)
        felt, specified = average_forces(rig, control, record, held)
        stop = commands.stop
        # The statics are those of the rig's own schedule, and of a loader without services.
        known = closed_forms and not manoeuvre.served and not manoeuvre.gradient
        loss, ratio = predict_at_rest(rig, control, record, held, stop) if known else (nan, nan)
        asked, reached = commands.commanded, commands.reached
        # Where a service holds the control instead of the hand, no gradient is felt.
        holds = felt * specified > 0.0 if manoeuvre.served else specified != 0.0
        ratios = (felt / specified, ratio) if holds else (nan, nan)
        shares = (asked, reached, 1.0 - reached / asked, loss, *ratios)
    return Outcome(
        manoeuvre.label,
        configuration,
        control,
        *shares[:2],
        float(np.mean(deflection[held])) / rig.controls[control].travel,
        *shares[2:],
        float(np.max(np.abs(force))),
        float(np.max(np.abs(record[channel(control, "force_step")]))),
        *_motion_figures(manoeuvre, control, record, side),
        why,
        stop,
        rests,
    )


def _motion_figures(
    manoeuvre: Manoeuvre, control: ControlName, record: Record, side: float
) -> tuple[float | None, float | None, float | None]:
    """Return peak rate in rad/s, peak load factor, and the time to the attitude in s."""
    if manoeuvre.rig.flight is None:
        return None, None, None
    start = manoeuvre.pilots[control].start_s if control in manoeuvre.pilots else 0.0
    rate = side * record[RATE[control]]
    load = record["load_factor"]
    far = load[np.argmax(np.abs(load - load[0]))] if control == "column" else load.max()
    attitude = np.unwrap(record[ATTITUDE[control]])
    there = side * (attitude - attitude[0]) >= manoeuvre.measure.attitude_change
    there &= record.time_s >= start
    reached = float(record.time_s[np.argmax(there)]) - start if there.any() else None
    # The aircraft of a flight that ended early may never have turned to the pilot's side.
    peak = None if record.ended_early is not None and rate.max() < _STILL else float(rate.max())
    return peak, float(far), reached
