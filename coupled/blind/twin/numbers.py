"""The twin's numbers and its state, as the kernel holds them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import layout

Floats = NDArray[np.float64]
KNOTS = 32  # of the schedule's table


class TwinParameters(Protocol):
    """The real rig: SI; 0 (or 1 for a factor) leaves an effect out."""

    frame_s: float
    # host and schedule
    knots: int
    pressure_scale: float
    pressure_gain: float  # of the lag, a frame
    slope: float
    tent_height: float  # outsider: share by which the table is wrong at `tent_at`
    tent_at: float
    tent_width: float
    gradient_step: float  # outsider: quantised
    pressure_play: float  # outsider: hysteresis of q̄, full width
    host_gradient: float  # the host's G_B
    host_breakout: float
    gradient_bend: float  # K̂ in ΔG; 0 without gradient compensation
    exact: float
    break_deflection: float
    estimate_bend: float  # K̂ in δ̂; 0 without deflection compensation
    digital: int
    deflection_scale: float
    gauge_loop: float  # outsider: N of hysteresis in the gauge
    loop_yield: float  # N over which a hysteresis saturates
    # loader
    mass: float
    damping: float
    basic_gradient: float
    cubic: float
    breakout: float
    running: float
    breakaway: float
    stribeck_rate: float
    bristle: float  # stiffness σ₀, N/m
    bristle_damping: float  # σ₁, N·s/m
    bob_weight: float
    offset: float
    delay: float
    modifying_lag: float  # s, of F_mod on its way to the loader
    travel: float
    load_friction: float  # outsider: N of friction per N of force
    cog_force: float  # outsider: periodic in δc
    cog_pitch: float
    quadratic_damping: float  # outsider: N·s²/m²
    second_mass: float  # outsider: a mass on a spring on the loader
    second_stiffness: float
    second_damping: float
    hum_force: float  # outsider: a periodic force
    hum_rate: float  # rad/s
    gradient_drift: float  # outsider: share of G_B a second
    # linkage
    servo_rate: float  # ω, rad/s
    servo_ratio: float
    servo_limit: float
    play: float
    bend: float
    bend_limit: float
    arc: float
    bend_loop: float  # outsider: m of hysteresis
    bend_uneven: float  # outsider: m/N more for a pull, less for a push
    read_square: float  # outsider: 1/m
    read_drift: float  # outsider: m/s
    # surface
    command_gain: float  # 1/m
    stretch: float
    lag_gain: float
    rate_step: float
    surface_play: float
    surface_offset: float
    surface_uneven: float  # outsider: gain more for one side, less for the other
    dead_zone: float  # outsider: half width
    flutter: float  # outsider: amplitude of a limit cycle
    flutter_rate: float  # rad/s
    # arrays
    pressures: Floats
    first: Floats
    second: Floats


class TwinState(Protocol):
    """What moves."""

    x: float
    v: float
    z: float  # the bristles
    second_x: float
    second_v: float
    servo: float
    servo_v: float
    grip: float
    loop: float
    last_force: float
    pressure: float
    held_pressure: float
    first: float
    second: float
    break_at: float
    preload: float
    product: float
    felt: float  # F_mod behind its lag, N
    lagged: float
    moved: float
    position: float
    started: int


TWIN_PARAMETERS = layout(
    TwinParameters, **dict.fromkeys(("pressures", "first", "second"), (KNOTS,))
)
TWIN_STATE = layout(TwinState)
