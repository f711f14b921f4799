"""What is built from a clone: the package, its aircraft and runs, and no more; it flies, too."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

import pytest

from tests.support.commands import ROOT

pytestmark = pytest.mark.slow


def tracked(*folders: str) -> set[str]:
    """Return the files of these folders that stand under version control."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", *folders], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return {name for name in listed.stdout.split("\0") if name}


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution."""
    folder = tmp_path_factory.mktemp("archive")
    build = "import sys, hatchling.build; hatchling.build.build_sdist(sys.argv[1])"
    subprocess.run([sys.executable, "-c", build, str(folder)], cwd=ROOT, check=True, timeout=300)
    [archive] = folder.glob("*.tar.gz")
    return archive


@pytest.fixture(scope="module")
def wheel(archive: Path) -> Path:
    """The wheel, built from the source distribution; `.ci/run` builds one from the clone."""
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(archive.parent)]
    subprocess.run([*pip, str(archive)], check=True, timeout=900)
    [wheel] = archive.parent.glob("*.whl")
    return wheel


def test_a_wheel_holds_the_package_its_aircraft_and_runs(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        archive.extractall(tmp_path / "installed")
    wanted = tracked("coupled")
    wanted |= {f"coupled/shipped/{name}" for name in tracked("aircraft", "runs")}
    # What only makes the aircraft, and diagnoses kept as evidence, stay in the clone.
    kept = {n for n in wanted if not (n.startswith("coupled/shipped/") and n.endswith(".py"))}
    code = {name for name in names if PurePosixPath(name).match("coupled/shipped/machine/*.o")}
    assert {PurePosixPath(name).name.split("-")[0] for name in code} == {
        "step_frame_at",
        "static_at",
    }
    assert names - code == {name for name in kept if "/withheld/" not in name}
    assert "coupled/py.typed" in names
    shipped = "from coupled.resources import *; print(len(shipped_runs()), len(shipped_rigs()))"
    done = subprocess.run(
        [sys.executable, "-c", shipped],
        cwd=tmp_path / "installed",
        check=True,
        capture_output=True,
        text=True,
    )
    runs, rigs = map(int, done.stdout.split())
    assert runs == len([n for n in names if PurePosixPath(n).match("shipped/runs/*.toml")])
    assert rigs == len([n for n in names if PurePosixPath(n).match("shipped/aircraft/*/*.toml")])


def test_a_source_distribution_holds_what_a_clone_has(archive: Path) -> None:
    with tarfile.open(archive) as files:
        names = {name.partition("/")[2] for name in files.getnames()}
    folders = ("coupled", "aircraft", "runs", "tests", "docs", "README.md", "pyproject.toml")
    missing = tracked(*folders) - names
    assert missing == set()
    assert not {name for name in names if "__pycache__" in name or name.endswith(".pyc")}


def test_what_is_built_installs_and_flies(wheel: Path, tmp_path: Path) -> None:
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-compile"]
    target = tmp_path / "installed"
    subprocess.run([*pip, "--target", str(target), str(wheel)], check=True, timeout=900)
    cache = tmp_path / "cache"
    environment = {**os.environ, "PYTHONPATH": str(target), "NO_COLOR": "1"}

    def run(*words: str, **settings: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "coupled", *words],
            check=False,
            cwd=tmp_path,
            env={**environment, **settings},
            capture_output=True,
            text=True,
            timeout=300,
        )

    done = run("compare", "appendix-c", "--report", "report.html", NUMBA_CACHE_DIR=str(cache))
    assert done.returncode == 0, done.stderr
    assert "by closed form" in done.stdout
    assert (tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert (tmp_path / "out" / "appendix-c.png").is_file()
    # The physics came compiled, and has the bytes of what is compiled here.
    assert list(cache.rglob("placed.*.nbi"))
    assert not list(cache.rglob("*step_frame_at*")) + list(cache.rglob("*static_at*"))
    assert run("fly", "three-controls", "-o", "wheel.csv").returncode == 0
    assert run("fly", "three-controls", "-o", "here.csv", PYTHONPATH=str(ROOT)).returncode == 0
    assert (tmp_path / "wheel.csv").read_bytes() == (tmp_path / "here.csv").read_bytes()
