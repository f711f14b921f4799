"""The virtual bench: plan readings, and simulate them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import TypedDict, Unpack

from coupled.api.rigs import rig_given
from coupled.arguments import public
from coupled.calibration.bench import NULLS, CalibrationBench, take_readings
from coupled.calibration.calibrate import DEFAULT_RIG
from coupled.calibration.crossforces import crossed_forces
from coupled.calibration.estimate import Instruments, usual_instruments
from coupled.calibration.plan import STRONGEST_N, fewest, stations
from coupled.calibration.readings import Readings
from coupled.calibration.readingsfile import write_readings
from coupled.calibration.readingsplan import ReadingsPlan, plan_readings
from coupled.errors import InputError, nearest, shown_value
from coupled.files import check_target, write_text
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig
from coupled.schema import known_keys


@public
def plan(
    rig: Rig | str | PathLike[str] = DEFAULT_RIG,
    control: ControlName = "column",
    precision: float = 0.05,
    strongest_N: float = STRONGEST_N,
    once: bool = False,
    crossed_N: float = 0.0,
    instruments: Instruments | None = None,
    file: str | PathLike[str] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> ReadingsPlan:
    """Plan the fewest readings that give K with a 95 % interval of ± `precision`, relative.

    `strongest_N` is the largest hand force. `once`: ruler and scale are read once, not again after
    the voltmeter. `crossed_N` is a force of both signs held on each other control. `instruments`
    have default errors unless given. A form to fill in is written to `file`, a CSV. Raises
    InputError if even very many readings do not suffice.

    >>> import coupled
    >>> plan = coupled.plan("report-column", precision=0.05)
    >>> plan.reached.half_width < 0.05
    True
    """
    data, tools = _checked_inputs(rig, control, instruments)
    asked = {"precision": precision, "strongest_N": strongest_N, "crossed_N": crossed_N}
    _check_ranges("coupled.plan", asked)
    target = _csv(file)
    looks = 1 if once else 2
    made = plan_readings(data, control, tools, precision, strongest_N, looks, crossed_N, progress)
    if target is not None:
        write_text(target, made.form())
    return made


RANGES = {
    "precision": (0.001, 1.0),
    "strongest_N": (1.0, 2000.0),
    "crossed_N": (0.0, 2000.0),
    "gradients": (1, 30),
    "deflections": (1, 60),
    "nulls": (0, 50),
}


class ReadingOptions(TypedDict, total=False):
    """Options of the readings."""

    nulls: int
    once: bool
    crossed_N: float
    strongest_N: float
    instruments: Instruments


@public
def bench(
    rig: Rig | str | PathLike[str] = DEFAULT_RIG,
    control: ControlName = "column",
    gradients: int = 5,
    deflections: int = 5,
    *,
    precision: float | None = None,
    seed: int = 0,
    file: str | PathLike[str] | None = None,
    **taking: Unpack[ReadingOptions],
) -> Readings:
    """Simulate calibration readings of a rig by ruler, spring scale and voltmeter.

    `gradients` sets of `deflections` readings each; with `precision`, those of a plan that
    determines K to ± that share. The readings are written to `file`, a CSV. `calibrate` accepts the
    result. Raises InputError if the rig lacks the control.

    Further keywords: `nulls` for S2 (6); `once`, `crossed_N`, `strongest_N` and `instruments` as in
    `plan`.

    >>> import coupled
    >>> readings = coupled.bench("report-column", gradients=3, deflections=3)
    >>> readings
    Readings(9 readings in 3 gradient sets, 6 nulls)
    >>> found = coupled.calibrate(readings, "report-column")
    """
    known_keys(dict(taking), dict.fromkeys(ReadingOptions.__annotations__), "coupled.bench", "")
    data, tools = _checked_inputs(rig, control, taking.get("instruments"))
    asked = {"gradients": gradients, "deflections": deflections, "precision": precision, **taking}
    _check_ranges("coupled.bench", asked)
    target, once = _csv(file), taking.get("once", False)
    strongest_N = taking.get("strongest_N", STRONGEST_N)
    grid = stations(data, control, gradients, deflections, strongest_N)
    if precision is not None:
        planned = fewest(data, control, tools, precision, strongest_N, 1 if once else 2)
        grid = [station for station, count in planned for _ in range(count)]
    others = crossed_forces(data, control, len(grid), taking.get("crossed_N", 0.0))
    nulls = taking.get("nulls", NULLS)
    made = CalibrationBench(data, control, grid, tools, nulls, not once, others)
    readings = take_readings(made, seed)
    if target is not None:
        write_readings(target, readings, control)
    return readings


def _check_ranges(function: str, given: Mapping[str, object]) -> None:
    """Refuse a number outside its range."""
    for name, value in given.items():
        low, high = RANGES.get(name, (-inf, inf))
        if isinstance(value, Real) and not low <= float(value) <= high:
            raise InputError(function, name, f"is {shown_value(value)}; give {low:g} to {high:g}")


def _checked_inputs(
    rig: Rig | str | PathLike[str], control: ControlName, instruments: Instruments | None
) -> tuple[Rig, Instruments]:
    """Return the rig, checked to have the control, and the instruments."""
    data = rig_given(rig)
    data.check_controlled(data.file)
    if control not in data.controls:
        problem = f"the rig has no {control}; {nearest(control, data.controls)}"
        raise InputError(data.place, "controls", problem)
    return data, instruments or usual_instruments(control)


def _csv(file: str | PathLike[str] | None) -> Path | None:
    """Return the path of a CSV file to write, checked."""
    if file is None:
        return None
    path = Path(file)
    if path.suffix.lower() != ".csv":
        raise InputError(path, "file", "ends in .csv")
    check_target(path)
    return path
