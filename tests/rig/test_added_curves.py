"""Curves of a rig: a linear one equals the number that it replaces; a neutral one is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.rig.declaration import Hand
from coupled.rig.frame import step_frame
from coupled.rig.packing import pack
from coupled.rig.rig import Rig
from tests.support.rigs import bench

Floats = NDArray[np.float64]
RATE_Hz, SECONDS, LIMIT = 100.0, 3.0, 1e-12
SCHEDULE, SENSING = "controls.column.schedule", "controls.column.sensing"
FRAMES = round(RATE_Hz * SECONDS) + 1
TIMES_s = np.arange(FRAMES) / RATE_Hz
PRESSURE_Pa = 1500.0 + 900.0 * np.sin(2.0 * TIMES_s)


def force_on_nodes(rig: Rig) -> Floats:
    """Return a force that stops, reverses and meets the travel, N on the loader's nodes."""
    times = np.arange((FRAMES - 1) * rig.substeps + 1) / (RATE_Hz * rig.substeps)
    return 160.0 * np.sin(5.0 * times) * np.sin(1.3 * times)


def flown(rig: Rig, hand: Hand | None = None) -> Floats:
    """Return the channels of a bench flight of the column under that force, a row a frame."""
    controls = pack(rig, {"column": hand or Hand()})
    script = np.zeros((1, 2, (FRAMES - 1) * rig.substeps + 1))
    script[0, int(hand is not None)] = force_on_nodes(rig) * (1e-3 if hand else 1.0)
    record = np.zeros((FRAMES, 12))
    for k in range(FRAMES - 1):
        step_frame(controls, script, record, k, (float(PRESSURE_Pa[k]),), 1.0)
    return record


def both(plain: dict[str, Any], curve: dict[str, Any], rest: dict[str, Any] | None = None) -> float:
    """Return the largest difference of two flights, relative to each channel's largest value."""
    first, second = (flown(bench({**(rest or {}), **each})) for each in (plain, curve))
    assert np.abs(first - flown(bench(rest))).max() > 1e-6  # what is compared acts
    size = np.abs(first).max(axis=0)
    return float((np.abs(first - second).max(axis=0)[size > 0.0] / size[size > 0.0]).max())


def line(of: str, value: str, slope: float, to: float, begin: float = 0.0) -> dict[str, Any]:
    """Return the table of a linear curve of several segments, from `begin` on."""
    nodes = [begin, 0.13 * to, 0.4 * to, to]
    return {of: nodes, value: [slope * node for node in nodes]}


SPRING = ("deflection_m", "force_N")
DAMPING = ("rate_m_per_s", "force_N")
EQUAL: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {
    "a spring": (
        {"basic_gradient_N_per_m": 700.0},
        {"force_curve": line(*SPRING, 140.0, 0.05)},
        {"controls.column.compensation.basic_gradient_N_per_m": 560.0},
    ),
    "a spring of two signs": (
        {"basic_gradient_N_per_m": 700.0, "offset_N": -1.5},
        {
            "force_curve": {
                "deflection_m": [-0.02, 0.01, 0.03],
                "force_N": [-1.3, 2.9, 5.7],
            }
        },
        {"controls.column.compensation.basic_gradient_N_per_m": 560.0},
    ),
    "damping": ({"damping_N_s_per_m": 95.0}, {"friction_curve": line(*DAMPING, 20.0, 0.1)}, {}),
    "less damping": (
        {"damping_N_s_per_m": 55.0},
        {"friction_curve": line(*DAMPING, -20.0, 0.1)},
        {},
    ),
    "dry friction": (
        {"friction_N": 7.0},
        {"friction_curve": {"rate_m_per_s": [0.0, 1.0], "force_N": [7.0, 7.0]}},
        {},
    ),
    "dry friction by direction": (
        {"friction_N": 1.0, "friction_pull_N": 6.0, "friction_push_N": 3.0},
        {
            "friction_N": 1.0,
            "friction_curve": {
                "rate_m_per_s": [0.0, 1.0],
                "force_N": [6.0, 6.0],
                "force_push_N": [3.0, 3.0],
            },
        },
        {},
    ),
    "friction and damping, with a contact that yields": (
        {"friction_N": 5.0, "damping_N_s_per_m": 95.0},
        {"friction_N": 5.0, "friction_curve": line(*DAMPING, 20.0, 0.1)},
        {"friction_stiffness_N_per_m": 20000.0, "friction_N": 5.0},
    ),
    "friction by load": (
        {"friction_by_load": 0.2},
        {"load_curve": line("load_N", "friction_N", 0.2, 80.0)},
        {},
    ),
    "a bend": (
        {"bend_m_per_N": 3e-4},
        {"bend_curve": line("force_N", "bend_m", 3e-4 - 9.136e-5, 60.0)},
        {},
    ),
    "a bend by direction": (
        {"bend_m_per_N": 3e-4, "bend_push_m_per_N": 2e-4},
        {
            "bend_curve": {
                "force_N": [-50.0, 0.0, 50.0],
                "bend_m": [-50.0 * (2e-4 - 9.136e-5), 0.0, 50.0 * (3e-4 - 9.136e-5)],
            }
        },
        {},
    ),
    "the scale of the deflection": (
        {f"{SENSING}.deflection_scale": 1.07},
        {f"{SENSING}.deflection_curve": line("deflection_m", "reading_m", 1.07, 0.1)},
        {"multiplier": "digital"},
    ),
    "the gauge's scale and zero": (
        {f"{SENSING}.force_scale": 1.07, f"{SENSING}.force_zero_N": 2.0},
        {f"{SENSING}.force_curve": {"force_N": [-60.0, 50.0], "reading_N": [-62.2, 55.5]}},
        {},
    ),
    "the schedule's slope": (
        {f"{SCHEDULE}.slope": 1.1},
        {
            f"{SCHEDULE}.gradient_curve": {
                "dynamic_pressure_Pa": [0.0, 500.0, 3000.0],
                "gradient_N_per_m": [0.0, 162.9 / 6.0, 162.9],
            }
        },
        {},
    ),
}


@pytest.mark.parametrize("name", EQUAL)
def test_a_linear_curve_equals_the_number_that_it_replaces(name: str) -> None:
    assert both(*EQUAL[name]) < LIMIT
