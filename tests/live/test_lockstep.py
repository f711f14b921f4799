"""Live and batch are one: in lock-step a live flight of a scripted pilot has the same bytes."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.flight.loop import fly
from coupled.flight.runfile import read_run
from coupled.live.host import Plan
from coupled.live.session import fly_live
from coupled.record.record import write_record


@pytest.mark.parametrize("run", ["capture", "three-controls", "appendix-c"])
def test_a_live_flight_in_lock_step_is_the_batch_flight_to_the_byte(
    run: str, tmp_path: Path
) -> None:
    manoeuvre = read_run(run)[0]
    batch = fly(manoeuvre)
    live = fly_live(manoeuvre, Plan(paced=False)).record
    write_record(batch, tmp_path / "batch.csv")
    write_record(live, tmp_path / "live.csv")
    assert (tmp_path / "live.csv").read_bytes() == (tmp_path / "batch.csv").read_bytes()
    manifest = dict(live.manifest)
    assert manifest.pop("live")["loader"] == "sim"
    assert manifest == dict(batch.manifest)
