"""The twin's parameters and its state in the kernel."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import layout

Floats = NDArray[np.float64]
KNOTS = 32  # of the schedule's table
KEPT = 8192  # latest values of δc, one a step: half a second at 120 Hz


class TwinParameters(Protocol):
    """The real rig: SI; 0 (or 1 for a factor) leaves an effect out."""

    frame_s: float
    # host and schedule
    knots: int
    pressure_scale: float
    pressure_gain: float  # of the lag, a frame
    slope: float
    tent_height: float  # outsider: relative error of the table at `tent_at`
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
    scale_drift: float  # of δc as read, share a second
    tone: float  # of δc as read, m
    tone_rate: float  # rad/s
    tone_phase: float
    force_scale: float  # of F as read
    force_zero: float  # N
    force_late: float  # F as recorded, s
    missed_share: float  # of the host's frames
    missed_seed: float
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
    elastic_share: float  # of the bristles' length below which nothing slips; 0 for LuGre's
    pull_friction: float  # additional N in motion aft, and forward
    push_friction: float
    relaxing: float  # stiffness of a spring in series with a damper, N/m
    relaxing_s: float
    force_limit: float  # of the modification, N
    crosstalk: float  # share of another control's force that acts on the loader
    bob_weight: float
    offset: float
    delay: float
    modifying_lag: float  # s, of F_mod on the loader
    aft: float  # stops of the loader on either side, m, as sizes
    forward: float
    load_friction: float  # N of friction per N of force
    cog_force: float  # periodic in δc, N
    cog_pitch: float
    quadratic_damping: float  # outsider: N·s²/m²
    second_mass: float  # outsider: a mass on a spring on the loader
    second_stiffness: float
    second_damping: float
    hum_force: float  # outsider: a periodic force
    hum_rate: float  # rad/s
    gradient_drift: float  # outsider: share of G_B a second
    # linkage
    servo_rate: float  # ω, rad/s; 0 without a servo
    servo_ratio: float
    servo_limit: float
    servo_delay: float  # dead time, s
    servo_push: float  # largest acceleration of the servo, m/s²; 0 for no limit
    play: float
    bend: float
    bend_limit: float
    arc: float
    mode_rate: float  # of the structure's mode, rad/s; 0 without mass
    mode_ratio: float
    bend_share: float  # of the bend, through a play of the force
    bend_width: float  # of that play, full, N
    contact: float  # stiffness of the contact in the play, N/m; 0 for a hard one
    contact_s: float  # its damping over its stiffness
    deflection_zero: float  # m
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
    """The state of the twin."""

    x: float
    v: float
    z: float  # the bristles
    relaxed: float  # the relaxing spring's force
    bent: float  # the structure's mode
    bent_v: float
    carried: float  # the force behind the bend's play
    touch: float  # grip relative to the servo, with a soft contact
    random: float  # of missed frames, in 0 to 1
    last_gradient: float  # held by the host over a missed frame
    last_estimate: float
    second_x: float
    second_v: float
    servo: float
    servo_v: float
    heard: float  # the servo's input δc, m
    stepped: int  # steps since the start
    kept: Floats  # the latest δc, m
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
TWIN_STATE = layout(TwinState, kept=(KEPT,))
