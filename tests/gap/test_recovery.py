"""Each effect is recovered at three sizes, from where the library's fits start."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from coupled.gap.chain import Part
from coupled.gap.effects.library import BY_NAME
from coupled.gap.prepare import prepare
from coupled.gap.search.beam import search_sets
from tests.support.gaps import made, nominal_rig
from tests.support.singles import SINGLES

pytestmark = pytest.mark.slow
NUMBERS = [one for one in SINGLES if one[2] and one[1] != "vertical_gust"]  # a sample of air
# The noise of F moves a contact that yields, so that its stiffness is known to a quarter.
ROUGHLY = {"stiffness_N_per_{d}": 0.25, "phase_rad": 0.2}


def resized(name: str, values: dict[str, float], times: float) -> dict[str, float]:
    """Return an effect's numbers with the first one so many times as far from doing nothing."""
    first = BY_NAME[name].free[0]
    value = values[first.name]
    if first.mode == "factor":
        return {**values, first.name: 1.0 + times * (value - 1.0)}
    if first.is_limit:
        return {**values, first.name: value / times**0.2}
    if first.key == "loader.bend_{d}_per_N":
        filed = nominal_rig(False).controls["column"].loader.bend
        return {**values, first.name: filed + times * (value - filed)}
    return {**values, first.name: times * value}


@pytest.mark.parametrize("times", [0.6, 1.0, 1.6])
@pytest.mark.parametrize(("flown", "name", "values"), NUMBERS, ids=[one[1] for one in NUMBERS])
def test_the_numbers_of_an_effect_are_recovered(
    tmp_path: Path, flown: bool, name: str, values: dict[str, float], times: float
) -> None:
    effect, nominal = BY_NAME[name], nominal_rig(flown)
    true = resized(name, values, times)
    case = prepare(nominal, {"r": made(tmp_path, nominal, {name: true}, 7)}, Part("column")).case
    ours = [output for output in case.outputs if output.stage in effect.shows_in]
    found = search_sets(replace(case, outputs=ours), [effect])[1].fit
    assert [one.name for one in found.effects] == [name]
    got = {p.name: found.values[effect.value_key(p)] for p in effect.free}
    assert got == {
        **got,
        **{key: pytest.approx(value, rel=ROUGHLY.get(key, 0.06)) for key, value in true.items()},
    }
