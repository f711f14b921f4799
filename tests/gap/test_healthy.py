"""Records of the healthy machine: what was always there is no fault, and what came is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.api.gaps import diagnose
from coupled.blind.trials.deck import read_deck
from coupled.blind.twin.effects import EFFECTS
from coupled.blind.twin.kinds import Clean, Draw, Kind
from coupled.blind.twin.outsiders import OUTSIDERS
from coupled.blind.twin.setting import Installed, draw_setting, fly_clean
from coupled.blind.twin.twin import Twin
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.healthy import ModelError, tolerances
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Floats, Output, Predict
from coupled.gap.thresholds import ROUGH, SIGMAS
from coupled.record.record import Record, read_record
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.rigs import bench

FOUNDERS = Path(__file__).parents[3] / "shared" / "real"
RIG = read_deck(1).rigs["bench-rigid"]
QUADRATIC = 120.0  # N·s²/m²: by it, the rig's damping is off by a third
OUTSIDER = next(kind for kind in OUTSIDERS if kind.name == "quadratic_damping")
FRICTION = next(kind for kind in EFFECTS if kind.name == "coulomb_friction")
DRAW = Draw(1.0, (0.3, 0.5, 0.5), 7)


def _damped(twin: Twin, clean: Clean, size: float, draw: Draw) -> dict[str, float]:
    twin.set(quadratic_damping=QUADRATIC)
    return {}


def flown(rng: np.random.Generator, friction_N: float) -> Record:
    """Return a twin's record with damping that the library lacks, and friction on top."""
    begun = None
    while begun is None:
        begun = fly_clean(draw_setting(rng, RIG))
    setting, clean = begun
    kinds: list[tuple[Kind, float]] = [(replace(OUTSIDER, install=_damped), 1.0)]
    kinds += [(FRICTION, friction_N)] if friction_N else []
    return setting.fly(clean, [Installed(kind, size, DRAW) for kind, size in kinds]).record


@pytest.mark.slow
def test_a_machine_that_is_as_it_was_has_no_gap_and_a_fault_is_named() -> None:
    rng = np.random.default_rng(1)
    well = [flown(rng, 0.0), flown(rng, 0.0)]
    same = flown(rng, 0.0)
    assert diagnose(RIG, same).verdict == "unexplained"
    held = diagnose(RIG, same, healthy=well)
    assert held.verdict == "ambiguous"  # two records: no change of a tenth would be shown
    assert held.guilty == ()
    assert held.summary.startswith("Compared with the healthy machine of 2 records")
    faulty = diagnose(RIG, flown(rng, 4.0), healthy=well)
    assert faulty.verdict in ("effect", "mostly")
    assert faulty.effects[0].name == "coulomb_friction"
    assert faulty.effects[0].value == pytest.approx(4.0, rel=0.35)
    assert faulty.as_dict()["healthy"]["effects"] == ["viscous_damping"]


@pytest.mark.slow
@pytest.mark.skipif(not FOUNDERS.is_dir(), reason="the measured records lie beside the project")
@pytest.mark.parametrize(
    ("same", "verdict"), [("backlash_detection", "ambiguous"), ("friction_gravity", "no_gap")]
)
def test_a_measured_servo_is_as_it_was(same: str, verdict: str) -> None:
    """The rig misses the healthy record by 41 % of what the slower of the two does."""
    folder = FOUNDERS / "so101"
    well, now = (read_record(folder / f"{n}-rotation.csv") for n in ("chirp_sweep", same))
    found = diagnose(read_rig(folder / "rotation.toml"), now, "wheel", healthy=well)
    assert found.verdict == verdict
    assert "(coupled fit)" in found.summary


def predicts(motion: Floats) -> Predict:
    return lambda rig: motion


def outputs(rms: list[float], moves: float = 1.0) -> list[Output]:
    """Return outputs of a rig that leaves so much of each record, noise of 0.1 beside."""
    rng = np.random.default_rng(3)
    found = []
    for i, level in enumerate(rms):
        motion = moves * np.sin(np.arange(3000) / 40.0)
        left = level * np.sqrt(2.0) * np.sin(np.arange(3000) / 60.0) + 0.1 * rng.normal(size=3000)
        found.append(Output("loader", "x", motion + left, predicts(motion), 0.1, 100.0, record=i))
    return found


def test_the_error_of_a_model_is_what_it_leaves_beside_noise() -> None:
    rig = bench()
    error = ModelError.of(outputs([0.4, 0.4, 0.4]), rig)
    assert error.rms == pytest.approx(0.4, rel=0.05)
    [same] = outputs([0.4])
    raised = error.raised(same)
    assert raised.floor == pytest.approx(np.hypot(0.4, 0.1), rel=0.06)
    assert raised.gap(rig) == pytest.approx(1.0, rel=0.06)
    assert raised.limit > 1.4  # 1 + 3 standard deviations of 0.3/√3 from record to record
    # Of what is not known of the input's colour, as much as noise has of the floor.
    doubted = error.raised(replace(same, unsure=0.5))
    assert doubted.unsure == pytest.approx(0.5 * (0.1 / raised.floor) ** 2, rel=0.05)
    [larger] = outputs([0.4], moves=3.0)
    assert error.raised(larger).floor > 2.0 * raised.floor
    scattered = ModelError.of(outputs([0.1, 0.4, 0.8]), rig)
    assert scattered.by_record > 0.6


def test_an_effects_tolerance_is_its_scatter_from_record_to_record() -> None:
    """Three records of damping 1.1, 1.2 and 1.4 times the filed: each is fitted by itself."""
    rate, rng = np.cos(np.arange(3000) / 40.0), np.random.default_rng(3)

    def predict(rig: Rig) -> Floats:
        return np.asarray(rig.controls["column"].loader.damping * rate)

    rig = bench()
    seen = [k * predict(rig) + 0.01 * rng.normal(size=3000) for k in (1.1, 1.2, 1.4)]
    case = Case(
        *(rig, "column"),
        [Output("loader", "x", one, predict, 0.01, 100.0, record=i) for i, one in enumerate(seen)],
    )
    damping = BY_NAME["viscous_damping"]
    found = Problem(case).fit((damping,))
    [wide] = tolerances(case, found).values()
    filed = rig.controls["column"].loader.damping
    assert wide == pytest.approx(SIGMAS * np.std([1.1, 1.2, 1.4], ddof=1) * filed, rel=0.01)


def test_a_channel_that_the_rig_repeats_to_the_last_digit_has_no_error() -> None:
    """What the host works out itself may leave nothing of any record."""
    motion = np.sin(np.arange(3000) / 40.0)
    exact = [
        Output("compensation", "x", motion, predicts(motion), 0.1, 100.0, record=i)
        for i in range(2)
    ]
    error = ModelError.of(exact, bench())
    assert (error.rms, error.by_stretch) == (0.0, 0.0)
    assert error.by_record == pytest.approx(ROUGH / np.sqrt(2.0))
