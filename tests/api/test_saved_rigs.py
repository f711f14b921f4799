"""A rig is saved as the file that it came from, and read by the key that changes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import coupled
from coupled.record.channels import unit_of
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigwrite import rig_table
from tests.support.rigs import bench

RIGS = shipped_rigs()


def comments(text: str) -> list[str]:
    """Return the comments of a file, in their order."""
    return [line.partition("#")[2].strip() for line in text.splitlines() if "#" in line]


def saved(rig: Rig, folder: Path, remark: str = "") -> Rig:
    rig.save(folder / "saved.toml", remark)
    return coupled.load_rig(folder / "saved.toml")


@pytest.mark.parametrize("name", RIGS)
def test_an_unchanged_rig_is_saved_as_its_file(name: str, tmp_path: Path) -> None:
    rig = coupled.load_rig(name)
    assert saved(rig, tmp_path) == rig
    assert (tmp_path / "saved.toml").read_text() == RIGS[name].read_text()


NUMBERS: dict[str, st.SearchStrategy[object]] = {
    "loader.mass_kg": st.floats(0.5, 50.0),
    "loader.friction_N": st.integers(0, 2000).map(lambda n: 0.01 * n),
    "loader.play_{d}": st.integers(0, 100).map(lambda n: 1e-5 * n),
    "compensation.deflection": st.booleans(),
    "schedule.pressure_lag_s": st.integers(0, 100).map(lambda n: 1e-3 * n),
    "tolerance": st.sampled_from([{"loader.mass_kg": 0.1}, {}]),
}


@pytest.mark.parametrize("name", RIGS)
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_saved_rig_is_the_rig(name: str, tmp_path: Path, data: st.DataObject) -> None:
    rig = coupled.load_rig(name)
    control = data.draw(st.sampled_from(list(rig.controls)))
    chosen = data.draw(st.dictionaries(st.sampled_from(sorted(NUMBERS)), st.none(), min_size=1))
    changes = {
        f"controls.{control}.{key.format(d=unit_of(control))}": data.draw(NUMBERS[key])
        for key in chosen
    }
    if data.draw(st.booleans()):
        rig = rig.only(control)
    changed = rig.changed(changes)
    assert saved(changed, tmp_path) == changed
    kept = comments((tmp_path / "saved.toml").read_text())
    assert kept[:2] == comments(RIGS[name].read_text())[:2]
    for key, value in changes.items():
        assert changed[key] == value


def test_comments_and_layout_stay_beside_a_changed_number(tmp_path: Path) -> None:
    text = RIGS["t37"].read_text().replace("mass_kg = 5.0", "mass_kg = 5.0  # weighed", 1)
    (tmp_path / "mine.toml").write_text(text)
    rig = coupled.load_rig(tmp_path / "mine.toml")
    mass = rig["controls.column.loader.mass_kg"]
    again = saved(rig.changed({"controls.column.loader.mass_kg": mass + 1.5}), tmp_path, "Mine.")
    written = (tmp_path / "saved.toml").read_text()
    assert written.startswith("# Mine.\n")
    assert comments(written) == ["Mine.", *comments(text)]
    assert len(written.splitlines()) == len(text.splitlines()) + 1
    assert again["controls.column.loader.mass_kg"] == mass + 1.5


def test_a_saved_rig_flies_the_same_bytes(tmp_path: Path) -> None:
    rig = coupled.load_rig("t37").changed(
        {"controls.column.loader.play_m": 1e-3, "noise": {"column_force_N": 0.1}}
    )
    flights = [
        coupled.fly(each, column=coupled.Step(force_N=40), duration_s=1.5, seed=3)
        for each in (rig, saved(rig, tmp_path))
    ]
    assert flights[0].record.data.tobytes() == flights[1].record.data.tobytes()


def test_a_rig_of_no_file_is_saved_plainly(tmp_path: Path) -> None:
    rig = bench({"play_m": 1e-3})
    assert rig.file is None
    assert saved(rig, tmp_path) == rig


def test_a_models_folder_is_found_from_where_the_rig_is_saved(tmp_path: Path) -> None:
    (tmp_path / "rigs").mkdir()
    model = tmp_path / "models" / "mine"
    model.mkdir(parents=True)
    (model / "mine.xml").write_text("<fdm_config/>")
    text = (
        RIGS["t37"]
        .read_text()
        .replace('model = "T37"', 'model = "mine"\nmodel_folder = "../models"')
    )
    (tmp_path / "rigs" / "mine.toml").write_text(text)
    rig = coupled.load_rig(tmp_path / "rigs" / "mine.toml")
    rig.save(tmp_path / "rigs" / "beside.toml")
    assert 'model_folder = "../models"' in (tmp_path / "rigs" / "beside.toml").read_text()
    assert saved(rig, tmp_path) == rig


@pytest.mark.parametrize("name", ["t37", "bench"])
def test_every_number_is_read_by_its_key(name: str) -> None:
    rig = coupled.load_rig(name)

    def walk(table: dict[str, object], place: str) -> int:
        count = 0
        for key, value in table.items():
            if isinstance(value, dict) and value and all("." not in part for part in value):
                count += walk(value, f"{place}{key}.")
            elif not isinstance(value, dict):
                assert rig[f"{place}{key}"] == value, f"{place}{key}"
                count += 1
        return count

    assert walk(rig_table(rig), "") > 50


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("controls.column.loader.bend_m", "did you mean bend_m_per_N"),
        ("controls.wheel.loader.bend_m_per_N", "did you mean bend_rad_per_N"),
        ("controls.colum", "did you mean column"),
        ("name.short", "name has nothing within it"),
    ],
)
def test_a_key_that_is_not_there_is_a_key_error_that_names_the_nearest(key: str, said: str) -> None:
    rig = coupled.load_rig("t37")
    with pytest.raises(KeyError, match=said):
        _ = rig[key]
    with pytest.raises(coupled.InputError, match=said):
        _ = rig[key]


def test_a_rig_is_not_saved_as_something_else(tmp_path: Path) -> None:
    rig = coupled.load_rig("bench")
    with pytest.raises(coupled.InputError, match=r"ends in \.toml"):
        rig.save(tmp_path / "rig.txt")
    with pytest.raises(coupled.InputError, match="nowhere"):
        rig.save(tmp_path / "nowhere" / "rig.toml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_improved_rig_is_saved_with_the_comments_of_the_filed_one(tmp_path: Path) -> None:
    rig = coupled.load_rig("t37")
    worn = rig.changed({"controls.column.loader.bend_m_per_N": 4e-4})
    sweep = coupled.FrequencySweep(force_N=40, start_s=0.5, duration_s=8)
    flight = coupled.fly(worn, column=sweep, duration_s=10)
    found = coupled.diagnose(rig, flight.record)
    assert saved(found.improved, tmp_path) == found.improved
    assert comments((tmp_path / "saved.toml").read_text()) == comments(RIGS["t37"].read_text())
    assert np.isclose(found.improved["controls.column.loader.bend_m_per_N"], 4e-4, rtol=0.01)
