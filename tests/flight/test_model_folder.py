"""A model of the user's own, in a folder that the rig file names from its own place."""

from __future__ import annotations

import shutil
from pathlib import Path, PurePosixPath

import numpy as np
import pytest

from coupled import Step, load_rig
from coupled import fly as fly_rig
from coupled.errors import InputError
from coupled.exporting.alone import fly_alone
from coupled.exporting.write import Flown, export, put
from coupled.flight.airframe import packaged_models
from coupled.flight.loop import fly
from coupled.flight.runfile import read_run
from coupled.record.record import read_record
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.commands import coupled

RUN = """
name = "short"
card = "A pull on a rig of one's own."
rig = "mine.toml"
duration_s = 2.0
[pilot.column]
kind = "step"
force_N = 20.0
[[case]]
label = "a pull"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a copy of the T-37 under another name, a rig and a run."""
    own = tmp_path / "models" / "MINE"
    shutil.copytree(packaged_models()["T37"] / "T37", own)
    (own / "T37.xml").rename(own / "MINE.xml")
    rig = shipped_rigs()["t37"].read_text()
    named = 'model = "MINE"\nmodel_folder = "models"'
    (tmp_path / "mine.toml").write_text(rig.replace('model = "T37"', named))
    (tmp_path / "short.toml").write_text(RUN)
    return tmp_path


def test_a_model_beside_the_rig_file_flies_as_the_packaged_one(folder: Path) -> None:
    done = coupled(folder, "fly", "short.toml", "-o", "mine.csv")
    assert done.returncode == 0, done.stderr
    (folder / "packaged.toml").write_text(RUN.replace("mine.toml", "t37"))
    assert coupled(folder, "fly", "packaged.toml", "-o", "packaged.csv").returncode == 0
    mine, packaged = (read_record(folder / name) for name in ("mine.csv", "packaged.csv"))
    np.testing.assert_array_equal(mine.data, packaged.data)


def test_rig_and_model_may_be_moved_together(folder: Path) -> None:
    moved = folder.with_name(folder.name + "-moved")
    folder.rename(moved)
    flight = read_rig(moved / "mine.toml").flight
    assert flight is not None
    assert Path(flight.folder) == moved / "models"


def test_a_folder_without_the_model_is_named(folder: Path) -> None:
    text = (folder / "mine.toml").read_text()
    (folder / "mine.toml").write_text(text.replace('"models"', '"elsewhere"'))
    with pytest.raises(
        InputError, match=r"mine.toml: flight.model_folder: 'elsewhere' contains no"
    ):
        read_rig(folder / "mine.toml")
    lost = load_rig("t37").changed({"flight.model_folder": "elsewhere"})
    with pytest.raises(InputError, match=r"model_folder: 'elsewhere' contains no T37/T37.xml"):
        fly_rig(lost, column=Step(force_N=5.0), duration_s=0.1)


def test_a_variant_of_another_file_name_flies_and_is_exported_alone(folder: Path) -> None:
    """The model's file has not the name of its folder; the export needs neither."""
    own = folder / "models" / "MINE"
    (own / "MINE.xml").rename(own / "late.xml")
    file = folder / "mine.toml"
    with pytest.raises(InputError, match=r"model_folder: 'models' contains no MINE/MINE.xml"):
        read_rig(file)
    file.write_text(file.read_text().replace('"MINE"\n', '"MINE"\nmodel_file = "late"\n'))
    flown = {}
    for name in ("mine.toml", "t37"):
        (folder / "short.toml").write_text(RUN.replace("mine.toml", name))
        (run,) = read_run(str(folder / "short.toml"))
        flown[name] = fly(run)
    np.testing.assert_array_equal(flown["mine.toml"].data, flown["t37"].data)
    (folder / "short.toml").write_text(RUN)
    (run,) = read_run(str(folder / "short.toml"))
    made = export(run.rig, [Flown(run, ("compensated",))], file, check=False)
    assert PurePosixPath("aircraft/MINE/MINE.xml") in made.files
    put(made.files, folder / "alone")
    shutil.rmtree(folder / "models")
    (script,) = (folder / "alone" / "scripts").iterdir()
    table, _ = fly_alone(folder / "alone", f"scripts/{script.name}", ["coupled/column/computed-m"])
    compensated = flown["mine.toml"]["column_computed_m"]
    assert table[:, 0].max() == pytest.approx(compensated.max(), rel=0.02)


@pytest.mark.slow
def test_a_first_rig_for_a_folder_flies_from_where_it_was_written(folder: Path) -> None:
    done = coupled(folder, "new", "rig", "models/MINE", "first.toml")
    assert done.returncode == 0, done.stderr
    assert 'model_folder = "models"' in (folder / "first.toml").read_text()
    (folder / "short.toml").write_text(RUN.replace("mine.toml", "first.toml"))
    done = coupled(folder, "fly", "short.toml")
    assert done.returncode == 0, done.stderr
