"""An effect that improves only outputs within their noise, beside a fault of another output."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.gap.checks import at_rate_of, trimmed
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.signals.output import TRIM, Output
from coupled.gap.stages.airframe import airframe_outputs
from coupled.record.importing.convert import import_log
from coupled.record.record import Record
from tests.support.alone import alone, noisy
from tests.support.gaps import know_only
from tests.support.ownlogs import flown


def trim_of(log: Record) -> tuple[Output, float]:
    """Return the output of the elevator in trim, and its gap."""
    given = {"log": log}
    rig = trimmed(at_rate_of(alone(), given), given)[0]["log"]
    (trim,) = (one for one in airframe_outputs(rig, log) if one.channel == TRIM)
    return trim, trim.gap(rig)


@pytest.mark.slow
def test_a_trim_within_its_noise_hides_no_other_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A set of the trim's effect alone has the larger evidence, but explains no gap."""
    log = noisy(import_log(flown(tmp_path, {"/Clp": 0.95}, 20.0)[0])[0])
    trim, gap = trim_of(log)
    assert gap < 0.5
    data = log.data.copy()
    data[:, log.channels.index("elevator_rad")] += 1.1 * trim.floor
    moved = Record(log.channels, data, log.manifest)
    assert 1.0 < trim_of(moved)[1] < trim.limit
    know_only(monkeypatch, [BY_NAME[n] for n in ("roll_damping", "center_of_gravity")])
    found = diagnose(alone(), {"log": moved})
    assert [effect.name for effect in found.effects] == ["roll_damping"]
    assert np.isclose(found.effects[0].value or 0.0, 0.95, atol=0.02)
