"""Flight of an exported script by JSBSim's Python package alone, without this package."""

from __future__ import annotations

import csv
import io
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError

# Written into the folder unchanged: it must run where coupled is not installed.
PROGRAM = '''"""Fly a script of this folder with JSBSim alone, and print its channels as CSV.

    python fly.py scripts/NAME.xml [PROPERTY ...] > NAME.csv

Needs JSBSim's Python package (pip install jsbsim). A row is what stands at the end of a run of
JSBSim; without names, what the systems give.
"""

import pathlib
import re
import sys

import jsbsim


def given(root):
    """Return the properties that the systems of this folder say they give."""
    found = []
    for path in sorted(root.glob("aircraft/*/Systems/coupled-*.xml")):
        text = path.read_text(encoding="utf-8")
        found += re.findall(r"<!-- gives: .*? -->\\s*<fcs_function name=\\"([^\\"]+)\\"", text)
    return found


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    root = pathlib.Path(__file__).resolve().parent
    script = pathlib.Path(sys.argv[1])
    if not script.is_file():
        sys.exit(f"{script}: there is no such file")
    names = sys.argv[2:] or ["simulation/sim-time-sec", *given(root)]
    jsbsim.FGJSBBase().debug_lvl = 0
    fdm = jsbsim.FGFDMExec(str(root))
    try:
        loaded = fdm.load_script(str(script.absolute()))
    except jsbsim.BaseError as error:
        sys.exit(f"{script} does not load: {error}")
    if not loaded:
        sys.exit(f"{script} does not load")
    fdm.disable_input()
    fdm.disable_output()
    if not fdm.run_ic():
        sys.exit(f"{script} does not start")
    known = {line.split(" (")[0] for line in fdm.query_property_catalog("").splitlines()}
    known |= {name.replace("[0]", "") for name in known}
    if unknown := [name for name in names if name.replace("[0]", "") not in known]:
        sys.exit(f"the aircraft has no property {unknown[0]}")
    print(",".join(names))
    going = True
    while going:
        going = fdm.run()
        print(",".join(repr(fdm[name]) for name in names))


if __name__ == "__main__":
    main()
'''
_LONGEST_s = 600.0


def fly_alone(folder: Path, script: str, names: Sequence[str]) -> tuple[NDArray[np.float64], str]:
    """Return a script's flight by JSBSim alone, a row for each run and a column for each name.

    And its messages. `folder` is an exported one. Raises InputError if JSBSim does not fly it.
    """
    # -I: neither this folder nor the user's variables make our package importable.
    command = [sys.executable, "-I", str(folder / "fly.py"), str(folder / script), *names]
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        command,
        capture_output=True,
        encoding="utf-8",
        timeout=_LONGEST_s,
        cwd=folder,
        env=environment,
        check=False,
    )
    lines = done.stdout.splitlines()
    head = ",".join(names)
    if done.returncode != 0 or head not in lines:
        said = " ".join((done.stdout + done.stderr).split())[-300:]
        raise InputError(script, "", f"JSBSim alone does not fly it: {said}")
    at = lines.index(head)
    rows, said_lines = list[str](), lines[:at]
    for line in lines[at + 1 :]:
        (rows if line.count(",") == len(names) - 1 and _is_row(line) else said_lines).append(line)
    table = np.loadtxt(io.StringIO("\n".join(rows)), delimiter=",", ndmin=2)
    said = "\n".join([*said_lines, done.stderr]).strip()
    return np.asarray(table, dtype=float), said


def _is_row(line: str) -> bool:
    try:
        [float(cell) for cell in next(csv.reader([line]))]
    except ValueError:
        return False
    return True
