"""Compiled code is kept on disk where there is a place for it, and flies without one."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
from pathlib import Path
from subprocess import PIPE

import numpy as np
import pytest
from llvmlite import binding
from numpy.typing import NDArray

import coupled
from coupled.rig import compiled, replay
from coupled.rig.compiled import (
    carray,
    compiled_before,
    entry,
    function_at,
    machine_code,
    pointer,
    shippable,
)
from coupled.rig.hosted import Feel
from coupled.rig.nodes import on_nodes
from tests.support.rigs import bench

Floats = NDArray[np.float64]

KERNEL = """
from coupled.rig.compiled import entry

@entry
def twice(number):
    return 2.0 * number
"""


def double(package: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    """Print twice 2.0, by a kernel in a copy of the package whose folders take no files."""
    (package / "rig" / "kernel.py").write_text(KERNEL)
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "XDG_"))}
    environment = {**kept, "PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", "from coupled.rig.kernel import twice; print(twice(2.0))"]
    return subprocess.run(
        command,
        env={**environment, **settings},
        cwd=package.parent,
        capture_output=True,
        text=True,
        check=False,
    )


def copy_of_the_package(to: Path) -> Path:
    """Copy the package; a file stands where each room's cache would be, as on read-only media."""
    source = Path(coupled.__file__).parent
    package = shutil.copytree(
        source, to / "coupled", ignore=shutil.ignore_patterns("__pycache__"), symlinks=True
    )
    for data in ("aircraft", "runs"):
        (to / data).symlink_to(source.parent / data)
    for room in [package, *package.rglob("*/")]:
        if room.is_dir():
            (room / "__pycache__").touch()
    return package


def test_without_a_place_for_the_cache_a_kernel_runs_from_memory(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    (package / "nowhere.txt").touch()
    done = double(package, HOME=str(package / "nowhere.txt"))
    assert (done.returncode, done.stdout, done.stderr) == (0, "4.0\n", "")


def test_a_cache_folder_that_is_set_is_used(tmp_path: Path) -> None:
    package = copy_of_the_package(tmp_path)
    (package / "nowhere.txt").touch()
    chosen = tmp_path / "cache"
    done = double(package, HOME=str(package / "nowhere.txt"), NUMBA_CACHE_DIR=str(chosen))
    assert (done.returncode, done.stdout, done.stderr) == (0, "4.0\n", "")
    assert list(chosen.rglob("*.nbi"))


START = """
import sys
from coupled.rig.compiled import compiled_before
from coupled.rig.placed import step_frame_at
print(compiled_before(step_frame_at))
from coupled.flight.loop import fly
from tests.support.runs import shortened
fly(shortened("pull-up-c172p", 1, 2))
needless = [name in sys.modules for name in ("numba.np.linalg", "scipy.linalg")]
print(compiled_before(step_frame_at), *needless)
"""


def start(cache: Path) -> list[str]:
    """Fly two frames with a cache of one's own; return what is printed."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", START]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.slow
def test_a_second_start_loads_no_compiler_and_no_linear_algebra(tmp_path: Path) -> None:
    assert start(tmp_path)[:2] == ["False", "True"]
    assert start(tmp_path) == ["True", "True", "False", "False"]


TOGETHER = """
import sys
from kernel import twice
print("ready", flush=True)
sys.stdin.readline()
print(twice(2.0), twice(1j), sum(twice.stats.cache_hits.values()))
"""


def test_processes_that_start_together_compile_a_kernel_once(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    command = [sys.executable, "-c", TOGETHER]
    started = [
        subprocess.Popen(command, env=environment, stdin=PIPE, stdout=PIPE, text=True)
        for _ in range(2)
    ]
    for each in started:
        assert each.stdout is not None
        assert each.stdout.readline() == "ready\n"
    for each in started:
        assert each.stdin is not None
        each.stdin.write("\n")
        each.stdin.flush()
    said = [each.communicate(timeout=300)[0].split() for each in started]
    assert all(words[:2] == ["4.0", "2j"] for words in said)
    assert sum(int(words[2]) for words in said) == 2 * (len(started) - 1)


@entry
def scaled(address: int, k: int) -> float:
    """Return the number at an address, raised by the C library to a power."""
    return float(carray(pointer(address), 1, np.float64)[0] ** (1.0 / k))


def test_code_that_comes_with_the_package_runs_where_it_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, code = shippable(scaled)
    (tmp_path / name).write_bytes(code)
    number = np.array([1.7])
    wanted, place = math.pow(1.7, 1.0 / 3.0), int(number.ctypes.data)
    compiled_here = function_at(machine_code(scaled, 0, 0))
    monkeypatch.setattr(compiled, "_SHIPPED", tmp_path)
    assert compiled_before(scaled)
    with monkeypatch.context() as without:
        without.setattr(compiled, "bound", None)  # cannot compile
        assert function_at(machine_code(scaled, 0, 0))(place, 3) == wanted
    assert compiled_here(place, 3) == wanted
    # Not on an older processor, and not after a change of the sources.
    if compiled._level()[1]:
        with monkeypatch.context() as older:
            older.setattr(binding, "get_host_cpu_features", dict)
            assert compiled._shipped_file(scaled) is None
    (tmp_path / name).rename(tmp_path / name.replace("kernels-", "kernels-0"))
    assert compiled._shipped_file(scaled) is None


def test_the_columns_of_a_table_take_the_kernels_of_contiguous_signals() -> None:
    """Each layout of each signal was compiled and cached apart, which takes half a minute."""
    rig, table = bench(), np.random.default_rng(1).normal(scale=0.01, size=(40, 2))

    def replayed(one: Floats, other: Floats) -> Floats:
        feel = Feel(np.full(len(one), 500.0))
        return np.stack(
            (
                replay.replay_product(rig, "column", one, feel),
                replay.replay_linkage(rig, "column", one, other),
                replay.drive_linkage(rig, "column", on_nodes(rig, one), other),
                replay.bent_by(rig, "column", other),
                replay.replay_compensation(rig, "column", one, other),
                replay.replay_surface(rig, "column", one, other),
            )
        )

    def signatures() -> dict[str, int]:
        kernels = vars(replay).items()
        return {name: len(each.signatures) for name, each in kernels if hasattr(each, "signatures")}

    wanted = replayed(*np.ascontiguousarray(table.T))
    before = signatures()
    assert {"_product", "_linkage", "_bent", "_compensation", "_surface"} <= set(before)
    assert np.array_equal(replayed(*table.T), wanted)
    assert signatures() == before
