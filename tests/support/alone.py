"""An aircraft without a control loader, a record of it with noise, and the gaps of its outputs."""

from __future__ import annotations

import numpy as np

from coupled.gap.checks import at_rate_of, trimmed
from coupled.gap.stages.airframe import airframe_outputs
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig


def alone() -> Rig:
    return read_rig(shipped_rigs()["c172p"]).changed({"controls": {}, "noise": {}})


def noisy(record: Record) -> Record:
    noise = np.random.default_rng(6).normal(scale=3e-4, size=record.data.shape)
    noise[:, 0] = 0.0
    for name, times in {
        "load_factor": 10.0,
        "true_airspeed_m_per_s": 300.0,
        "altitude_m": 1e3,
    }.items():
        noise[:, record.channels.index(name)] *= times
    return Record(record.channels, record.data + noise, record.manifest)


def gaps(rig: Rig, record: Record, zero: dict[str, float]) -> dict[str, float]:
    """Return the gap of each output for a rig with further keys of the flight."""
    records = {"log": record}
    known = trimmed(at_rate_of(rig, records), records)[0]["log"]
    outputs = airframe_outputs(known, record)
    changes = {f"flight.{key}": value for key, value in zero.items()}
    return {one.channel: one.gap(known.changed(changes)) for one in outputs}
