"""A record is compared with its rig in the record's trim, and with the rig of its manifest."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import coupled as api
from coupled.errors import InputError
from coupled.flight.runfile import read_run
from coupled.gap.checks import trimmed, unmeasured_trim
from coupled.record.record import Record, manifest_path, write_record
from coupled.rig.rig import Rig
from tests.support import threecontrols
from tests.support.airframes import noisy
from tests.support.commands import coupled

CAS = "flight.calibrated_airspeed_m_per_s"
WORN = {"controls.column.loader.bend_m_per_N": 6e-4, "noise.column_deflection_m": 2e-5}


@pytest.fixture(scope="module")
def slow_737() -> Record:
    """Return the first case of `pull-up-737`, whose rig file is trimmed at another speed."""
    return api.fly(read_run("pull-up-737")[0]).record


@pytest.fixture(scope="module")
def filed() -> Rig:
    """Return the 737 as its rig file has it."""
    return api.load_rig("737")


def bare(record: Record) -> Record:
    """Return a record without a manifest, as of a log that was imported."""
    return Record(record.channels, record.data)


def test_the_trim_is_taken_from_the_manifest_and_said(slow_737: Record, filed: Rig) -> None:
    found = api.diagnose(filed, slow_737)
    assert found.verdict == "no_gap"
    assert found.nominal.flight is not None
    assert found.nominal.flight.calibrated_airspeed == pytest.approx(102.9)
    assert found.summary.startswith(
        "Trim taken from the manifest of record, not from the rig file:"
    )
    assert f"{CAS.partition('.')[2]} 130 → 102.9" in found.summary
    assert found.as_dict()["trim"] == found.trim


def test_the_trim_is_taken_from_the_first_rows_without_a_manifest(
    slow_737: Record, filed: Rig
) -> None:
    found = api.diagnose(filed, bare(slow_737))
    assert found.verdict == "no_gap"
    assert found.trim.startswith("Trim taken from the first rows of record,")
    assert found.nominal.flight is not None
    assert found.nominal.flight.calibrated_airspeed == pytest.approx(102.9, rel=1e-3)


@pytest.mark.parametrize(
    ("faster", "higher_m", "climb"),
    [
        (1.01, 0.0, 0.0),
        pytest.param(1.0, 60.0, 0.0, marks=pytest.mark.slow),
        pytest.param(1.0, 0.0, 0.003, marks=pytest.mark.slow),
        (1.0, 0.0, 0.0),
    ],
)
def test_a_healthy_flight_at_nearly_the_filed_trim_has_no_gap(
    faster: float, higher_m: float, climb: float
) -> None:
    """One per cent of speed left 16 noise floors, since up to 3 % counted as the filed trim."""
    rig = noisy(api.load_rig("c172p"))
    assert rig.flight is not None
    speed, height = rig.flight.calibrated_airspeed * faster, rig.flight.altitude + higher_m
    trim = {CAS: speed, "flight.altitude_m": height, "flight.flight_path_rad": climb}
    record = bare(threecontrols.flown(rig, trim, 16.0))
    found = api.diagnose(rig, record)
    assert found.verdict == "no_gap", found.summary
    taken = found.nominal.flight
    assert taken is not None
    assert taken.calibrated_airspeed == pytest.approx(speed, rel=1e-3)
    assert taken.altitude == pytest.approx(height, abs=0.5)
    assert taken.flight_path == pytest.approx(climb, abs=3e-4)
    assert (taken == rig.flight) is (faster == 1.0 and not higher_m and not climb)


@pytest.mark.parametrize("name", ["alpha_rad", "pitch_rad"])
def test_an_offset_of_vane_or_attitude_is_no_path(name: str) -> None:
    rig = noisy(api.load_rig("c172p"))
    record = threecontrols.flown(rig, {}, 16.0)
    data = record.data.copy()
    data[:, record.channels.index(name)] += 0.01
    assert trimmed(rig, {"r": Record(record.channels, data)}) == ({"r": rig}, "")


def test_a_trim_that_is_the_rig_files_own_is_not_talked_of(filed: Rig) -> None:
    sweep = api.FrequencySweep(force_N=120, duration_s=5)
    own = api.fly(filed, column=sweep, duration_s=6).record
    assert api.diagnose(filed, bare(own)).trim == api.diagnose(filed, own).trim == ""


@pytest.mark.slow
def test_a_fault_in_the_manifests_rig_is_found_against_the_rig_file(slow_737: Record) -> None:
    """The manifest's trim is taken, and nothing else of its rig."""
    worn = replace(
        case := read_run("pull-up-737")[0],
        rig=case.rig.changed(WORN),
    )
    found = api.diagnose("737", api.fly(worn).record)
    assert [effect.name for effect in found.effects] == ["bend"]
    assert found.effects[0].value == pytest.approx(6e-4, rel=0.03)


def test_without_a_rig_the_manifests_is_taken(slow_737: Record) -> None:
    found = api.diagnose(None, slow_737)
    assert (found.verdict, found.trim) == ("no_gap", "")
    with pytest.raises(InputError, match="no manifest beside the record holds a rig"):
        api.diagnose(None, bare(slow_737))
    other = Record(slow_737.channels, slow_737.data, json.loads(json.dumps(slow_737.manifest)))
    other.manifest["rig"]["controls"]["column"]["loader"]["mass_kg"] = 9.0
    with pytest.raises(InputError, match="b: --rig: its manifest holds another rig than that of a"):
        api.diagnose(None, {"a": slow_737, "b": other})


def test_another_aircraft_and_a_record_without_its_trim_are_refused(
    slow_737: Record, filed: Rig
) -> None:
    with pytest.raises(InputError, match="'737' in the manifest, 'T37' in the rig file"):
        api.diagnose("t37", slow_737)
    fast = api.fly(read_run("pull-up-737")[1]).record
    later = Record(fast.channels, fast.data, slow_737.manifest)
    with pytest.raises(InputError, match="b: true_airspeed_m_per_s: starts at"):
        api.diagnose(filed, {"a": slow_737, "b": later})


@pytest.mark.slow
@pytest.mark.parametrize("faster", [1.02, 1.25])
def test_each_record_is_flown_from_its_own_trim(faster: float) -> None:
    """A record 2 % faster than the first was flown from the first one's trim, and had a gap."""
    rig = noisy(api.load_rig("c172p"))
    speed = rig["flight.calibrated_airspeed_m_per_s"]

    def flown(damping: float) -> dict[str, Record]:
        return {
            name: bare(
                threecontrols.flown(
                    rig, {CAS: one, "flight.roll_damping": damping}, 12.0, pedals=160.0
                )
            )
            for name, one in (("a", speed), ("b", faster * speed))
        }

    well = api.diagnose(rig, flown(1.0))
    assert well.verdict == "no_gap"
    assert well.trim.count("Trim taken from") == 1 and "the first rows of b" in well.trim
    found = api.diagnose(rig, flown(0.7))
    assert [effect.name for effect in found.effects] == ["roll_damping"]
    assert found.effects[0].value == pytest.approx(0.7, rel=0.01)


def test_a_record_that_lacks_its_airspeed_is_flown_from_the_trim_of_another(
    slow_737: Record, filed: Rig
) -> None:
    """It was flown from the rig file's trim beside records of another one: a gap of 856 floors."""
    kept = [name for name in slow_737.channels if name != "true_airspeed_m_per_s"]
    blind = Record(tuple(kept), np.column_stack([slow_737[name] for name in kept]))
    records = {"a": bare(slow_737), "b": blind}
    for order in (("a", "b"), ("b", "a")):
        trims, said = trimmed(filed, {file: records[file] for file in order})
        assert trims["b"] == trims["a"] != filed
        assert said.startswith("Trim taken from the first rows of a,")
    assert "the trim is that of a. " in unmeasured_trim(trims["a"], records)
    assert trimmed(filed, {"b": blind}) == ({"b": filed}, "")


def test_the_help_pages_example_runs_on_the_guides_record(tmp_path: Path, slow_737: Record) -> None:
    write_record(slow_737, tmp_path / "737.csv")
    for words in (("737.csv", "--rig", "737"), ("737.csv",)):
        done = coupled(tmp_path, "diagnose", *words)
        assert (done.returncode, done.stderr) == (0, "")
        assert "No gap in the column" in " ".join(done.stdout.split())
    assert "rig: 737, of the manifest of 737.csv" in done.stdout
    manifest_path(tmp_path / "737.csv").unlink()
    refused = coupled(tmp_path, "diagnose", "737.csv")
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: 737.csv: --rig: is missing")


@pytest.mark.slow
def test_an_improved_rig_keeps_the_rig_files_trim(tmp_path: Path) -> None:
    case = read_run("pull-up-737")[0]
    write_record(api.fly(replace(case, rig=case.rig.changed(WORN))).record, tmp_path / "w.csv")
    done = coupled(tmp_path, "diagnose", "w.csv", "--rig", "737", "--improve", "new.toml")
    assert done.returncode == 0, done.stderr
    improved = api.load_rig(tmp_path / "new.toml")
    assert improved.flight == api.load_rig("737").flight
    assert improved.controls["column"].loader.bend == pytest.approx(6e-4, rel=0.03)


@pytest.mark.slow
def test_on_a_hot_day_the_air_is_as_probable_as_a_mass() -> None:
    """Mass and inertias had 0.89 each, and were to be set."""
    rig = noisy(api.load_rig("c172p"))
    hot = rig.changed({"flight.properties": {"atmosphere/delta-T": 36.0}})
    found = api.diagnose(rig, bare(threecontrols.flown(hot, {"flight.roll_damping": 0.7}, 16.0)))
    assert found.verdict == "ambiguous"
    by = {effect.name: effect.probability for effect in found.effects}
    assert by.pop("roll_damping") > 0.8
    assert "mass" in by
    assert max(by.values()) < 0.5
    assert "the density of the air is 0.94" in found.summary
