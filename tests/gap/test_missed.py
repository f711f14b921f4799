"""Frames that a host missed: what repeats by chance is none, and what it missed is counted."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.signals.missed import Missed, missed_in
from coupled.gap.thresholds import STATED_MOST
from coupled.record.record import Record
from tests.support.gaps import made, nominal_rig

HELD = ("column_estimate_m", "column_gradient_N_per_m")


def without(record: Record, *names: str) -> Record:
    keep = [name for name in record.channels if name not in names]
    return Record(tuple(keep), np.column_stack([record[name] for name in keep]))


def holding(record: Record, frames: list[int]) -> Record:
    """Return a record whose host missed these frames, one after the other."""
    data = record.data.copy()
    for k in frames:
        for name in HELD:
            data[k, record.channels.index(name)] = data[k - 1, record.channels.index(name)]
    return Record(record.channels, data)


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return made(tmp_path_factory.mktemp("missed"), nominal_rig(False), {}, 21)


def test_the_frames_that_a_host_missed_are_found_and_no_other(healthy: Record) -> None:
    frames = [100, 101, 777, 2000, 3999]
    for record in (holding(healthy, frames), without(holding(healthy, frames), HELD[1])):
        assert np.flatnonzero(missed_in(record).seen).tolist() == frames
    assert not missed_in(healthy).seen.any()


def test_a_coarse_log_repeats_by_chance(healthy: Record) -> None:
    """In steps of twice the noise one estimate in twelve repeats, and no frame was missed."""
    rounded = healthy.data.copy()
    for name, step in (("column_computed_m", 4e-5), (HELD[0], 4e-5), (HELD[1], 20.0)):
        at = healthy.channels.index(name)
        rounded[:, at] = step * np.round(rounded[:, at] / step)
    coarse = Record(healthy.channels, rounded)
    assert np.mean(np.diff(coarse[HELD[0]]) == 0.0) > 0.05
    assert not missed_in(coarse).seen.any()
    assert not missed_in(without(healthy, *HELD)).seen.any()


def test_a_replay_at_the_records_own_share_misses_the_records_own_frames() -> None:
    rig = nominal_rig(False)
    seen = np.zeros(1000, dtype=bool)
    seen[[5, 80, 81, 500]] = True
    missed = Missed(seen)
    assert missed.under(rig, "column") is None
    for share, count in ((missed.share, 4), (0.002, 2), (0.5, 500)):
        other = rig.changed({"controls.column.compensation.missed_share": share})
        under = missed.under(other, "column")
        assert under is not None and not under[0]
        assert int(np.sum(under)) == count
        assert int(np.sum(under & seen)) == min(count, 4)


@pytest.mark.parametrize(
    ("flown", "share"),
    [(False, 0.02), (False, 0.0005), pytest.param(True, 0.005, marks=pytest.mark.slow)],
)
def test_dropped_frames_are_named_and_counted(tmp_path: Path, flown: bool, share: float) -> None:
    nominal = nominal_rig(flown)
    record = made(tmp_path, nominal, {"dropped_frames": {"share": share}}, 4)
    found = diagnose(nominal, {"r.csv": record})
    assert found.verdict == "effect"
    (effect,) = found.effects
    assert (effect.name, effect.stage) == ("dropped_frames", "compensation")
    (number,) = effect.parameters
    assert number.value == pytest.approx(
        np.mean(np.diff(record["column_estimate_m"]) == 0.0), rel=0.02
    )
    assert number.low is not None and number.high is not None
    assert number.low < share < number.high
    # Of n frames missed by chance the 95 % interval is n times or over exp(1.96/√n): also of two
    # it does not contain zero.
    count = number.value * len(record)
    assert math.log(number.high / number.value) == pytest.approx(1.96 / count**0.5, rel=0.05)
    assert math.log(number.value / number.low) == pytest.approx(1.96 / count**0.5, rel=0.05)
    assert effect.probability == STATED_MOST


@pytest.mark.slow
def test_a_digital_product_is_held_with_them(tmp_path: Path) -> None:
    nominal = nominal_rig(False).changed({"controls.column.loader.multiplier": "digital"})
    record = made(tmp_path, nominal, {"dropped_frames": {"share": 0.02}}, 4)
    found = diagnose(nominal, {"r.csv": record})
    assert [effect.name for effect in found.effects] == ["dropped_frames"]
    assert found.verdict == "effect"
