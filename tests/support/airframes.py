"""Records of aircraft moved by all controls, with sensor noise, of models edited by hand."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from coupled.flight import loop
from coupled.gap.findings.flown import fly_force
from coupled.record.channels import CONTROL_NAMES, ControlName, noisy_channels
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.models import edited_model, scaled_term

SIZES_N: Mapping[str, Mapping[ControlName, float]] = {
    "c172p": {"column": 15.0, "wheel": 8.0, "pedals": 60.0},
    "t37": {"column": 25.0, "wheel": 15.0, "pedals": 100.0},
    "737": {"column": 60.0, "wheel": 30.0, "pedals": 160.0},
}
PULSES_s = ((1.0, 1), (1.0, -1), (4.0, 0), (2.1, 1), (1.4, -1), (0.7, 1), (0.7, -1))
# Standard deviations of white noise, by the end of a channel's name, and of single channels.
NOISE = {"_N": 0.1, "_m": 5e-5, "_Pa": 10.0, "_rad": 3e-4, "_s": 3e-4, "factor": 3e-3}
ITS_OWN = {"true_airspeed_m_per_s": 0.1, "altitude_m": 0.3, "wheel_deflection_rad": 1e-3}


def noisy(rig: Rig) -> Rig:
    """Return a rig with sensor noise on all channels."""
    channels = noisy_channels(list(rig.controls), flown=True)
    ends = {name: next(v for end, v in NOISE.items() if name.endswith(end)) for name in channels}
    return rig.changed({"noise": {**ends, **{n: v for n, v in ITS_OWN.items() if n in ends}}})


def pulses(rig: Rig, long_s: float = 40.0) -> dict[ControlName, NDArray[np.float64]]:
    """Return a doublet and a 3-2-1-1 on each control, one control after the other, N."""
    t = np.arange(round(long_s * rig.frame_rate)) / rig.frame_rate
    made = {}
    for i, control in enumerate(rig.controls):
        force, at = np.zeros_like(t), 2.0 + (long_s - 3.0) / 3.0 * i
        for length, sign in PULSES_s:
            force += sign * np.clip((t - at) / 0.15, 0.0, 1.0)
            force -= sign * np.clip((t - at - length) / 0.15, 0.0, 1.0)
            at += length
        made[control] = SIZES_N[rig.name][control] * force
    return made


def flown(folder: Path, rig: Rig, term: str, factor: float, long_s: float = 40.0) -> Record:
    """Return the record of a rig whose model has one function scaled by editing its XML."""
    assert rig.flight is not None
    models = edited_model(folder, rig.flight.model, scaled_term(term, factor))
    with patch.object(loop, "aircraft_folder", lambda: models):
        return fly_force(noisy(rig), pulses(rig, long_s), seed=3)


def motion_of(record: Record) -> Record:
    """Return a record's surfaces and motion alone."""
    at = [i for i, name in enumerate(record.channels) if not name.startswith(CONTROL_NAMES)]
    return Record(tuple(record.channels[i] for i in at), record.data[:, at], record.manifest)
