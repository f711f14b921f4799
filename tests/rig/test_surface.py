"""Surface: sign, clip, stretch, lag, rate limit and play, and their order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.record.channels import ControlName
from coupled.resources import shipped_rigs
from coupled.rig.parameters import Rigging
from coupled.rig.replay import (
    replay_surface,
)
from coupled.rig.rigfile import read_rig
from tests.support.rigs import bench

SCHEDULE = "controls.column.schedule"


def command(changes: dict[str, Any], estimated: np.ndarray, q: float = 1000.0) -> np.ndarray:
    rig = bench({f"controls.column.rigging.{k}": v for k, v in changes.items()})
    return replay_surface(rig, "column", estimated, np.full_like(estimated, q))


def test_the_command_has_the_surface_s_sign_and_is_clipped_at_full_travel() -> None:
    estimated = np.array([0.0, 0.0889, -0.1778, 0.5])
    assert command({}, estimated) == pytest.approx([0.0, -0.5, 1.0, -1.0])


@pytest.mark.parametrize(("control", "sign"), [("column", -1), ("wheel", 1), ("pedals", -1)])
def test_a_surface_has_jsbsims_sign_and_is_clipped_both_ways(
    control: ControlName, sign: int
) -> None:
    rig = read_rig(shipped_rigs()["737"]).changed({f"controls.{control}.rigging": Rigging()})
    travel = rig.controls[control].travel
    estimated = travel * np.array([0.5, -0.25, 1.05, -1.05, 3.0, -3.0])
    moved = replay_surface(rig, control, estimated, np.zeros(6))
    assert moved == pytest.approx(sign * np.array([0.5, -0.25, 1.0, -1.0, 1.0, -1.0]))


def test_the_command_is_clipped_before_the_cable_yields() -> None:
    """The command is at most full travel; cable stretch under air load reduces it."""
    twice = np.full(3, 2 * 0.1778)
    assert command({"stretch_loss_per_Pa": 2e-4}, twice) == pytest.approx(-1.0 / 1.2)


def test_the_yield_is_lagged_with_the_command() -> None:
    """Stretch before lag: where q̄ steps, the surface goes over with the lag's time."""
    rig = bench(
        {
            "controls.column.rigging.stretch_loss_per_Pa": 2e-4,
            "controls.column.rigging.lag_s": 0.1,
        }
    )
    frames = np.arange(200)
    q = np.where(frames < 120, 0.0, 2500.0)
    moved = -replay_surface(rig, "column", np.full(200, 0.0889), q)
    assert moved[119] == pytest.approx(0.5, rel=1e-4)
    after = 1.0 - np.exp(-(frames[120:] - 119) * 0.01 / 0.1)
    assert moved[120:] == pytest.approx(0.5 - (0.5 - 0.5 / 1.5) * after, rel=1e-4)


def test_the_rate_limit_follows_the_lag_and_the_play_follows_both() -> None:
    """A step: min(r·t, 1 − exp(−t/τ)), and half the play behind; the offset is put on last."""
    t = 0.01 * np.arange(1, 201)
    settings = {"lag_s": 0.2, "rate_limit_norm_per_s": 1.0}
    moved = np.minimum(1.0 * t, 1.0 - np.exp(-t / 0.2))
    step = np.full(200, -0.1778)
    assert command(settings, step) == pytest.approx(moved, rel=1e-9)
    loose = command({**settings, "play_norm": 0.1, "offset_norm": 0.03}, step)
    assert loose == pytest.approx(np.maximum(moved - 0.05, 0.0) + 0.03, rel=1e-9)


def test_stretch_lag_rate_limit_play_and_offset_act_in_turn() -> None:
    frames = np.arange(300)
    step = np.where(frames > 0, -0.1778, 0.0)
    stretched = command({"stretch_loss_per_Pa": 1e-4}, step)
    assert stretched[-1] == pytest.approx(1.0 / 1.1)
    lagged = command({"lag_s": 0.2}, step)
    assert lagged == pytest.approx(1.0 - np.exp(-frames / 100.0 / 0.2), abs=1e-12)
    limited = command({"rate_limit_norm_per_s": 2.0}, step)
    assert limited == pytest.approx(np.minimum(frames * 0.02, 1.0), abs=1e-12)
    loose = command({"play_norm": 0.1}, -0.1778 * np.sin(frames / 30.0))
    assert np.max(loose) == pytest.approx(0.95, abs=1e-3)
    assert np.min(loose) == pytest.approx(-0.95, abs=1e-3)
    assert command({"offset_norm": 0.03}, step)[0] == pytest.approx(0.03)
