"""A live flight from start to end, and its record in a batch flight's format."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live.hands import LiveHand
from coupled.live.host import STOPPED, Host, Plan
from coupled.live.pacing import Lateness, real_time_priority
from coupled.live.roundtrip import RoundTrips
from coupled.record.record import Record
from coupled.rig.parameters import Sensing
from coupled.rig.rig import Rig

Progress = Callable[[int, int], None]
INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class LiveFlight:
    """A live flight: its record, the rig as last switched, and the lateness of its frames."""

    record: Record
    rig: Rig
    since_s: float  # of the last change of a switch; the rest was flown with `rig`
    lateness: Lateness | None
    stopped: bool  # by the user
    round_trips: RoundTrips | None = None  # if answers identify their orders


def fly_live(manoeuvre: Manoeuvre, plan: Plan, progress: Progress | None = None) -> LiveFlight:
    """Fly a manoeuvre live and return the flight, complete up to the frame at which it ended.

    In lock-step, with the simulated loader and the manoeuvre's own pilots, the record is that of
    `fly` to the bit. Raises InputError if the loader does not answer.
    """
    host = Host(plan)
    real = manoeuvre if plan.link is None else as_measured(manoeuvre)
    try:
        with (
            without_garbage_collection(),
            real_time_priority(plan.paced) as host.real_time_priority,
        ):
            record = fly(real, progress, companion=host)
    finally:
        host.shut_down()
    if host.access is None:
        raise InputError(manoeuvre.file, "", "was not flown")
    ended = record.ended_early
    stopped = ended is not None and ended.reason in (STOPPED, INTERRUPTED)
    kept = host.kept(record, stopped)
    changes = host.switches.changes
    return LiveFlight(
        kept,
        host.switches.set_rig,
        max((change.time_s for change in changes), default=0.0),
        host.pacer.result() if plan.paced else None,
        stopped,
        None if plan.link is None else plan.link.round_trips,
    )


def as_measured(manoeuvre: Manoeuvre) -> Manoeuvre:
    """Return the manoeuvre for a host with a real loader.

    The simulated electronics, gauge and noise are removed, since the readings include the real
    ones.
    """
    rig = manoeuvre.rig
    neutral: dict[str, Any] = {"noise": {}}
    for name, control in rig.controls.items():
        kept = {key: getattr(control.sensing, key) for key in ("s1", "s2", "s3", "full_scale")}
        neutral[f"controls.{name}.sensing"] = Sensing().model_copy(update=kept)
        neutral |= {f"controls.{name}.loader.{key}": 0.0 for key in _MULTIPLIER}
    pilots = dict.fromkeys(rig.controls, LiveHand(real=True))
    return replace(manoeuvre, rig=rig.changed(neutral), pilots=pilots)


_MULTIPLIER = ("multiplier_offset_N", "multiplier_drift_N_per_s")


@contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Disable garbage collection in the context, since a collection would delay frames."""
    was = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
