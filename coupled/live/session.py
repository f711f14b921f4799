"""A live flight from begin to end: fly, fade out, and the record in a batch flight's format."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live.hands import LiveHand
from coupled.live.host import STOPPED, Host, Plan
from coupled.live.link import Link
from coupled.live.pacing import Lateness
from coupled.record.channels import channel
from coupled.record.record import Record
from coupled.rig.parameters import Sensing
from coupled.rig.rig import Rig

Progress = Callable[[int, int], None]
INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class LiveFlight:
    """A live flight: its record, the rig as it stood at the end, and how late its frames were."""

    record: Record
    rig: Rig
    since_s: float  # of the last change of a switch: what follows was flown with `rig`
    lateness: Lateness | None
    stopped: bool  # by the user


def fly_live(manoeuvre: Manoeuvre, plan: Plan, progress: Progress | None = None) -> LiveFlight:
    """Fly a manoeuvre live and return the flight, whole up to the frame at which it ended.

    In lock-step, with the simulated loader and the manoeuvre's own pilots, the record is that of
    `fly` to the bit. Raises InputError where the loader does not answer.
    """
    host = Host(plan)
    real = manoeuvre if plan.link is None else measured(manoeuvre, plan.link)
    try:
        with undisturbed():
            record = fly(real, progress, companion=host)
    finally:
        host.farewell()
    if host.aboard is None:
        raise InputError(manoeuvre.file, "", "was not flown")
    ended = record.ended_early
    stopped = ended is not None and ended.reason in (STOPPED, INTERRUPTED)
    manifest: dict[str, Any] = {**record.manifest, "live": host.as_dict()}
    manifest["live"]["stopped"] = stopped
    if stopped:
        manifest["ended_early"] = None
    kept = Record(record.channels, record.data, manifest)
    if plan.link is not None:
        kept = only_measured(kept, plan.link, [str(name) for name in real.rig.controls])
    changes = host.switches.changes
    return LiveFlight(
        kept,
        host.switches.rig,
        max((change.time_s for change in changes), default=0.0),
        host.pacer.result() if plan.paced else None,
        stopped,
    )


@contextmanager
def undisturbed() -> Iterator[None]:
    """Collect no garbage within: a collection takes longer than a frame may be late."""
    was = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def measured(manoeuvre: Manoeuvre, link: Link) -> Manoeuvre:
    """Return the manoeuvre as a host flies it whose loader is real.

    What simulates the loader's electronics, its gauge and its noise, is left out: the readings
    have their own.
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


def only_measured(record: Record, link: Link, controls: list[str]) -> Record:
    """Return a record without what its loader did not measure."""
    lacking: set[str] = set()
    for name in controls:
        lacking |= {channel(name, "force_step"), channel(name, "stop"), channel(name, "hand_force")}
        if not link.measures_deflection:
            lacking.add(channel(name, "deflection"))
    kept = [i for i, name in enumerate(record.channels) if name not in lacking]
    names = tuple(record.channels[i] for i in kept)
    manifest = {**record.manifest, "channels": list(names)}
    return Record(names, np.ascontiguousarray(record.data[:, kept]), manifest)
