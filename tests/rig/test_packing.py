"""Every number of a stage comes from the rig, and every number of the rig reaches a stage."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Any, get_type_hints

import numpy as np
import pytest

from coupled.rig import control as controls
from coupled.rig.declaration import Hand, first_order_gain
from coupled.rig.growth import growing_numbers
from coupled.rig.packing import pack
from coupled.rig.parameters import Control
from coupled.schema import Section
from tests.support.rigs import bench

STAGES = controls.STAGES
# What is no number of the kernels: said of the host, the airframe or a calibration.
ELSEWHERE = {"gains", "calibration", "tolerance", "guesses"}
ELSEWHERE |= {"command_property", "surface_property"}  # of the airframe
RECORDERS = {("sensing", "force_stamp")}  # tests/rig/test_recorder.py
BY_ANOTHER = {("loader", "crosstalk")}  # tests/rig/test_crosstalk.py
OF_RECORDS = {("loader", "regressor"), ("loader", "regressor_reference")}  # gap/test_regressor.py
# Everything on, so that each number counts: two segments, converters, an arc.
SCHEDULE, HOST, SENSING = (f"controls.column.{s}" for s in ("schedule", "compensation", "sensing"))
RIG = bench(
    {
        "controls.column.guesses": ["loader.mass_kg"],
        "controls.column.command_property": ["fcs/stabilator-cmd-norm"],
        "controls.column.surface_property": ["fcs/stabilator-pos-rad"],
        "arc_geometry": True,
        "bend_push_m_per_N": 1e-4,
        "breakaway_N": 1.0,
        "bend_frequency_Hz": 12.0,
        f"{SCHEDULE}.second_gradient_N_per_m": [300.0, 900.0],
        f"{SCHEDULE}.break_deflection_m": 0.05,
        f"{HOST}.basic_gradient_N_per_m": 500.0,
        f"{HOST}.breakout_N": 3.0,
        f"{SENSING}.word_length_bits": 12,
        f"{SENSING}.s1_V_per_m": 400.0,
        f"{SENSING}.s2_V_per_N": 0.3,
        f"{SENSING}.s3_V_per_N": 0.2,
        f"{SENSING}.gauge_frequency_Hz": 40.0,
        f"{HOST}.inertia_gradient_N_per_m": [500.0, 2000.0],
        f"{HOST}.mass_factor": [1.0, 0.8],
        f"{HOST}.damping_factor": [1.0, 0.9],
        f"{HOST}.force_lead_s": [0.0, 0.02],
        "force_curve": {"deflection_m": [0.0, 0.1], "force_N": [0.0, 2.0]},
        "friction_curve": {
            "rate_m_per_s": [0.0, 0.1],
            "force_N": [1.0, 2.0],
            "force_push_N": [1.0, 3.0],
        },
        "load_curve": {"load_N": [0.0, 50.0], "friction_N": [0.0, 5.0]},
        "bend_curve": {"force_N": [0.0, 50.0], "bend_m": [0.0, 1e-3]},
        f"{SCHEDULE}.gradient_curve": {
            "dynamic_pressure_Pa": [0.0, 3000.0],
            "gradient_N_per_m": [0.0, 9.0],
        },
        f"{SENSING}.deflection_curve": {"deflection_m": [0.0, 0.1], "reading_m": [0.0, 0.11]},
        f"{SENSING}.force_curve": {"force_N": [0.0, 60.0], "reading_N": [0.0, 61.0]},
        f"{SENSING}.grip_curve": {"deflection_m": [0.0, 0.1], "reading_m": [0.0, 0.12]},
        f"{SENSING}.grip_load_curve": {"force_N": [0.0, 60.0], "reading_m": [0.0, -2e-3]},
        "controls.column.rigging.command_curve": {
            "deflection_norm": [0.0, 1.0],
            "command_norm": [0.0, 0.9],
        },
    }
)
COLUMN = RIG.controls["column"]
# In place of None: a curve in place of gradients, and a channel.
OF_NONE: dict[str, Any] = {"deflection": [0.0, 0.1], "force": [[0.0, 9.0], [0.0, 20.0]]}
OF_NONE |= {"regressor": "motor_K"}


def other(value: Any) -> Any:
    """Return another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        others = ("hybrid", "digital", "exact", "printed", "elevator", "aileron", "", "today")
        more = ("first", "second", "force", "setpoint")
        return more[more.index(value) ^ 1] if value in more else others[others.index(value) ^ 1]
    if isinstance(value, list) and isinstance(value[0], str):
        return []
    if isinstance(value, list):
        return [*value[:-1], 1.01 * value[-1] + 1.0]
    if isinstance(value, dict):
        return {"loader.mass_kg": 0.1}
    return value + 1 if isinstance(value, int) else 1.01 * value + 1e-3


def numbers(section: Section, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Return the path of every value of a section and those within it."""
    found = []
    for name in type(section).model_fields:
        value = getattr(section, name)
        inner = isinstance(value, Section)
        found += numbers(value, (*path, name)) if inner else [(*path, name)]
    return found


def with_other(section: Section, path: tuple[str, ...]) -> Section:
    """Return a section with the value at a path another one."""
    values = {name: getattr(section, name) for name in type(section).model_fields}
    first, *rest = path
    if rest:
        values[first] = with_other(values[first], tuple(rest))
    else:
        values[first] = OF_NONE[first] if values[first] is None else other(values[first])
    return type(section)(**values)


@pytest.mark.parametrize("path", numbers(COLUMN), ids=".".join)
def test_every_number_of_a_control_reaches_a_stage(path: tuple[str, ...]) -> None:
    changed = with_other(COLUMN, path)
    assert isinstance(changed, Control)
    # Not through `changed` of the rig: what the physics refuses is packed all the same.
    rig = type(RIG)(**{**dict(RIG), "controls": {"column": changed}})
    assert (pack(rig).tobytes() == pack(RIG).tobytes()) == (
        path[0] in ELSEWHERE or path in RECORDERS | BY_ANOTHER | OF_RECORDS
    )


@pytest.mark.parametrize("field", [f.name for f in fields(Hand)])
def test_every_number_of_a_hand_reaches_a_stage(field: str) -> None:
    plain = pack(RIG, {"column": Hand()}).tobytes()
    assert pack(RIG, {"column": replace(Hand(), **{field: 1.5})}).tobytes() != plain


@pytest.mark.parametrize("stage", STAGES)
def test_a_derived_number_is_one_of_its_stage(stage: str) -> None:
    declared = STAGES[stage]
    assert set(declared.derived) <= set(declared.parameters.names or ())
    assert set(declared.fixed) <= set((declared.state or np.dtype([])).names or ())


def test_the_layout_is_that_of_the_declared_stages() -> None:
    """The kernels' view of a control, for the type checker, has what memory has."""
    for view, layout in (
        (controls.ControlParameters, controls.CONTROL_PARAMETERS),
        (controls.ControlState, controls.CONTROL_STATE),
    ):
        hints = get_type_hints(view)
        assert tuple(hints) == layout.names
        for name, kind in hints.items():
            assert tuple(get_type_hints(kind)) == layout[name].names


def test_every_state_grows_with_the_motion_or_is_said_not_to() -> None:
    growing = np.zeros(1, controls.CONTROL)
    growing.view(np.int64)[growing_numbers()] = 1
    grown = {
        f"{stage}.{name}"
        for stage in controls.CONTROL_STATE.names or ()
        for name in controls.CONTROL_STATE[stage].names or ()
        if growing["state"][stage][name].any()
    }
    assert {"loader.computed", "loader.rate", "loader.history", "linkage.grip"} <= grown
    assert {"hand.force", "hand.integral", "surface.position"} <= grown
    assert not {"loader.node", "modification.first", "hand.effort", "schedule.started"} & grown


def test_pack_takes_one_control_alone() -> None:
    assert len(pack(RIG, only="column")) == 1
    with pytest.raises(KeyError):
        pack(RIG, only="wheel")


def test_a_hand_that_is_given_nothing_only_pushes() -> None:
    """All its numbers are 0: no impedance, no lag, no limit and no reach."""
    assert {name: value for name, value in vars(Hand()).items() if value != 0.0} == {}


def test_a_first_order_lag_takes_its_share_of_a_step() -> None:
    """1 − exp(−h/τ) of a step within h; all of it where nothing lags."""
    assert first_order_gain(0.2, 0.1) == pytest.approx(1.0 - math.exp(-0.5), rel=1e-12)
    assert first_order_gain(0.05, 0.2) == pytest.approx(1.0 - math.exp(-4.0), rel=1e-12)
    assert first_order_gain(0.0, 0.1) == 1.0
