"""The command `coupled export`: what it writes, where, and what it refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from coupled.exporting.alone import PROGRAM
from coupled.resources import shipped_rigs
from tests.support.commands import coupled, files


@pytest.mark.slow
def test_an_exported_folder_is_self_contained(tmp_path: Path) -> None:
    done = coupled(tmp_path, "export", "737", "--jsbsim", "out/737", "--run", "from-table")
    assert done.returncode == 0, done.stderr
    assert "8 steps a run" in done.stdout
    written = files(tmp_path)
    assert {
        "out/737/README.md",
        "out/737/fly.py",
        "out/737/aircraft/737/737.xml",
        "out/737/aircraft/737/Systems/coupled-column.xml",
        "out/737/aircraft/737/Systems/coupled-pedals.xml",
        "out/737/aircraft/737/Engines/CFM56.xml",
        "out/737/scripts/from-table-compensated.xml",
    } <= written
    assert all(name.startswith("out/737/") for name in written)
    model = (tmp_path / "out/737/aircraft/737/737.xml").read_text()
    assert model.index('<system file="coupled-column"/>') < model.index("<flight_control")
    mark = json.loads((tmp_path / "out/737/coupled-export.json").read_text())
    assert max(one["deflection"] for one in mark["beside"]) < 0.01
    readme = (tmp_path / "out/737/README.md").read_text()
    assert "`coupled/column/force-N`" in readme
    assert "| from-table | from-table | compensated |" in readme


def test_a_new_export_takes_the_place_of_a_former_one_and_of_nothing_else(tmp_path: Path) -> None:
    words = ("export", "bench", "--jsbsim", "out", "--no-check", "--run", "appendix-c")
    assert coupled(tmp_path, *words).returncode == 0
    (tmp_path / "out" / "mine.txt").write_text("mine")
    again = (*words, "--case", "as printed, 2189 N/m then 1095 N/m")
    assert coupled(tmp_path, *again).returncode == 0
    left = files(tmp_path / "out")
    assert "mine.txt" in left
    scripts = {name for name in left if name.startswith("scripts")}
    assert scripts == {
        "scripts/appendix-c-compensated.xml",
        "scripts/appendix-c-uncompensated.xml",
    }


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("no-such",), "is no shipped rig"),
        (("bench", "--run", "no-such"), "is no shipped run"),
        (("bench", "--run", "appendix-c", "--case", "x"), "--case: no case 'x'"),
        (("bench", "--loader-rate-Hz", "1e9"), "--loader-rate-Hz: asks for"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_a_line(
    tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    done = coupled(tmp_path, "export", *words, "--jsbsim", "out")
    assert done.returncode == 2
    assert said in done.stderr.replace("\n", " ")
    assert files(tmp_path) == set()


def test_a_folder_of_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    done = coupled(tmp_path, "export", "bench", "--jsbsim", ".")
    assert done.returncode == 2
    assert "holds files that are no export" in done.stderr
    assert files(tmp_path) == {"mine.txt"}


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("mine.txt/out", "mine.txt/out/coupled-export.json: cannot be written there"),
        ("no/out", "there is no folder no; make it first"),
    ],
)
def test_a_folder_that_cannot_be_made_is_refused_before_a_flight(
    tmp_path: Path, place: str, said: str
) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    done = coupled(tmp_path, "export", "bench", "--jsbsim", place, "--no-check")
    assert done.returncode == 2
    assert said in done.stderr
    assert files(tmp_path) == {"mine.txt"}


def test_a_key_that_is_not_exported_is_named_with_its_file(tmp_path: Path) -> None:
    text = shipped_rigs()["bench"].read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(text + "\n[controls.column.sensing]\ngauge_mass_kg = 0.2\n")
    done = coupled(tmp_path, "export", "./rig.toml", "--jsbsim", "out")
    assert done.returncode == 2
    assert "controls.column.sensing.gauge_mass_kg" in done.stderr.replace("\n", "")
    assert files(tmp_path) == {"rig.toml"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "python fly.py scripts/NAME.xml"),
        (("scripts/pul.xml",), "scripts/pul.xml: there is no such file"),
        (("fly.py",), "fly.py does not load"),
    ],
)
def test_the_program_of_an_export_refuses_what_it_cannot_fly(
    tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    (tmp_path / "fly.py").write_text(PROGRAM, encoding="utf-8")
    call = [sys.executable, "fly.py", *words]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert said in done.stderr and "Traceback" not in done.stderr
