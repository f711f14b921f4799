"""A machine with less friction, preload or play than its rig file says."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig, starts_of

LOADER = "controls.column.loader."


def filed_and_record(folder: Path, key: str, filed: float, real: float) -> tuple[Rig, Record]:
    """Return a rig with a number as filed, and the record of one that really has another."""
    rig = nominal_rig(False).changed({LOADER + key: filed})
    host = {"controls.column.compensation.breakout_N": filed} if key == "breakout_N" else {}
    return rig, made(folder, rig.changed({LOADER + key: real, **host}), {}, 3).between(0.0, 20.0)


def outputs(rig: Rig, record: Record) -> list[Output]:
    return [one.halved(rig) for one in Reader(rig, record, "column", lambda *_: None).outputs()]


def test_less_friction_than_filed_is_fitted_down_to_none(tmp_path: Path) -> None:
    rig, record = filed_and_record(tmp_path, "friction_N", 3.0, 0.0)
    case, effect = Case(rig, "column", outputs(rig, record)), BY_NAME["coulomb_friction"]
    start, *more = starts_of(case, effect)  # a further one removes all that is filed
    assert all(one["coulomb_friction.friction_N"] < 0.0 for one in (start, *more))
    found = Problem(case).fit((effect,), start)
    assert found.rig.controls["column"].loader.friction == pytest.approx(0.0, abs=0.03)
    # None at all is an answer, and no end of a range.
    assert "coulomb_friction.friction_N" not in found.at_bound


def test_no_more_is_taken_off_than_is_filed() -> None:
    rig = nominal_rig(False).changed({LOADER + "friction_N": 3.0})
    effect = BY_NAME["coulomb_friction"]
    assert effect.free[0].bounds(rig, "column") == (-3.0, effect.free[0].high)
    less = apply(rig, "column", [effect], {"coulomb_friction.friction_N": -3.0000001})
    assert less.controls["column"].loader.friction == 0.0
    offset = BY_NAME["force_offset"].free[0]  # of either sign: what is filed is no end
    assert offset.bounds(rig, "column") == (offset.low, offset.high)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "filed", "real", "name"),
    [
        ("friction_N", 4.0, 2.0, "coulomb_friction"),
        ("breakout_N", 4.0, 2.5, "breakout"),
        ("play_m", 1.5e-3, 0.9e-3, "backlash"),
    ],
)
def test_what_is_less_than_filed_is_named(
    tmp_path: Path, key: str, filed: float, real: float, name: str
) -> None:
    rig, record = filed_and_record(tmp_path, key, filed, real)
    found = diagnose(rig, {"r": record})
    assert found.verdict == "effect"
    [effect] = found.effects
    assert effect.name == name
    assert effect.parameters[0].found == pytest.approx(real, rel=0.02)
