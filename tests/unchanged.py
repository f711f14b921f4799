"""Whether records are the same to the byte in two versions, and what a frame costs in each.

    python -m tests.unchanged 216bff73~ 216bff73        before and after the curves of a loader
    python -m tests.unchanged 2b056100~        before the curves of a schedule, and the work tree

Each version flies its runs, each configuration for `SECONDS`, in a process of its own. Prints the
runs of both whose records differ, those that a version refuses, and the ratio of the processor time
of a frame.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.support.commands import ROOT

SECONDS = 4.0
ROUNDS = 5  # of the least time, in turn
TIMED = "pull-up-737"
FLY = f"""
import hashlib, json, sys, time
from dataclasses import replace
from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.runfile import read_run
from coupled.resources import shipped_runs

def digest(one):
    record = fly(replace(one, duration_s=min(one.duration_s, {SECONDS})))
    return hashlib.sha256(",".join(record.channels).encode() + record.data.tobytes()).hexdigest()

def seconds(one):
    begun = time.thread_time()
    fly(one)
    return time.thread_time() - begun

found = {{"records": {{}}, "refused": {{}}}}
if "bytes" in sys.argv:
    for name in shipped_runs():
        try:
            found["records"][name] = [digest(one) for one in read_run(name)]
        except InputError as error:
            found["refused"][name] = str(error)
one = read_run("{TIMED}")[0]
frames = 4800
long, short = (replace(one, duration_s=n / one.rig.frame_rate) for n in (frames, 1))
seconds(short)
took = [(seconds(long), seconds(short)) for _ in range({ROUNDS})]
found["frame_s"] = (min(a for a, _ in took) - min(b for _, b in took)) / frames
print(json.dumps(found))
"""


def unpack(commit: str, folder: Path) -> Path:
    """Write a commit's files into a folder."""
    folder.mkdir()
    packed = subprocess.run(
        ["git", "archive", commit], cwd=ROOT, check=True, stdout=subprocess.PIPE
    ).stdout
    subprocess.run(["tar", "-x", "-C", str(folder)], input=packed, check=True)
    return folder


def flown(root: Path, cache: Path, *what: str) -> dict[str, Any]:
    """Return digests of records and refusals of a version, by run, and the seconds of a frame."""
    given = {"PYTHONPATH": str(root), "XDG_CACHE_HOME": str(cache), "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", FLY, *what],
        cwd=root,
        env=os.environ | given,
        check=True,
        stdout=subprocess.PIPE,
    )
    return dict(json.loads(done.stdout))


def main(before: str, after: str | None = None) -> None:
    """Compare two commits, or a commit and the work tree."""
    with TemporaryDirectory() as made:
        folder = Path(made)
        roots = unpack(before, folder / "a"), unpack(after, folder / "b") if after else ROOT
        caches = folder / "cache-a", folder / "cache-b"
        first, second = (flown(*one, "bytes") for one in zip(roots, caches, strict=True))
        times = [(first["frame_s"], second["frame_s"])]
        for _ in range(2):
            again = [flown(*one)["frame_s"] for one in zip(roots, caches, strict=True)]
            times.append((again[0], again[1]))
    records = first["records"], second["records"]
    both = sorted(records[0].keys() & records[1].keys())
    unlike = [name for name in both if records[0][name] != records[1][name]]
    print(f"{len(both) - len(unlike)} of {len(both)} runs have the same bytes.")
    for name in unlike:
        print(f"{name}: differs")
    for version, refused in zip(("before", "after"), (first, second), strict=True):
        for name, problem in refused["refused"].items():
            print(f"{name}, {version}: {problem}")
    a, b = (min(each) for each in zip(*times, strict=True))
    print(f"A frame of {TIMED}: {1e6 * a:.2f} and {1e6 * b:.2f} µs, ratio {b / a:.3f}.")


if __name__ == "__main__":
    main(*sys.argv[1:])
