"""What others install from: conda's environment, the Dockerfile, the citation, CI's Pythons."""

from __future__ import annotations

import importlib
import ntpath
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from coupled import parallel
from coupled.cli import app
from coupled.files import path_from
from coupled.resources import shipped_rigs, shipped_runs
from coupled.version import __version__
from tests.support.commands import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def test_the_conda_environment_has_the_bounds_of_the_package() -> None:
    text = (ROOT / "environment.yml").read_text("utf-8")
    found = set(re.findall(r"^  - ([\w-]+>=[\d.]+)$", text, re.MULTILINE))
    renamed = {each.replace("matplotlib>", "matplotlib-base>") for each in PROJECT["dependencies"]}
    assert found == {*renamed, f"python{PROJECT['requires-python']}"}


def test_the_citation_has_the_version() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^version: (\S+)$", text, re.MULTILINE) == [__version__]


def test_ci_runs_the_pythons_of_the_classifiers() -> None:
    named = [
        each.removeprefix("Programming Language :: Python :: ") for each in PROJECT["classifiers"]
    ]
    text = (ROOT / ".github/workflows/ci.yml").read_text("utf-8")
    matrix = re.search(r"python: \[(.*)\]", text)
    assert matrix is not None
    assert re.findall(r"3\.\d+", matrix[1]) == [
        each for each in named if re.fullmatch(r"3\.\d+", each)
    ]


def test_the_dockerfile_warms_by_commands_and_runs_that_there_are() -> None:
    text = (ROOT / "Dockerfile").read_text("utf-8")
    lines = re.findall(r"(?:RUN|&&) coupled (\w+) ?(.*?) ?\\?$", text, re.MULTILINE)
    assert [name for name, _ in lines] == ["compare", "fly", "diagnose"]
    assert {name for name, _ in lines} <= {
        each.callback.__name__ for each in app.registered_commands if each.callback
    }
    run, rig = lines[1][1].split()[0], lines[2][1].split("--rig ")[1]
    assert f'rig = "{rig}"' in shipped_runs()[run].read_text("utf-8")
    assert rig in shipped_rigs()


def test_a_path_from_another_drive_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert path_from(tmp_path / "rigs", tmp_path / "models") == "../models"

    def of_windows(path: object, start: object) -> str:
        return ntpath.relpath(r"D:\models", r"C:\rigs")

    monkeypatch.setattr(os.path, "relpath", of_windows)
    assert path_from(tmp_path, tmp_path / "models") == (tmp_path / "models").as_posix()


def test_windows_has_no_more_workers_than_it_can_wait_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert parallel.cores(200) == 200
    monkeypatch.setattr(sys, "platform", "win32")
    assert parallel.cores(200) == 61


def test_a_wheel_s_physics_are_compiled_with_what_the_build_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """pip installs it in a folder of its own, which no other process has on its path."""
    (tmp_path / "only_of_the_build.py").write_text("", encoding="utf-8")
    monkeypatch.syspath_prepend(str(ROOT))
    hook = importlib.import_module("hatch_build")
    monkeypatch.syspath_prepend(str(tmp_path))
    words = [sys.executable, "-c", "import only_of_the_build, coupled; print(coupled.__file__)"]
    environment = hook._environment(str(ROOT), str(tmp_path))
    done = subprocess.run(words, env=environment, cwd=tmp_path, capture_output=True, check=True)
    assert Path(done.stdout.decode().strip()).parent == ROOT / "coupled"
