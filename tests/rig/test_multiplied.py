"""S₁ of the loader's electronics, which the analog multiplier sees too: figures 3 and 5.

ΔF = ΔG·δc·(S₁/Ŝ₁)·(Ŝ₂/S₂), for either multiplier; an error of the host's reading alone is in
the digital product and not in the analog one.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.calibration.assumedscales import real_scales
from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.calibrated import with_calibration
from coupled.calibration.estimate import perfect_instruments
from coupled.calibration.plan import stations
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import Doublet, Step
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.equations import felt_gradient, total_to_computed
from coupled.rig.hosted import Feel
from coupled.rig.modification import modifying_force, set_gradients
from coupled.rig.nodes import on_nodes
from coupled.rig.packing import pack
from coupled.rig.replay import drive_loader, replay_product
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.statics import static_line
from tests.support.rigs import G_STIFF, K_REPORT, bench

Multiplier = Literal["hybrid", "digital"]
MULTIPLIERS: list[Multiplier] = ["hybrid", "digital"]
BASIC = 560.0
ADDED = float(total_to_computed(G_STIFF, K_REPORT)) - BASIC  # eq. (12)


def off(multiplier: Multiplier, more: dict[str, Any] | None = None, **scales: float) -> Rig:
    """Return the bench rig with scales that are off, by name."""
    named = {f"controls.column.sensing.{name}": value for name, value in scales.items()}
    return bench({"multiplier": multiplier, **named, **(more or {})})


def pulled(rig: Rig, force_N: float = 60.0, seconds: float = 8.0) -> Record:
    profile = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
    pull = Step(force_N=force_N, start_s=0.5)
    return fly(Manoeuvre(rig, {"column": pull}, seconds, bench=profile))


@pytest.mark.parametrize("multiplier", MULTIPLIERS)
@pytest.mark.parametrize(("s1", "s2"), [(1.1, 1.0), (0.9, 1.0), (1.1, 1.05), (0.93, 0.8)])
def test_what_is_felt_and_read_is_the_closed_form(
    multiplier: Multiplier, s1: float, s2: float
) -> None:
    """Eqs. (2), (11): F = (G_B + ΔG·(S₁/Ŝ₁)·(Ŝ₂/S₂))·δc and δ̂ = (S₁/Ŝ₁)·δc + K̂·F, at rest."""
    rig = off(multiplier, computed_scale=s1, modifying_scale=s2)
    held = BASIC + ADDED * s1 / s2
    record = pulled(rig)
    computed = 60.0 / held
    deflection = computed + K_REPORT * 60.0
    assert record["column_computed_m"][-1] == pytest.approx(s1 * computed, rel=1e-6)
    assert record["column_deflection_m"][-1] == pytest.approx(deflection, rel=1e-6)
    assert 60.0 / deflection == pytest.approx(felt_gradient(held, K_REPORT))
    estimate = s1 * computed + K_REPORT * 60.0
    assert record["column_estimate_m"][-1] == pytest.approx(estimate, rel=1e-6)
    product = record["column_modifying_force_N"][-1]
    assert product == pytest.approx(60.0 - BASIC * computed, rel=1e-6)
    if multiplier == "hybrid":
        line = static_line(rig, "column", 3000.0, np.array([computed]))
        assert line.force[0] == pytest.approx(60.0, rel=1e-9)
        assert line.estimate[0] == pytest.approx(estimate, rel=1e-9)


@pytest.mark.parametrize(("multiplier", "felt"), [("hybrid", 1.0), ("digital", 1.1)])
def test_a_scale_of_the_reading_is_in_the_digital_product_alone(
    multiplier: Multiplier, felt: float
) -> None:
    record = pulled(off(multiplier, deflection_scale=1.1))
    computed = 60.0 / (BASIC + ADDED * felt)
    assert record["column_computed_m"][-1] == pytest.approx(1.1 * computed, rel=1e-6)
    assert record["column_deflection_m"][-1] == pytest.approx(computed + K_REPORT * 60.0, rel=1e-6)


@given(
    scale=st.floats(0.5, 2.0),
    at=st.floats(1e-9, 0.2) | st.floats(-0.2, -1e-9),
    breakout=st.sampled_from([0.0, 12.0]),
    second=st.floats(500.0, 5000.0),
)
def test_the_multiplier_takes_v1_for_the_deflection(
    scale: float, at: float, breakout: float, second: float
) -> None:
    """F_mod(δc) with S₁ off is the F_mod(S₁/Ŝ₁·δc) of a rig without: break and breakout too."""
    column = "controls.column"
    segments = {
        "breakout_N": breakout,
        f"{column}.schedule.second_gradient_N_per_m": [560.0, second],
        f"{column}.schedule.break_deflection_m": 0.04,
    }
    made = []
    nominal = bench(segments)
    for rig, x in ((off("hybrid", segments, computed_scale=scale), at), (nominal, scale * at)):
        (packed,) = pack(rig)
        p, s = packed["parameters"]["modification"], packed["state"]["modification"]
        set_gradients(p, s, G_STIFF, second)
        made.append(modifying_force(s, x))
    assert made[0] == pytest.approx(made[1], rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("multiplier", MULTIPLIERS)
def test_a_converter_sends_by_assumed_scales_what_is_made_by_real_ones(
    multiplier: Multiplier,
) -> None:
    """The steps of ΔF are 2·100 V/2⁸ over the real S₂, those of ΔG 2·S₁/S₂/2⁸ of the real."""
    sensing = "controls.column.sensing"
    volts = {"word_length_bits": 8, "s1_V_per_m": 500.0, "s2_V_per_N": 0.2, "s3_V_per_N": 0.25}
    more = {f"{sensing}.{key}": value for key, value in volts.items()}
    rig = off(multiplier, more, computed_scale=0.9, modifying_scale=1.25)
    record = pulled(rig)
    product = record["column_modifying_force_N"][-1]
    if multiplier == "digital":
        sent, step = product, 200.0 / 256 / (0.2 * 1.25)
    else:
        sent, step = product / ((60.0 - product) / BASIC), 2 * (500.0 * 0.9) / (0.2 * 1.25) / 256
    assert sent / step == pytest.approx(np.round(sent / step), abs=1e-2)


@pytest.mark.parametrize("multiplier", MULTIPLIERS)
def test_a_replay_has_the_scale_where_the_flight_has_it(multiplier: Multiplier) -> None:
    rig = off(multiplier, computed_scale=1.2, deflection_scale=0.9)
    profile = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
    record = fly(
        Manoeuvre(rig, {"column": Doublet(force_N=40.0, half_period_s=0.6)}, 4.0, bench=profile)
    )
    read, gradient = record["column_computed_m"], record["column_gradient_N_per_m"]
    taken = read if multiplier == "digital" else read / (1.2 * 0.9)
    product = replay_product(rig, "column", taken, Feel(gradient))
    np.testing.assert_allclose(product, record["column_modifying_force_N"], atol=1e-9)
    nodes = on_nodes(rig, record["column_force_N"])
    again, _ = drive_loader(rig, "column", nodes, Feel(gradient), np.zeros_like(read))
    np.testing.assert_allclose(1.2 * 0.9 * again, read, atol=2e-5)


@pytest.mark.parametrize(
    ("multiplier", "electronics", "reading", "made"),
    [
        ("hybrid", 0.9, 1.0, 1.0),
        ("digital", 0.9, 1.0, 1.0),
        ("hybrid", 1.0, 0.9, 1.0 / 0.9),
        ("digital", 1.0, 0.9, 1.0),
        ("hybrid", 1.1, 0.9, 1.0 / 0.9),
    ],
)
def test_a_calibration_puts_the_electronics_scale_right_for_reading_and_product(
    multiplier: Multiplier, electronics: float, reading: float, made: float
) -> None:
    """Read at the host, S₁ has the fault of its reading too, and the analog product loses it."""
    place = "controls.column"
    rig = read_rig(shipped_rigs()["report-column"]).changed(
        {
            f"{place}.loader.multiplier": multiplier,
            f"{place}.sensing.computed_scale": electronics,
            f"{place}.sensing.deflection_scale": reading,
        }
    )
    data, tools = rig.controls["column"], perfect_instruments()
    grid = stations(rig, "column", 4, 4)
    readings = take_readings(CalibrationBench(rig, "column", grid, tools), 0)
    found = calibrate_control(readings, data, "column", tools, "bench")
    assert found.line.s1.value == pytest.approx(real_scales(data).s1, rel=1e-9)
    after = with_calibration(rig, "column", found).controls["column"]
    assert after.sensing.read_scale == pytest.approx(1.0, rel=1e-9)
    scales = after.sensing
    taken = scales.computed_scale if multiplier == "hybrid" else scales.read_scale
    assert taken == pytest.approx(made, rel=1e-9)
    assert after.sensing.deflection_scale == reading  # the hardware is what it was
