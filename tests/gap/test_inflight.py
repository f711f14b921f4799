"""What effects do to the flight, against flights with and without them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.budget import shapley_weights
from coupled.gap.findings.flown import Again, EffectInFlight, fly_force, in_flight, in_words
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig

SURFACE = "elevator_rad"


def test_shapleys_shares_are_means_over_all_orders() -> None:
    rng = np.random.default_rng(3)
    power = rng.uniform(size=8)
    wanted = np.zeros(3)
    for order in permutations(range(3)):
        subset = 0
        for player in order:
            wanted[player] += (power[subset] - power[subset | 1 << player]) / 6.0
            subset |= 1 << player
    shares = shapley_weights(3) @ power
    assert shares == pytest.approx(wanted)
    assert shares.sum() == pytest.approx(power[0] - power[-1])


@pytest.fixture(scope="module")
def rig() -> Rig:
    return nominal_rig(True)


@pytest.fixture(scope="module")
def record(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Record:
    return made(tmp_path_factory.mktemp("r"), rig, {}, 4).between(0.0, 12.0)


def of(rig: Rig, record: Record, **values: float) -> tuple[EffectInFlight, ...]:
    effects = tuple(BY_NAME[name] for name in values)
    flat = {effect.value_key(effect.free[0]): values[effect.name] for effect in effects}
    found = Fit(effects, flat, {}, {}, (), apply(rig, "column", effects, flat))
    again = Again.of(rig, ["column"], record)
    assert again is not None
    made = flown_with(rig, found, again)
    assert made is not None
    return made


def flown_with(rig: Rig, found: Fit, again: Again) -> tuple[EffectInFlight, ...] | None:
    case, names = Case(rig, "column", ()), [(None, effect.name) for effect in found.effects]

    def rig_with(kept: Sequence[int]) -> Rig:
        return case.with_only(found, [found.effects[i] for i in kept])

    return in_flight(names, rig_with, ["column"], again)


def test_one_effect_changes_what_leaving_it_out_changes(rig: Rig, record: Record) -> None:
    (one,) = of(rig, record, elevator_effectiveness=0.7)
    again = Again.of(rig, ["column"], record)
    assert again is not None
    less = rig.changed({"flight.elevator_effectiveness": 0.7})
    flights = [fly_force(each.changed({"noise": {}}), again.pulled) for each in (rig, less)]
    for name, change in one.changes.items():
        without, with_it = (flight[name] for flight in flights)
        assert change == pytest.approx(float(np.sqrt(np.mean((without - with_it) ** 2))), rel=1e-9)
    assert list(one.shares.values()) == pytest.approx([1.0] * 2)  # the elevator goes alike
    # Of three tenths less elevator, the aircraft does some three tenths less than without.
    assert one.of_motion["pitch_rate_rad_per_s"] == pytest.approx(0.3, rel=0.15)
    assert "In flight the effect changes the pitch rate by 30 %" in in_words((one,), ())


def test_the_one_that_moves_the_aircraft_is_fixed_first(rig: Rig, record: Record) -> None:
    """Half as much elevator shows in the pitch rate; a heavier loader in the elevator, a little."""
    found = of(rig, record, inertia=1.3, elevator_effectiveness=0.7)
    assert [one.name for one in found] == ["elevator_effectiveness", "inertia"]
    for name in found[0].changes:
        assert sum(one.shares[name] for one in found) == pytest.approx(1.0)
    assert found[0].share > 0.95  # though inertia has all of the elevator's change, which is small
    assert found[1].shares["elevator_rad"] > 0.9
    assert sum(one.share for one in found) == pytest.approx(1.0)
    assert in_words(found, ["elevator effectiveness"]).endswith(
        "Correct elevator effectiveness first."
    )
    assert "first" not in in_words(found, ())


def test_what_is_in_the_record_alone_does_nothing(rig: Rig, record: Record) -> None:
    (skew,) = of(rig, record, motion_skew=0.05)
    assert set(skew.changes.values()) == {0.0}
    assert (skew.shares, skew.share) == ({}, 0.0)
    assert "the effect is small" in in_words((skew,), ())


def test_a_bench_has_none(tmp_path: Path) -> None:
    bench = nominal_rig(False)
    record = made(tmp_path, bench, {}, 4)
    again = Again.of(bench, ["column"], record)
    assert again is not None
    effect = BY_NAME["inertia"]
    found = Fit((effect,), {"inertia.factor": 1.3}, {}, {}, (), bench)
    assert flown_with(bench, found, again) is None
