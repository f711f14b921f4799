"""What once misled a diagnosis: what happens seldom, weak springs, coarse logs, worn settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.gap.diagnose import diagnose
from coupled.gap.signals.air import vertical_air
from coupled.gap.signals.floors import share_from_source
from coupled.gap.signals.output import Output, white
from coupled.gap.thresholds import CERTAIN, STATED_MOST, STRETCH_s
from coupled.record.record import write_record
from coupled.rig.rig import Rig
from coupled.rig.rigwrite import rig_text
from tests.support.gaps import made, nominal_rig
from tests.support.processes import begun, kill
from tests.support.rigs import BENCH, bench

RATE_Hz = 100.0
RIG = nominal_rig(False)


def loader(**changes: float) -> Rig:
    keys = {f"controls.column.loader.{name}": value for name, value in changes.items()}
    return bench(keys, {**BENCH, "frame_rate_Hz": 120.0})


def halves(left: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, Output]:
    """Return the share of a residual's power that is held out, and the output cut in halves."""
    output = Output("linkage", "x", left, lambda rig: np.zeros_like(left), 1.0, RATE_Hz)
    cut = output.halved(RIG)
    held = cut.residual(RIG, "held")
    assert len(held) + len(cut.residual(RIG, "fitted")) == len(left)
    return float(held @ held) / float(left @ left), cut


@given(st.floats(0.0, 1.0), st.floats(0.8, 4.0), st.integers(15, 60))
def test_what_happens_once_is_in_both_halves(at: float, length_s: float, record_s: int) -> None:
    time_s = np.arange(round(record_s * RATE_Hz)) / RATE_Hz
    start = at * (record_s - length_s)
    burst = np.where((time_s >= start) & (time_s < start + length_s), 30.0, 0.0)
    hiss = np.random.default_rng(1).standard_normal(len(time_s))
    assert 0.2 < halves(burst + hiss)[0] < 0.8


def test_a_gap_that_is_always_there_is_halved_by_time_alone() -> None:
    hiss = np.random.default_rng(2).standard_normal(4000)
    share, cut = halves(hiss)
    assert share == pytest.approx(0.5, abs=0.05)
    every = np.arange(4000) // round(STRETCH_s * RATE_Hz) % 2 == 1
    assert np.array_equal(cut.rows("held"), every)


def test_a_coarse_log_has_the_noise_of_its_rounding() -> None:
    slow = 20.0 + np.sin(np.arange(6000) / 900.0)
    for step in (1e-3, 1e-2):
        left = np.round(slow / step) * step - slow
        assert white(np.round(slow / step) * step) == pytest.approx(np.std(left), rel=0.1)
    assert white(slow) < 1e-6
    assert white(np.ones(100)) == 0.0
    few = np.round(20.0 + 0.01 * np.sin(np.arange(6000) / 50.0), 3)  # 20 levels, but rounded
    assert white(few) == pytest.approx(1e-3 / np.sqrt(12.0), rel=1e-6)
    points = np.where(np.arange(6000) % 2000 < 1000, 560.0, 2189.0)  # two levels of a schedule
    assert white(points) < 30.0
    ramp = np.interp(np.arange(6000), [2000, 2360], [560.0, 1823.6])  # 361 levels, evenly apart
    assert white(ramp) < 0.1


def test_noise_that_comes_late_or_filtered_is_known_again() -> None:
    rng = np.random.default_rng(3)
    source, own = rng.standard_normal(6000), rng.standard_normal(6000)
    late = np.concatenate(([0.0, 0.0], source[:-2]))
    slow = np.zeros(6000)
    for k in range(1, 6000):
        slow[k] = slow[k - 1] + 0.3 * (source[k] - slow[k - 1])
    for channel in (source, late, slow):
        share, rest = share_from_source(2.0 * channel + 0.05 * own, source)
        assert share > 0.9
        assert rest == pytest.approx(0.05, rel=0.1)
    assert share_from_source(own, source)[0] < 0.02
    assert share_from_source(np.zeros(6000), source) == (0.0, 0.0)


def test_a_lag_of_a_few_frames_is_told_by_the_noise_it_holds_back(tmp_path: Path) -> None:
    effect = {"pressure_lag": {"lag_s": 0.02}}
    found = diagnose(RIG, {"r": made(tmp_path, RIG, effect, 4)}, "column")
    assert [e.name for e in found.effects] == ["pressure_lag"]
    assert found.verdict == "effect"
    assert found.effects[0].value == pytest.approx(0.02, rel=0.05)
    schedule = found.stage("schedule")
    assert schedule.left is not None and schedule.left < 1.15
    assert schedule.gap is not None and schedule.gap > 300.0  # else 10


@pytest.mark.slow
def test_a_digital_product_on_a_weak_spring_does_not_drift(tmp_path: Path) -> None:
    """Its product follows the replay: that of the measured deflection would not hold it."""
    nominal = loader(basic_gradient_N_per_m=140.0, friction_N=2.0, breakout_N=2.0)
    found = diagnose(
        nominal, {"r": made(tmp_path, nominal, {"digital_multiplier": {}}, 4)}, "column"
    )
    assert [effect.name for effect in found.effects] == ["digital_multiplier"]
    assert found.verdict == "effect"
    left = found.stage("loader").left
    assert left is not None and left < 1.1


@pytest.mark.parametrize(
    ("factor", "verdict"),
    [
        (1.015, "no_gap"),
        pytest.param(1.03, "no_gap", marks=pytest.mark.slow),
        pytest.param(1.045, "effect", marks=pytest.mark.slow),
    ],
)
def test_a_setting_is_no_effect_until_it_is_off_by_more(
    tmp_path: Path, factor: float, verdict: str
) -> None:
    """The tolerance of 2 % is the 95 % interval of a Gaussian prior.

    3 % off is 2.9 standard deviations, and the likelihood ratio of 7 is less than the odds of 55 to
    1 against an effect; at 4.5 % it is over 1000.
    """
    record = made(tmp_path, RIG, {"viscous_damping": {"factor": factor}}, 4)
    found = diagnose(RIG, {"r": record}, "column")
    judged, said = found.stage("loader").as_dict(), found.summary
    assert found.verdict == verdict
    assert judged["gap"] > judged["limit"]
    assert (judged["settled"] < judged["limit"]) == (verdict == "no_gap")
    if verdict == "effect":
        assert judged["where"]["follows"][0]["signal"] == "computed_rate_m_per_s"
        [effect] = found.effects
        assert effect.name == "viscous_damping"
        assert effect.value == pytest.approx(factor, abs=0.003)
        assert "settings" not in said
    else:
        settings = {setting.name: setting.factor for setting in found.settings}
        assert settings["damping"] == pytest.approx(min(factor, 1.02), abs=0.003)
        assert f"because of mass {100 * (settings['mass'] - 1):+.1f} %" in said
        assert (
            f"damping {100 * (settings['damping'] - 1):+.1f} %, each within its tolerance" in said
        )


@pytest.mark.slow
def test_a_small_hardening_is_not_taken_for_none(tmp_path: Path) -> None:
    """On the scale on which a large one is sought it lies within 1e-4 of its bound."""
    effect = {"cubic_stiffness": {"cubic_N_per_{d}3": 190.0}}
    told = {"controls.column.schedule.total_gradient_N_per_m": [400.0, 400.0]}
    soft = {"controls.column.loader.basic_gradient_N_per_m": 400.0}
    nominal = bench(told | soft, {**BENCH, "frame_rate_Hz": 120.0})
    found = diagnose(nominal, {"r": made(tmp_path, nominal, effect, 4)}, "column")
    assert [e.name for e in found.effects] == ["cubic_stiffness"], found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("breakaway_N", "named"),
    [(0.0, "coulomb_friction"), (0.12, "stribeck_friction"), (0.2, "stribeck_friction")],
)
def test_a_faint_gap_names_the_law_of_dry_friction_that_it_shows(
    tmp_path: Path, breakaway_N: float, named: str
) -> None:
    """A breakaway of twice the running friction was read as a contact that holds rigidly."""
    running = {"friction_N": 0.06 if breakaway_N else 0.08}
    fading = {"breakaway_N": breakaway_N, "stribeck_{d}_per_s": 2e-3}
    law = {"stribeck_friction": running | fading} if breakaway_N else {"coulomb_friction": running}
    found = diagnose(RIG, {"r": made(tmp_path, RIG, law, 4)}, "column")
    settled = found.stage("loader").settled
    assert settled is not None and 1.2 < settled < 2.0
    assert found.verdict == "effect"
    [effect] = found.effects
    assert effect.name == named
    # A breakaway of 0.06 N more than the running friction: plain friction may take its place.
    faint = breakaway_N == 0.12
    assert found.rivals in (((named, "coulomb_friction"),), ()) if faint else found.rivals == ()
    assert effect.probability >= (CERTAIN if faint else STATED_MOST - 0.02)


@pytest.mark.slow
def test_what_remains_is_told_in_numbers_and_words(tmp_path: Path) -> None:
    record = made(tmp_path, RIG, {}, 5)
    at = record.channels.index("column_deflection_m")
    speed = np.gradient(record["column_deflection_m"]) * RIG.frame_rate
    record.data[:, at] += 2e-3 * np.tanh(speed / 0.02) ** 2
    found = diagnose(RIG, {"r": record}, "column")
    assert found.verdict == "unexplained"
    linkage = found.stage("linkage")
    assert linkage.remains is not None
    assert linkage.remains.gap == pytest.approx(linkage.left, rel=0.05)
    assert 0.5 < linkage.remains.free_share <= 1.0
    assert (
        f"the linkage with these effects is {linkage.remains.gap:.3g} times its noise floor: "
        in found.summary
    )


def test_still_air_is_told_to_be_still_through_pulls_of_two_g(tmp_path: Path) -> None:
    """Lift has a part along the path, and a height is not its rate's sum from the right."""
    record = made(tmp_path, nominal_rig(True), {}, 9)
    assert np.ptp(record["load_factor"]) > 1.8
    told = vertical_air(record, 1.0 / 120.0)
    assert told is not None
    assert np.sqrt(np.mean(told.speed**2)) < 0.018  # m/s; of which noise alone makes 0.011
    assert np.std(told.error) == pytest.approx(0.011, rel=0.2)


@pytest.mark.slow
def test_a_killed_diagnosis_of_a_folder_leaves_no_worker(tmp_path: Path) -> None:
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "mine.toml").write_text(rig_text(RIG, "a bench"))
    record = made(tmp_path, RIG, {"backlash": {"play_{d}": 1e-3}}, 4)
    names = [f"r{k:02d}" for k in range(40)]
    for name in names:
        write_record(record, tmp_path / f"{name}.csv")
    (tmp_path / "records.toml").write_text("".join(f'{name} = "mine"\n' for name in names))

    def made_so_far() -> int:
        return len(list((tmp_path / "found").glob("r*.json")))

    words = ("diagnose", ".", "--output", "found")
    kill(begun(tmp_path, *words, until=lambda: made_so_far() >= 2))
    assert made_so_far() < len(names)
