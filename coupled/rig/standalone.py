"""One control without an aircraft: a force on its grip, a given q̄ for its host.

It uses the frame step of a flight with a given dynamic pressure; and the loader with its multiplier
replaced by a voltage supply, for the null of eq. (14).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import channel, control_channels
from coupled.rig.compiled import entry
from coupled.rig.frame import CHANNELS_PER_CONTROL, step_frame
from coupled.rig.loader import move_loader, set_external, start_loader
from coupled.rig.packing import pack
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


_HISTORY = ["force", "computed", "deflection", "estimate", "gradient", "modifying_force"]
_HISTORY += ["surface_norm", "hand_force"]


@dataclass(frozen=True)
class History:
    """A control's time history, one value a frame, in SI; d is m, or rad for a wheel.

    `force` F as the host reads it, `hand_force` the true F and `modifying` F_mod in N, `computed`
    δc and `deflection` δ as read, `estimate` δ̂ in d, `gradient` G_T in N/d, `surface` the command
    about trim in ±1.
    """

    time_s: Floats
    force: Floats
    computed: Floats
    deflection: Floats
    estimate: Floats
    gradient: Floats
    modifying: Floats
    surface: Floats
    hand_force: Floats


def nodes_of(rig: Rig, frames: int) -> Floats:
    """Return the times of the loader's nodes over some frames, s."""
    return np.arange(frames * rig.substeps + 1) / (rig.frame_rate * rig.substeps)


def run_control(rig: Rig, control: str, nodes_N: Floats, pressure_Pa: Floats) -> History:
    """Return a control's motion from rest under a hand's force, at a given q̄.

    `nodes_N` has `rig.substeps` values for each frame and one more, linear between; `pressure_Pa`
    one for each frame. Without noise: readings differ from the truth by scales and converters only.
    """
    rig = rig.only(control)
    controls = pack(rig)
    script = np.zeros((1, 2, len(nodes_N)))
    script[0, 0] = nodes_N
    record = np.zeros((len(pressure_Pa), 2 + CHANNELS_PER_CONTROL))
    _frames(controls, script, record, pressure_Pa)
    time_s = np.arange(len(pressure_Pa)) / rig.frame_rate
    columns = dict(zip(control_channels(control), record[:, 1:].T, strict=False))
    read = [columns[channel(control, quantity)] for quantity in _HISTORY]
    return History(time_s, *read)


def smooth(share: Floats) -> Floats:
    """Return a half cosine from 0 to 1 over its argument from 0 to 1."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(share, 0.0, 1.0)))


def under_supply(
    rig: Rig, control: str, rise_s: float, rest_s: float
) -> Callable[[float, float], float]:
    """Return a function for δc in d at which a free control rests under a supply.

    The supply replaces the multiplier. The function's arguments are two forces in N that correspond
    to the supply's voltage v₂, v₂/S₂, positive in the direction of the pilot's: the supply is
    turned to the first over `rise_s`, to the second over as long, and left for `rest_s`. The
    control starts at rest at neutral, with no hand on it (v₃ = 0): appendix B.
    """
    packed = pack(rig.only(control))
    for field in ("digital", "held"):  # F_mod is the supply's, not a product
        packed["parameters"]["loader"][field] = 1
    h = 1.0 / (rig.frame_rate * rig.substeps)
    up, on = _turned(rise_s, rest_s, h)

    def rests_at(first_N: float, then_N: float) -> float:
        controls = packed.copy()
        supply = first_N * up + (then_N - first_N) * on
        _supplied(controls["parameters"], controls["state"], supply, h)
        return float(controls["state"]["loader"]["computed"][0])

    return rests_at


@lru_cache(maxsize=8)
def _turned(rise_s: float, rest_s: float, h: float) -> tuple[Floats, Floats]:
    """Return two smooth rises, one after the other, at nodes after the first."""
    turns = np.arange(1.0, round((2.0 * rise_s + rest_s) / h) + 1.0) * (h / rise_s)
    return smooth(turns), smooth(turns - 1.0)


@entry
def _frames(controls: Any, script: Floats, record: Floats, pressure: Floats) -> None:
    for k in range(len(pressure)):
        step_frame(controls, script, record, k, (pressure[k],), 1.0)


@entry
def _supplied(parameters: Any, states: Any, supply_N: Floats, h: float) -> None:
    p, s = parameters[0], states[0]
    start_loader(p.loader, s.loader, 0.0)
    ends = (-p.loader.forward, p.loader.aft)
    set_external(p.loader, s.loader, 1.0)
    for node in range(len(supply_N)):
        s.modification.held = -supply_N[node]
        move_loader(p.loader, p.friction, s.modification, s.loader, 0.0, ends, h)
