"""The rig of a host with a real loader: its readings are measured, not simulated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from coupled.flight.manoeuvre import Manoeuvre
from coupled.live.hands import LiveHand
from coupled.live.link import Link
from coupled.record.channels import channel
from coupled.record.record import Record
from coupled.rig.parameters import Sensing
from coupled.rig.rig import Rig


def as_measured(manoeuvre: Manoeuvre) -> Manoeuvre:
    """Return the manoeuvre as flown by a host with a real loader.

    The simulation of the loader's electronics, gauge and noise is left out, since the real readings
    contain them.
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


def only_measured(record: Record, link: Link, rig: Rig) -> Record:
    """Return a record without channels that its loader did not measure.

    They include F_mod of a hybrid loader, whose own multiplier uses the true δc. The host's product
    of δc as read would be diagnosed as a product that is held over the frame.
    """
    lacking: set[str] = set()
    for name, control in rig.controls.items():
        lacking |= {channel(name, "force_step"), channel(name, "stop"), channel(name, "hand_force")}
        if control.loader.multiplier == "hybrid":
            lacking.add(channel(name, "modifying_force"))
        if not link.measures_force:
            lacking.add(channel(name, "force"))
        if not link.measures_deflection:
            lacking.add(channel(name, "deflection"))
    kept = [i for i, name in enumerate(record.channels) if name not in lacking]
    names = tuple(record.channels[i] for i in kept)
    manifest = {**record.manifest, "channels": list(names)}
    return Record(names, np.ascontiguousarray(record.data[:, kept]), manifest)
