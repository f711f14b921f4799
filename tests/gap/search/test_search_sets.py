"""The search over sets of effects: known effects from records, healthy records, priors and ties."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coupled.blind.trials.make import Numbers, drawn
from coupled.blind.trials.trial import draw_trial, plans
from coupled.gap.diagnose import Diagnosis, diagnose
from coupled.gap.effects.airframe import term
from coupled.gap.search.beam import _choose
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig


def answer(
    folder: Path, values: Mapping[str, Mapping[str, float]], seed: int, rig: Rig | None = None
) -> Diagnosis:
    """Return the diagnosis of a bench's record with effects."""
    nominal = rig or nominal_rig(False)
    record = made(folder, nominal, values, seed)
    return diagnose(nominal, {"r": record})


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_healthy_record_has_no_gap(tmp_path: Path, seed: int) -> None:
    found = answer(tmp_path, {}, seed)
    assert found.verdict == "no_gap"
    assert found.effects == ()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        pytest.param("bend", {"bend_{d}_per_N": 1.8e-4}, marks=pytest.mark.slow),
        pytest.param("coulomb_friction", {"friction_N": 3.0}, marks=pytest.mark.slow),
        ("inertia", {"factor": 1.3}),
        pytest.param("deflection_zero", {"offset_{d}": 2e-3}, marks=pytest.mark.slow),
        pytest.param("transport_delay", {"delay_s": 0.02}, marks=pytest.mark.slow),
    ],
)
def test_a_known_effect_is_found_at_its_size(
    tmp_path: Path, name: str, values: dict[str, float]
) -> None:
    found = answer(tmp_path, {name: values}, 3)
    assert [effect.name for effect in found.effects] == [name]
    assert found.verdict == "effect"
    (value,) = values.values()
    number = found.effects[0].parameters[0]
    assert number.low is not None
    assert number.high is not None
    assert number.low <= value <= number.high


@pytest.mark.slow
def test_two_effects_of_two_stages_are_found_together(tmp_path: Path) -> None:
    both = {"bend": {"bend_{d}_per_N": 1.6e-4}, "inertia": {"factor": 1.4}}
    found = answer(tmp_path, both, 5)
    assert {effect.name for effect in found.effects} == set(both)


@pytest.mark.slow
def test_beside_an_effect_without_a_number_another_stage_is_explained_too(tmp_path: Path) -> None:
    servo = nominal_rig(False).changed({"controls.column.loader.servo_frequency_Hz": 12.0})
    both = {"no_servo": {}, "inertia": {"factor": 1.4}}
    found = answer(tmp_path, both, 6, servo)
    assert {effect.name for effect in found.effects} == set(both)


@pytest.mark.slow
def test_a_number_within_its_tolerance_is_no_effect_and_one_beyond_it_is(tmp_path: Path) -> None:
    assert answer(tmp_path, {"inertia": {"factor": 1.01}}, 7).verdict == "no_gap"
    beyond = answer(tmp_path, {"inertia": {"factor": 1.15}}, 7)
    assert [effect.name for effect in beyond.effects] == ["inertia"]


@pytest.mark.parametrize(
    ("ahead", "left", "named"),
    [(0.3, set(), False), (7.0, set(), False), (0.3, {"loader"}, True), (40.0, set(), True)],
    ids=["as likely as none", "likelier", "as likely, beside a gap", "none far behind"],
)
def test_where_noise_explains_every_stage_an_effect_is_named_if_none_is_far_behind(
    ahead: float, left: set[str], named: bool
) -> None:
    """Functions of a right model explain up to 7 of noise that is not quite as modelled."""
    effect, none = term("aero/coefficient/Cmq", "PITCH"), frozenset[str]()
    logs = {none: 0.0, frozenset({effect.name}): ahead}
    fits = {names: SimpleNamespace(effects=(effect,) if names else ()) for names in logs}
    beam: Any = SimpleNamespace(
        ranked=lambda: sorted(logs, key=lambda names: -logs[names]),
        log=logs.__getitem__,
        best=frozenset({effect.name}),
        fits=fits,
        known=logs,
        without_effects=fits[none],
        open_outputs=lambda names: left,
    )
    assert bool(_choose(beam, ()).steps) is named


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "found"), [(1.015, []), (1.03, ["inertia"])])
def test_the_tolerance_is_that_of_the_rig_file(
    tmp_path: Path, factor: float, found: list[str]
) -> None:
    """A mass off by 3 % left a gap of many floors within 2 %, and was no gap by its prior."""
    nominal = nominal_rig(False)
    record = made(tmp_path, nominal, {"inertia": {"factor": factor}}, 7, noisier=0.2)
    assert [effect.name for effect in diagnose(nominal, {"r": record}).effects] == found


@pytest.mark.slow
def test_what_no_record_separates_is_ambiguous(tmp_path: Path) -> None:
    """Where nothing bends, the zero of a gauge and a constant force are one law."""
    rigid = nominal_rig(False).changed(
        {
            "controls.column.loader.bend_m_per_N": 0.0,
            "controls.column.compensation.bend_m_per_N": 0.0,
        }
    )
    found = answer(tmp_path, {"force_offset": {"offset_N": 4.0}}, 9, rigid)
    assert found.verdict == "ambiguous"
    assert {"force_offset", "force_zero"} <= set(found.rivals[0])


@pytest.mark.slow
def test_the_search_ends_where_two_sets_take_turns_as_the_best() -> None:
    """The effective samples change with the sets, and with them the order of near ones."""
    numbers = Numbers(seed=2077, records=200, rigs=24, version=4)
    deck, pool = drawn(numbers)
    plan = plans(np.random.default_rng([numbers.seed, 1]), numbers.records, deck)[50]
    trial = draw_trial(np.random.default_rng((numbers.seed, 3, 50)), plan, deck, pool)
    told = list[str]()

    def tell(task: str, done: int, of: int) -> None:
        told.append(task)
        assert len(told) < 30, "the search does not end"

    assert diagnose(trial.rig, {"r": trial.record}, tell=tell).verdict == "unexplained"
