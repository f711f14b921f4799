"""The error of discretisations of the loader against their rate, all flown by JSBSim.

`python -m tests.export.discretisations` prints the table of docs/export.md. The loader is the
report's column at 12.5 lb/in, compensated, on the bench, under a doublet; the reference is
coupled's flight with the loader at 32.6 kHz. JSBSim's own integrators are its `<pid>` with `rect`
or `trap`, one for δc' and one for δc, with the acceleration of the previous step; `exact` is the
matrix exponential for a force that is constant over a step, as `fcs_function`s.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from coupled.exporting.alone import fly_alone
from coupled.exporting.write import Flown, export, put, script_name
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from tests.support.exported import bench, forces, on_bench

Floats = NDArray[np.float64]
MASS, DAMPING, BEND, GRADIENT = 4.0, 75.0, 9.136e-5, 2189.1
STIFFNESS = GRADIENT / (1.0 - BEND * GRADIENT)
SECONDS = 4.0
TIMES = [0.0, 0.2, 0.3, 1.2, 1.4, 2.5, 2.6, SECONDS]
FORCES = [0.0, 0.0, 80.0, 80.0, -80.0, -80.0, 0.0, 0.0]
RATES_Hz = (120.0, 240.0, 480.0, 960.0, 1920.0)
FRICTION = {"controls.column.loader.friction_N": 8.0, "controls.column.loader.breakout_N": 9.0}


def manoeuvre(rate_Hz: float, changes: dict[str, float]) -> Manoeuvre:
    rig = bench(dict(changes)).changed({"frame_rate_Hz": rate_Hz})
    return on_bench(rig, forces(TIMES, FORCES), SECONDS)


def truth(changes: dict[str, float]) -> tuple[Floats, Floats]:
    """Return time and δc of coupled's flight with the loader at 32.6 kHz.

    It has the highest frame rate of the table: no row is compared with interpolated values.
    """
    fine = manoeuvre(RATES_Hz[-1], changes)
    rig = fine.rig.changed({"loader_rate_Hz": 32640.0})
    record = fly(replace(fine, rig=rig).configured("compensated"))
    return record.time_s, record["column_computed_m"]


def flown(rate_Hz: float, substeps: int, changes: dict[str, float], system: str = "") -> Floats:
    """Return δc at the ends of JSBSim's steps; `system` replaces the exported column."""
    case = manoeuvre(rate_Hz, changes)
    runs = [Flown(case, ("compensated",))]
    made = export(case.rig, runs, rate_Hz=rate_Hz * substeps, check=False)
    files = dict(made.files)
    if system:
        place = next(path for path in files if path.name == "coupled-column.xml")
        declared = re.findall(r"  <property value=.*\n", files[place].decode())
        files[place] = system.replace("DECLARED", "".join(declared)).encode()
    name = script_name(case, "compensated", runs)
    with TemporaryDirectory() as folder:
        put(files, Path(folder))
        table, _ = fly_alone(Path(folder), f"scripts/{name}.xml", ["coupled/column/loader-m"])
    return table[:, 0]


def error(rate_Hz: float, found: Floats, true: tuple[Floats, Floats]) -> float:
    """Return the largest error of δc as a share of the largest δc."""
    times = np.arange(len(found)) / rate_Hz
    inside = times <= true[0][-1]
    wanted = np.interp(times[inside], *true)
    return float(np.max(np.abs(found[inside] - wanted)) / np.max(np.abs(true[1])))


def integrators(kind: str) -> str:
    """Return a system of JSBSim's own integrators."""
    at = "coupled/column"
    force = f"<p>{at}/force-N</p>"
    pull = f"<product><v>{-DAMPING!r}</v><p>{at}/rate</p></product>"
    spring = f"<product><v>{-STIFFNESS!r}</v><p>{at}/loader-m</p></product>"
    return f"""<?xml version="1.0"?>
<system name="coupled column">
DECLARED
  <channel name="loader">
    <fcs_function name="{at}/acceleration"><function>
      <quotient><sum>{force}{pull}{spring}</sum><v>{MASS!r}</v></quotient>
    </function></fcs_function>
    <pid name="{at}/rate"><input>{at}/acceleration</input><kp>0</kp><ki type="{kind}">1</ki></pid>
    <pid name="{at}/loader-m"><input>{at}/rate</input><kp>0</kp><ki type="{kind}">1</ki></pid>
  </channel>
</system>
"""


def exact(rate_Hz: float) -> str:
    """Return a system that steps (δc, δc') by the matrix exponential."""
    matrix = np.array(
        [[0.0, 1.0, 0.0], [-STIFFNESS / MASS, -DAMPING / MASS, 1.0 / MASS], [0.0, 0.0, 0.0]]
    )
    step = expm(matrix / rate_Hz)
    at = "coupled/column"
    rows = []
    for name, row in (("next-m", step[0]), ("next-rate", step[1])):
        terms = zip(row.tolist(), ("loader-m", "rate", "force-N"), strict=True)
        shown = [f"<product><v>{v!r}</v><p>{at}/{n}</p></product>" for v, n in terms]
        rows.append(
            f'<fcs_function name="{at}/{name}"><function><sum>{"".join(shown)}</sum></function>'
            "</fcs_function>"
        )
    for name, source in (("loader-m", "next-m"), ("rate", "next-rate")):
        rows.append(
            f'<fcs_function name="{at}/{name}"><function><p>{at}/{source}</p></function>'
            "</fcs_function>"
        )
    head = (
        '<?xml version="1.0"?>\n<system name="coupled column">\nDECLARED<channel name="loader">\n'
    )
    return head + "\n".join(rows) + "\n</channel></system>\n"


def main() -> None:
    plain, dry = truth({}), truth(FRICTION)
    print("| rate | rect integrators | trap integrators | exact | export, own rate |", end="")
    print(" export | with friction |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for rate_Hz in RATES_Hz:
        substeps = round(rate_Hz / 120.0)
        errors = [
            error(rate_Hz, flown(rate_Hz, 1, {}, integrators("rect")), plain),
            error(rate_Hz, flown(rate_Hz, 1, {}, integrators("trap")), plain),
            error(rate_Hz, flown(rate_Hz, 1, {}, exact(rate_Hz)), plain),
            error(rate_Hz, flown(rate_Hz, 1, {}), plain),
            error(120.0, flown(120.0, substeps, {}), plain),
            error(120.0, flown(120.0, substeps, FRICTION), dry),
        ]
        print(f"| {rate_Hz:g} Hz | " + " | ".join(f"{100.0 * e:.3g} %" for e in errors) + " |")


if __name__ == "__main__":
    main()
