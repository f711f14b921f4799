"""Flight logs with several steps of the model a row, over which a simulation holds its commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.checks import at_rate_of, trimmed
from coupled.gap.stages.airframe import Flights, airframe_outputs
from coupled.record.importing.convert import import_log
from tests.support.alone import alone, noisy
from tests.support.ownlogs import flown


@pytest.mark.parametrize(("each", "law"), [(6, "held"), (1, "pchip")])
def test_commands_are_held_over_rows_if_that_fits_the_motion(
    tmp_path: Path, each: int, law: str
) -> None:
    log, _ = flown(tmp_path, {}, 12.0, rate_Hz=20.0, each=each)
    records = {"log": noisy(import_log(log)[0])}
    rig = trimmed(at_rate_of(alone(), records), records)[0]["log"]
    known = Flights()
    outputs = airframe_outputs(rig, records["log"], flights=known)
    assert known.law == law
    assert max(one.gap(rig) for one in outputs) < 1.2
