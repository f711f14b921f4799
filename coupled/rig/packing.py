"""From a rig's data to the kernels' parameters: every derived number in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from coupled.rig.control import CONTROL, ControlArray
from coupled.rig.linkage import servo_weights
from coupled.rig.parameters import Control, Loader
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class Hand:
    """The impedance of a hand on one control; all zero is a hand that only pushes.

    stiffness in N/d, damping in N·s/d, integral in N/(d·s), muscle lag in s.
    `strongest` (0: no limit) and `lasting`, N, can be held for `endurance_s` and for any time.
    `reach`, d (0: none), is how far it goes; `gradient`, N/d, what it then holds against.
    """

    stiffness: float = 0.0
    damping: float = 0.0
    integral: float = 0.0
    lag_s: float = 0.0
    strongest: float = 0.0
    lasting: float = 0.0
    endurance_s: float = 0.0
    reach: float = 0.0
    gradient: float = 0.0


REACH_BANDWIDTH = 6.0  # rad/s, with which a hand comes to the end of its reach, as a clamp's

# JSBSim's sign for nose up, right wing down, nose right, confirmed by flying each model.
COMMAND_SIGN = {"elevator": -1.0, "aileron": 1.0, "rudder": -1.0}


def pack(rig: Rig, hands: dict[str, Hand] | None = None) -> ControlArray:
    """Return a rig's controls at rest in trim, shape (controls,), in the rig's order."""
    packed = np.zeros(len(rig.controls), CONTROL)
    frame_s = 1.0 / rig.frame_rate
    h = frame_s / rig.substeps
    for p, (name, control) in zip(packed["parameters"], rig.controls.items(), strict=True):
        p["clock"]["substeps"], p["clock"]["substep"] = rig.substeps, h
        _pack_hand(p["hand"], (hands or {}).get(name, Hand()), control.loader, h)
        _pack_host(p, control, frame_s)
        _pack_loader(p, control, h)
        _pack_linkage(p["linkage"], control, h)
        _pack_sensing(p["sensing"], control)
        _pack_surface(p["surface"], control, frame_s)
    return packed


def first_order_gain(lag_s: float, step_s: float) -> float:
    """Return the share of the way that a first-order lag goes in a step; 1 without lag."""
    return -math.expm1(-step_s / lag_s) if lag_s > 0.0 else 1.0


def _pack_hand(p: Any, hand: Hand, loader: Loader, h: float) -> None:
    p["stiffness"], p["damping"], p["integral"] = hand.stiffness, hand.damping, hand.integral
    p["lag_gain"] = first_order_gain(hand.lag_s, h)
    p["strongest"], p["lasting"] = hand.strongest, hand.lasting
    p["endurance"] = hand.endurance_s
    p["reach"], w = hand.reach, REACH_BANDWIDTH
    p["reach_stiffness"], p["reach_damping"] = w * loader.damping, w * loader.mass
    p["reach_gradient"], p["reach_bandwidth"] = hand.gradient, w


def _pack_host(p: Any, control: Control, frame_s: float) -> None:
    table, host, loader = control.schedule, control.compensation, control.loader
    s = p["schedule"]
    s["rows"] = rows = len(table.dynamic_pressure)
    s["dynamic_pressure"][:rows] = table.dynamic_pressure
    s["total_gradient"][:rows] = table.total_gradient
    s["second_gradient"][:rows] = table.second_gradient or table.total_gradient
    s["pressure_scale"], s["slope"] = table.pressure_scale, table.slope
    s["pressure_lag_gain"] = first_order_gain(table.pressure_lag, frame_s)
    m = p["modification"]
    m["basic_gradient"] = control.assumed_basic_gradient
    m["breakout"] = control.assumed_breakout
    m["bend"], m["compensated"] = host.bend, host.gradient
    m["break_deflection"] = table.break_deflection
    m["exact"] = host.breakout_term == "exact"
    m["digital"] = loader.multiplier == "digital"
    m["made"] = 1.0 / control.sensing.modifying_scale
    p["compensation"]["bend"] = host.bend if host.deflection else 0.0


def _pack_loader(p: Any, control: Control, h: float) -> None:
    loader, e, f = control.loader, p["loader"], p["friction"]
    for name in ("mass", "damping", "basic_gradient", "cubic", "breakout", "bob_weight", "offset"):
        e[name] = getattr(loader, name)
    e["delay_substeps"] = loader.delay / h
    e["travel"] = control.travel
    e["digital"] = loader.multiplier == "digital"
    f["running"] = loader.friction
    f["breakaway"] = max(loader.friction, loader.breakaway)
    f["stribeck_rate"] = loader.stribeck_rate


def _pack_linkage(p: Any, control: Control, h: float) -> None:
    loader = control.loader
    weights = servo_weights(2.0 * math.pi * loader.servo_frequency, loader.servo_damping_ratio, h)
    p["position"], p["speed"] = weights
    p["rate_limit"], p["play"] = loader.servo_rate_limit, loader.play
    p["bend"], p["bend_limit"] = loader.bend, loader.bend_limit
    p["arc_length"] = control.length if loader.arc_geometry else 0.0


def _pack_sensing(p: Any, control: Control) -> None:
    sensing = control.sensing
    p["deflection_scale"], p["force_scale"] = sensing.deflection_scale, sensing.force_scale
    if sensing.word_length == 0:
        return
    step_V = 2.0 * sensing.full_scale / 2**sensing.word_length
    ranges = {
        "computed": sensing.full_scale / sensing.s1,
        "force": sensing.full_scale / sensing.s3,
        "product": sensing.full_scale / sensing.s2,
        # The multiplier's other input: full scale stands for v₂ = v₁.
        "gradient": sensing.s1 / sensing.s2,
    }
    for name, full in ranges.items():
        p[f"{name}_range"] = full
        p[f"{name}_step"] = full * step_V / sensing.full_scale


def _pack_surface(p: Any, control: Control, frame_s: float) -> None:
    rigging = control.rigging
    p["gain"] = COMMAND_SIGN[control.surface] / control.travel
    p["stretch"] = rigging.stretch_loss
    p["lag_gain"] = first_order_gain(rigging.lag, frame_s)
    p["rate_step"] = rigging.rate_limit * frame_s
    p["play"], p["offset"] = rigging.play, rigging.offset
