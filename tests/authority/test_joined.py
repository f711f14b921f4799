"""What a structure that joins the controls costs in flight, and what each correction gives back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coupled
from coupled.authority.compare import judge
from coupled.flight.loop import fly
from coupled.rig.rig import Rig

RADIUS = 0.5  # the T-37's stick, across
BETWEEN = 3.0e-5
TERMS = {
    "column_by_wheel_m_per_N": BETWEEN,
    "wheel_by_column_rad_per_N": BETWEEN / RADIUS,
}
FORCES = {"column": 60.0, "wheel": -40.0}


def flown(configuration: Any, assumed: dict[str, float]) -> tuple[Rig, Any, Any]:
    """Return rig, manoeuvre and record of both hands' steps on a T-37 of one structure."""
    table = {**TERMS, "reciprocal": True, "assumed": assumed}
    rig = coupled.load_rig("t37").changed({"structure": table})
    pilots = {name: coupled.Step(force_N=FORCES[name]) for name in rig.controls if name in FORCES}
    manoeuvre = coupled.Manoeuvre(rig, pilots, duration_s=2.5).configured(configuration)
    return manoeuvre.rig, manoeuvre, fly(manoeuvre)


@pytest.mark.parametrize(
    ("configuration", "assumed", "lost"),
    [
        ("uncompensated", {}, lambda k, f, other: k * f + BETWEEN * other),
        ("compensated", {}, lambda k, f, other: BETWEEN * other),
        ("compensated", TERMS, lambda k, f, other: 0.0),
    ],
)
def test_the_surface_loses_what_the_host_does_not_know(
    configuration: Any, assumed: dict[str, float], lost: Any
) -> None:
    """Without the diagonal, with it, and with the whole matrix, against eq. (7a) for matrices."""
    rig, manoeuvre, record = flown(configuration, assumed)
    held = (record.time_s > 1.5) & (record.time_s < 2.4)
    deflection = float(np.mean(record["column_deflection_m"][held]))
    estimate = float(np.mean(record["column_estimate_m"][held]))
    wanted = lost(rig.controls["column"].loader.bend, FORCES["column"], FORCES["wheel"])
    assert deflection - estimate == pytest.approx(wanted, abs=2e-5)
    found = judge(manoeuvre, configuration, record)
    assert found.loss_closed_form == pytest.approx(wanted / deflection, abs=2e-3)
    assert found.loss == pytest.approx(found.loss_closed_form, abs=3e-3)


def test_a_gauge_that_is_off_at_another_control_bends_nothing() -> None:
    """The structure bends by the hand's force; the host has K̂_ij times what the gauge reads."""
    scale = 1.2
    table = {**TERMS, "reciprocal": True, "assumed": TERMS}
    rig = coupled.load_rig("t37").changed(
        {"structure": table, "controls.wheel.sensing.force_scale": scale}
    )
    pilots = {name: coupled.Step(force_N=FORCES[name]) for name in rig.controls if name in FORCES}
    manoeuvre = coupled.Manoeuvre(rig, pilots, duration_s=2.5).configured("compensated")
    found = judge(manoeuvre, "compensated", record := fly(manoeuvre))
    held = (record.time_s > 1.5) & (record.time_s < 2.4)
    deflection = float(np.mean(record["column_deflection_m"][held]))
    wanted = BETWEEN * FORCES["wheel"] * (1.0 - scale) / deflection
    assert abs(wanted) > 0.002
    assert found.loss_closed_form == pytest.approx(wanted, abs=2e-4)
    assert found.loss == pytest.approx(wanted, abs=3e-3)


def test_the_feel_keeps_the_shift_that_no_gradient_can_make_good() -> None:
    """F = G·(δ − K_cw·F_w): with all corrections on, the hand feels a shifted neutral."""
    rig, manoeuvre, record = flown("compensated", TERMS)
    found = judge(manoeuvre, "compensated", record)
    held = (record.time_s > 1.5) & (record.time_s < 2.4)
    deflection = float(np.mean(record["column_deflection_m"][held]))
    shift = BETWEEN * FORCES["wheel"] / deflection
    assert abs(shift) > 0.01
    assert found.felt_ratio_closed_form == pytest.approx(1.0 - shift, abs=1e-3)
    assert found.felt_ratio == pytest.approx(found.felt_ratio_closed_form, abs=0.02)
    assert rig.structure.assumed.column_by_wheel == BETWEEN
