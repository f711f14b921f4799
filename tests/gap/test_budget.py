"""The budget of a gap: its shares sum to 1, are the truth's, and say what no effect explains."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap import diagnose as diagnosing
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.findings.budget import (
    NOISE,
    UNEXPLAINED,
    _shares,
    channel_shrink,
    shapley_weights,
)
from coupled.gap.findings.credibility import Credibility, Regime, _size
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.flown import ChannelAgain, nearer
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import STATED_MOST
from coupled.rig.replay import replay_linkage
from coupled.rig.rig import Rig
from tests.support.gaps import know_only, made, nominal_rig

DRIVES = ("column_computed_m", "column_force_N")
FRICTION = {"friction_N": 6.0, "breakaway_N": 8.0, "stribeck_{d}_per_s": 4e-3}


def shares(found: Diagnosis, stage: str) -> dict[str, float]:
    [budget] = [one for one in found.budget if one.stage == stage]
    assert sum(share.value for share in budget.shares) == pytest.approx(1.0, abs=1e-12)
    for share in budget.shares:
        assert share.low <= share.value <= share.high
    return budget.as_dict()


@pytest.mark.slow
def test_what_is_nearly_right_explains_most_and_says_what_remains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Coulomb friction approximates Stribeck friction to 6 %; the summary describes the rest."""
    nominal = nominal_rig(False)
    record = made(tmp_path, nominal, {"stribeck_friction": FRICTION}, 4)
    know_only(monkeypatch, [e for e in EFFECTS if e.name != "stribeck_friction"])
    found = diagnosing.diagnose(nominal, {"r": record.between(0.0, 20.0)})
    assert found.verdict == "mostly"
    [effect] = found.effects
    assert effect.name == "coulomb_friction"
    assert effect.probability == pytest.approx(STATED_MOST, abs=0.02)
    [friction] = effect.parameters
    assert friction.filed == 0.0
    assert friction.found == pytest.approx(6.0, rel=0.06)
    budget = shares(found, "loader")
    assert budget["coulomb_friction"] > 0.9
    assert budget[UNEXPLAINED] > 3.0 * budget[NOISE]
    said = found.summary
    assert said.startswith("Coulomb friction, 0 → 6.")
    assert "of the loader's gap" in said
    assert "no effect of the library explains it" in said
    table = found.as_dict()
    assert (table["format"], table["controls"]) == (3, ["column"])
    assert sum(table["budget"]["loader"].values()) == pytest.approx(1.0)
    json.dumps(table, allow_nan=False)


@pytest.mark.slow
def test_two_effects_of_a_stage_share_its_gap_as_they_act_in_it(tmp_path: Path) -> None:
    """In the linkage a bend and a play add up: their shares are those of their own signatures."""
    nominal = nominal_rig(False)
    values = {"bend": {"bend_{d}_per_N": 1.6e-4}, "backlash": {"play_{d}": 2e-3}}
    record = made(tmp_path, nominal, values, 4).between(0.0, 20.0)
    found = diagnosing.diagnose(nominal, {"r": record})
    assert found.verdict == "effect"
    budget = shares(found, "linkage")
    flat = {f"{n}.{k}": v for n, each in values.items() for k, v in each.items()}
    made_by = {}
    for some in ((), ("bend",), ("backlash",), ("bend", "backlash")):
        rig = apply(nominal, "column", [BY_NAME[name] for name in some], flat)
        computed, force = (record[name] for name in DRIVES)
        made_by[some] = replay_linkage(rig, "column", computed, force)
    power = {
        some: float(np.mean((made_by["bend", "backlash"] - line) ** 2))
        for some, line in made_by.items()
    }
    whole = power[()]
    bend = 0.5 * (whole - power["bend",] + power["backlash",]) / whole
    assert budget["bend"] == pytest.approx(bend, abs=0.01)
    assert budget["backlash"] == pytest.approx(1.0 - bend, abs=0.01)
    assert budget[NOISE] < 0.02
    # A stage before it of which nothing is explained is said after it.
    loader = replace(found.stage("loader"), gap=1.36, guilty=True)
    nothing = replace(found.budget[0], stage="loader", effects=())
    beside = replace(
        found,
        verdict="mostly",
        stages=tuple(loader if one.name == "loader" else one for one in found.stages),
        budget=(nothing, *found.budget),
    )
    explained, _, rest = beside.summary.partition(
        "of the linkage's gap; the remaining residual is noise. "
    )
    assert explained.startswith(("Bend", "Backlash"))
    assert rest.startswith(
        "No effect of the library explains the loader's residual of 1.36 times its noise floor."
    )


def test_a_floor_that_an_effect_raises_is_of_its_own_power() -> None:
    """Of 10 floors², one is noise; the second that is left is the effect's, the third nobody's."""
    powers, frames, noise = np.array([[10.0], [3.0]]), np.ones(1), np.array([2.0])
    only = np.zeros(1, dtype=np.intp)
    named, unexplained, left = _shares(shapley_weights(1), powers, frames, noise, only)
    assert (named, unexplained, left) == pytest.approx((0.8, 0.1, 0.1))


@pytest.mark.slow
def test_a_cause_is_as_large_everywhere_and_what_to_set_is_said(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    record = made(tmp_path, nominal, {"bend": {"bend_{d}_per_N": 1.6e-4}}, 4).between(0.0, 20.0)
    found = diagnosing.diagnose(nominal, {"r": record})
    [bend] = found.effects
    known = bend.credibility
    assert known is not None
    assert known.value > 0.95
    assert known.drift < 0.05
    assert any(regime.by == "time_s" for regime in known.regimes)
    filed = nominal.controls["column"].loader.bend
    [number] = bend.parameters
    assert number.filed == filed
    assert number.found == number.value
    assert (number.key, number.unit) == ("loader.bend_m_per_N", "m/N")
    assert "Bend, 9.14e-5 → " in found.summary
    assert "Set K̂ to 1.6" in found.summary


@pytest.mark.parametrize("stretches", [1, 16])
def test_a_share_of_stretches_that_may_hold_no_gap_has_no_interval(stretches: int) -> None:
    """It was "-6148402756 to 56 %": of some of the stretches drawn the gap was about 0."""
    rig = nominal_rig(False)
    frames = np.arange(16 * 240)
    size = np.where(frames // 240 < stretches, 30.0, 0.5)
    wrong = size * np.random.default_rng(1).standard_normal(len(frames))

    def predict(asked: Rig) -> NDArray[np.float64]:
        return wrong * (0.4 if asked is rig else 0.1)

    held = np.ones(len(frames), dtype=bool)
    one = Output("loader", "x_m", 0.0 * wrong, predict, 0.5, 120.0, held=held)
    other = rig.changed({"controls.column.loader.mass_kg": 5.0})
    found = channel_shrink(one, rig, other, 1.0, improved=True)
    assert found.closed is not None
    assert (found.low is None) == (found.high is None) == (stretches == 1)


def test_no_gap_has_no_budget(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    record = made(tmp_path, nominal, {}, 11).between(0.0, 15.0)
    found = diagnosing.diagnose(nominal, {"r": record})
    assert found.verdict == "no_gap"
    assert found.budget == ()
    assert found.as_dict()["budget"] == {}


def test_a_rig_that_flies_further_from_the_record_is_not_offered() -> None:
    same = ChannelAgain("column_deflection_m", 1e-4, 1e-4)
    better = ChannelAgain("pitch_rate_rad_per_s", 1e-2, 1e-3)
    worse = ChannelAgain("load_factor", 1e-2, 0.2)
    assert nearer([]) and nearer([same]) and nearer([same, better])
    assert not nearer([same, worse])
    assert not nearer([better, worse])


def test_an_effect_that_removes_what_a_free_model_cannot_is_credible() -> None:
    """If functions of the signals remove the same, the effect is doubtful by what remains."""
    same = (Regime("time_s", 1.0, 1.0, 0.01, 0.01, 20),)
    assert Credibility(same, 0.99, 1.0).value > 0.85
    assert Credibility(same, 0.5, 1.0).value < 0.05
    assert Credibility(same, 0.5, 0.1).value > 0.85
    assert Credibility(same, 0.75, 1.0).value == pytest.approx(0.5, abs=0.01)
    drifts = (Regime("time_s", 0.5, 1.5, 0.01, 0.01, 20),)
    assert Credibility(drifts, 0.99, 1.0).value < 0.05


def test_a_models_own_error_may_be_alike_in_all_of_a_half() -> None:
    """Of an action of 4 floors rms, an error of 1 floor that lasts is a quarter of its size."""
    rng, number = np.random.default_rng(1), np.repeat(np.arange(20), 100)
    action, left = 4.0 * rng.choice([-1.0, 1.0], 2000), rng.normal(size=2000)
    more, scatter, _ = _size(action, left, number)
    assert abs(more) < 3.0 * scatter < 0.05
    assert _size(action, left, number, 1.0)[1] == pytest.approx(0.25, rel=0.01)
