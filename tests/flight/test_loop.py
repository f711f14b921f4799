"""Flights: how they end, the content of their record, and that they repeat to the bit."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupled.flight.bench import Bench
from coupled.flight.companion import FlightAccess
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.runfile import read_run
from coupled.record.channels import record_channels
from coupled.record.record import FORMAT, manifest_path, read_record, write_record
from coupled.resources import shipped_rigs
from coupled.rig.placed import step_frame_at
from coupled.rig.rigfile import read_rig, rig_from_table
from tests.support.runs import shortened

RUN = """
name = "test"
card = "A test."
rig = "report-column"
duration_s = {duration}
seed = 3

[pilot.column]
{pilot}
"""


def manoeuvre(folder: Path, pilot: str, duration: float = 4.0, more: str = "") -> Manoeuvre:
    path = folder / "test.toml"
    path.write_text(RUN.format(duration=duration, pilot=pilot) + more, encoding="utf-8")
    return read_run(str(path))[0]


def test_the_same_run_twice_is_bit_equal(tmp_path: Path) -> None:
    noise = '\n[[case]]\nlabel = "noisy"\nrig = { "noise.column_force_N" = 0.2 }\n'
    flown = manoeuvre(tmp_path, 'kind = "doublet"\nforce_N = 40.0\nhalf_period_s = 0.7', more=noise)
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for path in paths:
        write_record(fly(flown), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert manifest_path(paths[0]).read_bytes() == manifest_path(paths[1]).read_bytes()


def test_one_kernel_flies_every_kind_of_rig() -> None:
    """A kernel for each kind of rig would take ten more seconds to compile."""
    for run, controls in (("pull-up-c172p", 1), ("three-controls", 3), ("appendix-c", 1)):
        fly(shortened(run, controls, 2))
    kernel: Any = step_frame_at
    assert len(kernel.signatures) == 1


def test_a_heading_starts_at_north_and_turns_to_either_side_of_it() -> None:
    """JSBSim counts it from 0 to 2π, so north and a degree to its left were a turn apart."""
    right = fly(shortened("roll-authority", 2, 360))["heading_rad"]
    assert abs(right[0]) < 1e-9
    assert np.max(np.abs(np.diff(right))) < 0.01
    assert right[-1] > 0.01


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_record_is_read_back_as_it_was_written(tmp_path: Path, suffix: str) -> None:
    record = fly(manoeuvre(tmp_path, 'kind = "step"\nforce_N = 30.0'))
    path = tmp_path / f"flight{suffix}"
    write_record(record, path)
    again = read_record(path)
    assert again.channels == record.channels
    assert np.array_equal(again.data, record.data)
    assert again.manifest == {**json.loads(json.dumps(record.manifest)), "format": FORMAT}
    assert {p.name for p in tmp_path.iterdir()} == {path.name, "flight.manifest.json", "test.toml"}


def test_the_manifest_says_what_went_in(tmp_path: Path) -> None:
    record = fly(manoeuvre(tmp_path, 'kind = "step"\nforce_N = 30.0'))
    manifest = record.manifest
    assert manifest["seed"] == 3
    assert manifest["ended_early"] is None
    assert set(manifest["inputs_sha256"]) == {"test.toml", "report-column.toml"}
    assert {"coupled", "jsbsim", "numpy", "numba", "python"} <= set(manifest["versions"])
    assert rig_from_table(manifest["rig"], "manifest") == read_rig(shipped_rigs()["report-column"])
    assert manifest["positive"]["column"] == "a pull"
    assert "a pull gives a negative command" in manifest["positive"]["column_surface_norm"]
    assert record["column_surface_norm"].min() < -0.05  # as the manifest says of a pull
    assert record.channels == record_channels(["column"], flown=True)
    assert record.time_s[1] == pytest.approx(1 / 120)


def test_a_dive_ends_at_the_ground_and_keeps_the_record(tmp_path: Path) -> None:
    low = '\n[[case]]\nlabel = "low"\nrig = { "flight.altitude_m" = 60.0 }\n'
    push = 'kind = "step"\nforce_N = -60.0'
    record = fly(manoeuvre(tmp_path, push, duration=30.0, more=low))
    ended = record.manifest["ended_early"]
    assert ended["reason"] == "the aircraft met the ground"
    assert 1.0 < ended["time_s"] < 29.0
    assert len(record) == round(ended["time_s"] * 120)
    assert record["altitude_m"][-1] < 10.0


def test_a_state_that_is_not_finite_ends_the_flight(tmp_path: Path) -> None:
    """A wind of 1e12 ft/s makes JSBSim's state NaN while its run() still returns true."""
    gale = '\n[event.gale]\nproperty = "atmosphere/wind-north-fps"\nat_s = 0.5\nto = 1e12\n'
    record = fly(manoeuvre(tmp_path, 'kind = "step"\nforce_N = 10.0', more=gale))
    ended = record.manifest["ended_early"]
    assert ended["reason"] == "the state is not finite"
    assert 0.5 < ended["time_s"] < 0.6
    assert len(record) == round(ended["time_s"] * 120)
    assert np.all(np.isfinite(record.data))


class Onlooker:
    """A companion that does nothing; with it the flight runs frame by frame."""

    real_loader = sets_services = False

    def begin(self, access: FlightAccess) -> None:
        pass

    def before(self, k: int, motion: tuple[float, ...]) -> str:
        return ""

    def after(self, k: int, commands: tuple[float, float, float]) -> None:
        pass


@pytest.mark.parametrize(("run", "controls"), [("pull-up-c172p", 1), ("three-controls", 3)])
def test_frames_in_blocks_are_the_frames_one_by_one(run: str, controls: int) -> None:
    flown = shortened(run, controls, 200)
    in_blocks, one_by_one = fly(flown), fly(flown, companion=Onlooker())
    assert np.ptp(in_blocks["column_surface_norm"]) > 0.01
    assert in_blocks.data.tobytes() == one_by_one.data.tobytes()


def test_an_interrupted_flight_keeps_its_record(tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        if done >= 128:
            raise KeyboardInterrupt

    record = fly(manoeuvre(tmp_path, 'kind = "step"\nforce_N = 10.0'), stop)
    assert record.manifest["ended_early"]["reason"] == "interrupted"
    assert len(record) == 128
    assert record["true_airspeed_m_per_s"].min() > 100.0


def test_the_attitude_hand_captures_and_holds(tmp_path: Path) -> None:
    hand = 'kind = "attitude"\nchange_rad = 0.05\ngain_N_per_rad = 900.0\n'
    hand += "rate_gain_N_s_per_rad = 150.0\nintegral_gain_N_per_rad_s = 300.0"
    record = fly(manoeuvre(tmp_path, hand, duration=30.0))
    pitch = record["pitch_rad"] - record["pitch_rad"][0]
    assert pitch[record.time_s > 20.0] == pytest.approx(0.05, abs=0.004)
    assert np.max(np.abs(record["column_force_N"])) < 330.0


def test_further_properties_are_recorded(tmp_path: Path) -> None:
    path = tmp_path / "test.toml"
    text = RUN.format(duration=1.0, pilot='kind = "step"\nforce_N = 1.0')
    path.write_text(text.replace("seed = 3", 'record_properties = ["inertia/weight-lbs"]'))
    record = fly(read_run(str(path))[0])
    assert record.channels[-1] == "inertia/weight-lbs"
    assert 3000.0 < record["inertia/weight-lbs"][0] < 8000.0


def test_three_controls_fly_together() -> None:
    record = fly(read_run("three-controls")[0])
    for control, rate in (("column", "pitch"), ("wheel", "roll"), ("pedals", "yaw")):
        assert np.max(np.abs(record[f"{control}_force_N"])) > 10.0
        assert np.max(np.abs(record[f"{rate}_rate_rad_per_s"])) > 0.1


def test_the_noise_of_a_channel_is_its_column_of_the_seeds_draws() -> None:
    """The hand's own force takes no draw: the noise of a seed is that of older records."""
    quiet = shortened("pull-up-c172p", 1, 50)
    levels = {"noise.column_deflection_m": 1e-5, "noise.pitch_rad": 0.1}
    noisy = replace(quiet, rig=quiet.rig.changed(levels))
    record, plain = fly(noisy), fly(quiet)
    drawn = [name for name in record.channels if name != "column_hand_force_N"]
    draws = np.random.default_rng(noisy.seed).standard_normal((50, len(drawn)))
    for name, level in (("column_deflection_m", 1e-5), ("pitch_rad", 0.1)):
        noise = level * draws[:, drawn.index(name)]
        np.testing.assert_allclose(record[name] - plain[name], noise, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(record["column_hand_force_N"], plain["column_hand_force_N"])


def test_a_bench_reads_its_pressure_as_fast_however_many_points_it_has() -> None:
    """At 10 kHz, a test that a diagnosis proposes took minutes to simulate."""
    times = np.arange(100_000) * 1e-3
    bench = Bench(0.05, list(zip(times.tolist(), (50.0 * times).tolist(), strict=True)))
    began = time.process_time()
    read = []
    for _ in range(2_000):
        read.append(bench.motion()[0])
        bench.step((0.0, 0.0, 0.0))
    assert time.process_time() - began < 1.0
    assert read == pytest.approx(np.interp(0.05 * np.arange(2_000), times, 50.0 * times).tolist())
    ends = Bench(1.0, [(1.0, 10.0), (2.0, 20.0)])
    held = []
    for _ in range(4):
        held.append(ends.motion()[0])
        ends.step((0.0, 0.0, 0.0))
    assert held == [10.0, 10.0, 20.0, 20.0]
