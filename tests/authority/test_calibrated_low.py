"""Eq. (7a): what a rig loses whose S₁ was found at a low gradient, flown and in closed form.

The report's worst case: 2 in at 12.5 lb/in, K = 0.016 in/lb, gradients from about 3.2 lb/in. A
host that knew S₁ itself would lose K·G·δ = 0.4 in there, 20 %; one that found it at 3.2 lb/in
loses K·(12.5 − 3.2)/(1 − K·3.2) = 15.7 %, and nothing at 3.2 lb/in.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.authority.compare import Outcome, compare
from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import (
    CONFIGURATIONS,
    EVERY_CONFIGURATION,
    Configuration,
    Manoeuvre,
    PressureProfile,
    configure,
)
from coupled.flight.pilot import Clamp
from coupled.plots.flights import draw_comparison
from coupled.record.record import Record
from coupled.rig.equations import (
    bend_loss,
    computed_deflection,
    felt_gradient,
    low_calibration_loss,
    total_to_computed,
)
from coupled.rig.rig import Rig
from coupled.units import POUND_N, INCH_m
from tests.support.rigs import bench

K = 0.016 * INCH_m / POUND_N
LOW, STIFF = 3.2 * POUND_N / INCH_m, 12.5 * POUND_N / INCH_m  # as felt
TWO_INCHES = 2.0 * INCH_m
LOW_SET = float(total_to_computed(LOW, K))  # G₀ on δc, which is felt as LOW
PLACE = "controls.column"


def report(stiff_set: float, multiplier: str = "hybrid", low: float = LOW_SET) -> Rig:
    """Return a bench rig whose specified gradient differs from its low basic gradient."""
    changes: dict[str, Any] = {
        "bend_m_per_N": K,
        "basic_gradient_N_per_m": LOW_SET,
        "multiplier": multiplier,
        f"{PLACE}.compensation.bend_m_per_N": K,
        f"{PLACE}.schedule.total_gradient_N_per_m": [LOW_SET, stiff_set],
        f"{PLACE}.gains.low_gradient_N_per_m": low,
    }
    return bench(changes)


def held(rig: Rig, pressure_Pa: float = 3000.0, seconds: float = 6.0) -> Record:
    clamp = Clamp(deflection_m=TWO_INCHES, start_s=0.5)
    at = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[pressure_Pa])
    return fly(Manoeuvre(rig, {"column": clamp}, seconds, bench=at))


def lost(record: Record) -> tuple[float, float]:
    """Return the share lost of δ, and the gradient felt in N/m."""
    deflection = record["column_deflection_m"][-1]
    felt = record["column_hand_force_N"][-1] / deflection
    return 1.0 - record["column_estimate_m"][-1] / deflection, float(felt)


def test_the_equation_is_the_ratio_of_two_calibrations() -> None:
    """Eq. (7a), as (1 − K·G)/(1 − K·G₀): v₁/δ is S₁·(1 − K·G₀) at G₀; nothing is lost there."""
    for gradient in (LOW, 0.5 * (LOW + STIFF), STIFF):
        seen = computed_deflection(1.0, gradient, K) / computed_deflection(1.0, LOW, K)
        assert low_calibration_loss(K, gradient, LOW) == pytest.approx(1.0 - seen, abs=1e-15)
        assert low_calibration_loss(K, gradient, 0.0) == bend_loss(K, gradient)
    assert low_calibration_loss(K, STIFF, LOW) == pytest.approx(0.1488 / 0.9488, rel=1e-12)
    assert low_calibration_loss(K, 0.5 * LOW, LOW) < 0.0


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
@pytest.mark.parametrize("corrected", [False, True], ids=["uncorrected", "gradient corrected"])
def test_the_reports_worst_case_flown(multiplier: str, corrected: bool) -> None:
    """Eq. (7a) at 2 in and 12.5 lb/in felt: 0.31 in lost, where a known S₁ would lose 0.4.

    v₁ is read as δc/(1 − K·G₀), so the specified G_T is the one that is felt as 12.5 lb/in.
    """
    added = (float(total_to_computed(STIFF, K)) - LOW_SET) * (1.0 - K * LOW)
    asked = LOW_SET + added
    if corrected:  # eq. (12) turned round
        asked = float(felt_gradient(asked, K))
    rig = configure(report(asked, multiplier), "calibrated low")
    rig = rig.changed({f"{PLACE}.compensation.gradient": corrected})
    if corrected:  # G_B is what the host subtracts, and what eq. (12) has it at the low gradient
        rig = rig.changed({f"{PLACE}.schedule.total_gradient_N_per_m": [LOW, asked]})
    record = held(rig)
    share, felt = lost(record)
    assert felt == pytest.approx(STIFF, rel=1e-5)
    assert record["column_hand_force_N"][-1] == pytest.approx(25.0 * POUND_N, rel=1e-5)
    assert share == pytest.approx(low_calibration_loss(K, STIFF, LOW), abs=1e-5)
    assert share * 2.0 == pytest.approx(0.3137, abs=1e-4)
    # at the low gradient itself: nothing
    share, felt = lost(held(rig, pressure_Pa=0.0))
    assert felt == pytest.approx(LOW, rel=1e-5)
    assert share == pytest.approx(0.0, abs=1e-5)


def test_a_known_scale_loses_the_reports_20_percent() -> None:
    rig = configure(report(float(STIFF)), "gradient only")
    share, felt = lost(held(rig))
    assert felt == pytest.approx(STIFF, rel=1e-5)
    assert share == pytest.approx(0.2, abs=1e-5)


@pytest.mark.parametrize("stiff", [800.0, 1500.0, 2189.0])
@pytest.mark.parametrize("low", [0.0, LOW_SET, 1200.0])
def test_a_comparison_meets_the_closed_form(stiff: float, low: float) -> None:
    """Whatever the gradient that S₁ was found at: the schedule's lowest unless it is given."""
    rig = report(stiff, low=low)
    clamp = Clamp(deflection_m=TWO_INCHES, start_s=0.5)
    at = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
    asked: tuple[Configuration, ...] = ("uncompensated", "calibrated low")
    whole = Manoeuvre(rig, {"column": clamp}, 6.0, bench=at, configurations=asked)
    plain, outcome = (flight.outcome for flight in compare([whole]))
    absorbed = low or LOW_SET
    kept = 1.0 - bend_loss(K, felt_gradient(absorbed, K))
    total = LOW_SET + (stiff - LOW_SET) / kept
    felt = float(felt_gradient(total, K))
    expected = low_calibration_loss(K, felt, float(felt_gradient(absorbed, K)))
    assert outcome.loss_closed_form == pytest.approx(expected, abs=1e-9)
    assert outcome.loss == pytest.approx(expected, abs=2e-5)
    assert outcome.felt_ratio == pytest.approx(felt / stiff, rel=2e-4)  # the clamp settles
    assert outcome.felt_ratio_closed_form == pytest.approx(felt / stiff, rel=1e-9)
    assert outcome.loss < plain.loss


@given(
    electronics=st.floats(0.8, 1.25),
    reading=st.floats(0.8, 1.25),
    assumed=st.sampled_from([0.0, 562.4]),
)
def test_what_the_scales_were_before_does_not_count(
    electronics: float, reading: float, assumed: float
) -> None:
    """S₁ as found at the low gradient is v₁/δ there: it has whatever else is off in it."""
    named = {"computed_scale": electronics, "deflection_scale": reading, "s1_V_per_m": assumed}
    rig = report(STIFF).changed({f"{PLACE}.sensing.{key}": value for key, value in named.items()})
    sensing = configure(rig, "calibrated low").controls["column"].sensing
    assert sensing.read_scale == pytest.approx(1.0 / (1.0 - K * LOW), rel=1e-12)
    # the hardware stays: volts a metre at the host
    assert sensing.s1 * sensing.read_scale == pytest.approx(assumed * electronics * reading)
    assert sensing.deflection_scale == reading


def test_calibrated_low_is_flown_on_request_only() -> None:
    assert EVERY_CONFIGURATION[:5] == CONFIGURATIONS
    clamp = Clamp(deflection_m=TWO_INCHES)
    at = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
    whole = Manoeuvre(report(STIFF), {"column": clamp}, 3.0, bench=at)
    assert whole.configurations == CONFIGURATIONS
    every = Manoeuvre(
        report(STIFF), {"column": clamp}, 3.0, bench=at, configurations=EVERY_CONFIGURATION
    )
    found = compare([every])
    outcomes: list[Outcome] = [flight.outcome for flight in found]
    assert [o.configuration for o in outcomes] == list(EVERY_CONFIGURATION)
    [bars] = [axes for axes in draw_comparison(found.flights).axes if axes.get_ylabel() == "%"]
    assert [label.get_text() for label in bars.get_xticklabels()][-1] == "cal. low"
    with pytest.raises(InputError, match="no 'calibrated lo'"):
        found.flight("calibrated lo")
    assert np.isfinite(found.loss("calibrated low"))
