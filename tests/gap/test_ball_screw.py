"""A ball screw's axis when it was well, and with graded faults: not our physics."""

from __future__ import annotations

import pytest

from coupled.api.gaps import diagnose
from coupled.gap.findings.changed import compare
from coupled.gap.nominal import fit_nominal
from coupled.gap.prepare import readers_of
from coupled.gap.signals.output import Output
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.ballscrew import (
    DAMPING,
    FRICTION_N,
    OFFSET_N,
    MASS_kg,
    ball_screw,
    ball_screw_rig,
)

pytestmark = pytest.mark.slow
KEYS = tuple(
    f"loader.{name}" for name in ("mass_kg", "damping_N_s_per_m", "friction_N", "offset_N")
)
WELL = (1, 2, 3)


@pytest.fixture(scope="module")
def fitted() -> Rig:
    found = fit_nominal(ball_screw_rig(), {"1": ball_screw(1), "2": ball_screw(2)}, KEYS)
    values = {one.key: one.found for one in found.numbers}
    wanted = dict(zip(KEYS, (MASS_kg, DAMPING, FRICTION_N, OFFSET_N), strict=True))
    for key, value in wanted.items():
        assert values[key] == pytest.approx(value, rel=0.1), key
    return found.rig


@pytest.mark.parametrize("seed", [5, 6])
def test_a_healthy_axis_is_as_it_was(fitted: Rig, seed: int) -> None:
    """Without records of when it was well its ripple and fading friction are a gap."""
    assert diagnose(ball_screw_rig(), ball_screw(seed)).verdict != "no_gap"
    healthy = [ball_screw(one) for one in WELL]
    assert diagnose(fitted, ball_screw(seed), healthy=healthy).verdict == "no_gap"


@pytest.mark.parametrize("times", [0.7, 1.2])
def test_another_friction_is_named(fitted: Rig, times: float) -> None:
    """Its scatter when well is 4 %."""
    healthy = [ball_screw(one) for one in WELL]
    found = diagnose(fitted, ball_screw(7, friction=times), healthy=healthy)
    assert (found.verdict, found.effects[0].name) == ("effect", "coulomb_friction")
    wanted = (times - 1.0) * FRICTION_N
    assert found.effects[0].value == pytest.approx(wanted, abs=0.08 * FRICTION_N)


@pytest.mark.parametrize("play_m", [2e-5, 6e-5])
def test_play_in_the_nut_is_named_and_measured(fitted: Rig, play_m: float) -> None:
    healthy = [ball_screw(one) for one in WELL]
    found = diagnose(fitted, ball_screw(7, play_m=play_m), healthy=healthy)
    assert (found.verdict, found.effects[0].name) == ("effect", "backlash")
    assert found.effects[0].value == pytest.approx(play_m, rel=0.06)


def test_friction_and_damping_that_changed_are_told_from_the_scatter_of_the_healthy() -> None:
    """By features alone. Friction scatters by 4 % when it is well, damping by 6 %."""
    rig = ball_screw_rig()

    def known(records: list[Record]) -> tuple[list[Record], list[Output], Rig]:
        files = {str(i): one for i, one in enumerate(records)}
        readers = readers_of(dict.fromkeys(files, rig), files, "column")
        return records, [output for reader in readers for output in reader.outputs()], rig

    well = known([ball_screw(1000 + seed) for seed in range(12)])

    def changed(record: Record) -> set[str]:
        found = compare("column", well, known([record]))
        return {one.feature for one in found.changed}

    assert sum(bool(changed(ball_screw(2000 + seed))) for seed in range(8)) <= 1
    for times in (0.65, 1.42):
        assert "slope over the speed" in changed(ball_screw(4000, damping=times))
    for times in (0.72, 1.28):
        assert "half difference of the directions" in changed(ball_screw(3000, friction=times))
