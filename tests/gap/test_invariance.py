"""What changes no answer: order and names of data, how it is cut, and what is irrelevant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.gap.chain import Part
from coupled.gap.diagnose import Diagnosis, diagnose
from coupled.gap.effects.effect import Effect, Signature, added
from coupled.gap.prepare import prepare
from coupled.gap.search.beam import search_sets
from coupled.record.record import Record
from coupled.rig.rigfile import rig_from_table
from tests.support import records
from tests.support.gaps import made, nominal_rig
from tests.support.rigs import BENCH

RIG = nominal_rig(False)
PLAY_m = 1.5e-3


@pytest.fixture(scope="module")
def worn(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """A record of 24 s of a bench with play: what judges the linkage alone."""
    whole = made(
        tmp_path_factory.mktemp("worn"), RIG, {"backlash": {"play_{d}": PLAY_m}}, 3
    ).between(0.0, 24.0)
    kept = ("time_s", *(f"column_{name}" for name in ("force_N", "computed_m", "deflection_m")))
    return Record(kept, np.column_stack([whole[name] for name in kept]))


def play_of(found: Diagnosis) -> tuple[float, float]:
    """Return the play found, the only effect, and the half width of its interval, m."""
    (effect,) = found.effects
    assert (found.verdict, effect.name) == ("effect", "backlash"), found.summary
    (number,) = effect.parameters
    assert number.low is not None
    assert number.high is not None
    return number.value, 0.5 * (number.high - number.low)


@pytest.mark.slow
def test_the_order_of_channels_changes_nothing(worn: Record) -> None:
    order = np.random.default_rng(1).permutation(len(worn.channels))
    turned = Record(tuple(worn.channels[i] for i in order), worn.data[:, order])
    one, other = (diagnose(RIG, {"r": record}).as_dict() for record in (worn, turned))
    assert one == other


@pytest.mark.slow
def test_the_order_of_records_changes_nothing(worn: Record) -> None:
    halves = {"a": worn.between(0.0, 12.0), "b": worn.between(12.0, 24.0)}
    first, half = play_of(diagnose(RIG, halves))
    last, other = play_of(diagnose(RIG, dict(reversed(halves.items()))))
    assert last == pytest.approx(first, abs=0.1 * half)
    assert other == pytest.approx(half, rel=0.1)


@pytest.mark.slow
def test_a_record_cut_in_two_gives_the_same_answer(worn: Record) -> None:
    value, half = play_of(diagnose(RIG, {"r": worn}))
    cut = {"a": worn.between(0.0, 12.0), "b": worn.between(12.0, 24.0)}
    again, _ = play_of(diagnose(RIG, cut))
    assert abs(again - value) < half
    assert abs(value - PLAY_m) < half


@pytest.mark.slow
def test_more_of_the_same_data_narrows_an_interval(worn: Record) -> None:
    """Beside the model error of 1.5 % of the change, which no data narrow."""
    short, whole = (play_of(diagnose(RIG, {"r": worn.between(0.0, s)}))[1] for s in (8.0, 24.0))
    assert whole < short


@pytest.mark.slow
def test_a_control_by_another_name_has_the_same_answer(worn: Record) -> None:
    pedals = {**BENCH["controls"]["column"], "surface": "rudder"}
    rig = rig_from_table({**BENCH, "frame_rate_Hz": 120.0, "controls": {"pedals": pedals}}, "bench")
    names = tuple(name.replace("column_", "pedals_") for name in worn.channels)
    found = diagnose(rig, {"r": Record(names, worn.data)}, "pedals")
    assert play_of(found) == pytest.approx(play_of(diagnose(RIG, {"r": worn})), rel=1e-6)


@pytest.mark.slow
def test_an_irrelevant_effect_in_the_library_changes_no_answer(worn: Record) -> None:
    """Its number is one of the surface, which a bench does not have."""
    prepared = prepare(RIG, {"r": worn}, Part("column"))
    numbers = (added("play_norm", "rigging.play_norm", 0.0, 0.5, 0.01),)
    irrelevant = Effect("irrelevant", "linkage", numbers, Signature("force", "bent"))
    _, without = search_sets(prepared.case, prepared.library)
    _, beside = search_sets(prepared.case, [irrelevant, *prepared.library])
    assert [one.effect for one in beside.steps] == [one.effect for one in without.steps]
    assert beside.fit.values == pytest.approx(without.fit.values, rel=1e-6)


@pytest.mark.parametrize(("times", "seed"), [(0.3, 21), (1.0, 22), (3.0, 23)])
def test_a_healthy_record_with_other_noise_has_no_gap(
    tmp_path: Path, times: float, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, level in records.NOISE.items():
        monkeypatch.setitem(records.NOISE, name, times * level)
    found = diagnose(RIG, {"r": made(tmp_path, RIG, {}, seed).between(0.0, 20.0)})
    assert (found.verdict, found.effects) == ("no_gap", ()), found.summary


def test_a_pair_is_ambiguous_until_the_test_that_separates_it(tmp_path: Path) -> None:
    """At one q̄ a wrong pressure scale and a wrong slope of the schedule are one factor of G_T."""
    rig = RIG.changed(
        {
            "controls.column.schedule.dynamic_pressure_Pa": [0.0, 1000.0, 2000.0, 3000.0],
            "controls.column.schedule.total_gradient_N_per_m": [700.0, 1500.0, 1700.0, 2300.0],
        }
    )
    whole = made(tmp_path, rig, {"schedule_slope": {"factor": 1.1}}, 5)
    kept = ("time_s", "dynamic_pressure_Pa", "column_gradient_N_per_m")
    record = Record(kept, np.column_stack([whole[name] for name in kept]))
    first, second = record.between(0.0, 8.9), record.between(9.0, 40.1)
    alone = diagnose(rig, {"a": first})
    assert alone.verdict == "ambiguous"
    assert {"schedule_slope", "pressure_scale"} <= set(alone.rivals[0])
    both = diagnose(rig, {"a": first, "b": second})
    assert (both.verdict, [one.name for one in both.effects]) == ("effect", ["schedule_slope"])
    assert both.rivals == ()
