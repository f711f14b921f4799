"""A draft run for a rig: cases with a pull, written as a commented run file.

The speeds lie between those at which the aircraft trims and responds. The force moves the control a
quarter of its travel beyond breakout and friction, or less if that ends a flight early. The
expected values are those of the flights, rounded outward.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from coupled.authority.compare import fly_and_judge
from coupled.authority.heldcontrol import breakaway_force
from coupled.authority.outcome import Flight
from coupled.errors import InputError, collected, shown
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import Step
from coupled.record.channels import RATE, ControlName
from coupled.rig.equations import specified_force
from coupled.rig.rig import Rig
from coupled.rig.rigwrite import toml_string
from coupled.surveying.survey import known_models, speed_range
from coupled.units import DEGREE_rad, KNOT_m_per_s

_DURATION_s, _START_s, _HELD_s = 6.0, 1.0, 3.0
_SHARE = 0.25  # of the travel, at the gradient that is specified there
_LEAST = 1.2  # times breakout and friction: a smaller force moves no loader for long
_DENSITY_kg_per_m3 = 1.225
_LOST = 0.01  # share of the deflection: the largest loss that a correct compensation has
_SPEED = "flight.calibrated_airspeed_m_per_s"

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class _Case:
    """A case whose rigid and compensated flights are complete; `speed` is 0 on a bench."""

    label: str
    speed: float
    force_N: float
    flights: tuple[Flight, Flight]


def first_run(
    rig: Rig, control: ControlName, word: str, name: str, progress: Progress | None = None
) -> str:
    """Return the text of a run file with a pull on a rig, at several speeds.

    `word` is the rig as the run file names it, and `name` the name of the run. `progress` is called
    with a label, steps done and steps in all. Raises InputError if no case can be flown.
    """
    data = rig.controls[control]
    if data.drive == "setpoint":
        problem = "a setpoint has no loader that a force moves; write the run by hand"
        raise InputError(rig.place, f"controls.{control}.drive", problem)
    said = progress or (lambda what, done, total: None)
    tries = _candidates(rig, control, said)
    cases, refused = [], list[InputError]()
    for done, (label, speed, pressure) in enumerate(tries):
        said(f"flying {label}", done, len(tries))
        with collected(refused):  # no trim at this speed, although its neighbours have one
            case = _case(rig, control, label, speed, pressure)
            if case is not None:
                cases.append(case)
    if not cases:
        if refused:
            raise refused[0]
        what = "speeds" if rig.flight is not None else "forces"
        raise InputError(rig.place, "", f"no pull of {_DURATION_s:g} s flies at any of its {what}")
    return "\n".join([*_head(rig, control, word, name, cases), *_expectations(control, cases), ""])


def _candidates(rig: Rig, control: ControlName, said: Progress) -> list[tuple[str, float, float]]:
    """Return candidates: label, calibrated airspeed, q̄ in Pa; on a bench the schedule's ends."""
    if rig.flight is None:
        pressures = rig.controls[control].schedule.dynamic_pressure
        return [(f"{pressures[-1] / 1000.0:.3g} kPa", 0.0, pressures[-1])]
    said(f"where {rig.flight.model} trims", 0, 1)
    home = Path(rig.flight.folder) if rig.flight.folder else known_models()[rig.flight.model]
    filed = rig.flight.calibrated_airspeed
    slowest, fastest = speed_range(rig.flight, home, tuple(rig.controls))
    speeds = [math.sqrt(slowest * filed), filed, math.sqrt(filed * fastest)]
    apart = [v for k, v in enumerate(speeds) if k == 1 or abs(v / filed - 1.0) > 0.05]
    rounded = [v if v == filed else round(v, 1) for v in apart]
    return [(f"{v / KNOT_m_per_s:.0f} kt", v, 0.5 * _DENSITY_kg_per_m3 * v**2) for v in rounded]


def _case(
    rig: Rig, control: ControlName, label: str, speed: float, pressure_Pa: float
) -> _Case | None:
    """Return a case with the greatest force that can be flown, or None."""
    data = rig.controls[control]
    least = _LEAST * (data.loader.breakout + breakaway_force(data.loader))
    travel = _SHARE * data.pull
    force = float(specified_force(rig, control, pressure_Pa, np.asarray(travel))) + breakaway_force(
        data.loader
    )
    there = rig.changed({_SPEED: speed}) if speed else rig
    bench = None
    if not speed:
        bench = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[pressure_Pa])
    while True:
        rounded = float(f"{max(force, least, 1.0):.2g}")
        flights = []
        for configuration in ("rigid", "compensated"):
            pull = Step(force_N=rounded, start_s=_START_s, duration_s=_HELD_s)
            flown = Manoeuvre(there, {control: pull}, _DURATION_s, bench=bench, label=label)
            flights.append(fly_and_judge(flown.configured(configuration), configuration))
            if flights[-1].ended_early:
                break
        else:
            return _Case(label, speed, rounded, (flights[0], flights[1]))
        if force <= max(least, 1.0):
            return None
        force /= 2.0


def _head(
    rig: Rig, control: ControlName, word: str, name: str, cases: Sequence[_Case]
) -> list[str]:
    first = cases[0]
    where = f"of {rig.flight.model}" if rig.flight is not None else "on the bench"
    card = f"A pull on the {control} {where}, the rig {rig.name}, held for {_HELD_s:g} s."
    lines = [
        f"# A run for {shown(rig.name)}: written by `coupled new run`, each case flown once.",
        "#   coupled compare FILE     flies it rigid, bent, and with each correction",
        "#   coupled check FILE       holds it against the [[expect]] below",
        "# All numbers are SI, and each key ends in its unit. docs/files.md lists every key.",
        "",
        f"name = {toml_string(name)}",
        f"card = {toml_string(card)}",
        f"rig = {toml_string(word)}",
        f"duration_s = {_DURATION_s}",
    ]
    if rig.flight is None:
        pressure = rig.controls[control].schedule.dynamic_pressure[-1]
        lines += ["", "[bench]", "time_s = [0.0]", f"dynamic_pressure_Pa = [{pressure}]"]
    lines += [
        "",
        f"[pilot.{control}]",
        'kind = "step"',
        f"force_N = {first.force_N}          # beyond breakout and friction",
        f"start_s = {_START_s}",
        f"duration_s = {_HELD_s}",
    ]
    if rig.flight is not None:
        lines += ["", "[measure]", "attitude_change_rad = 0.0873   # 5°"]
        for case in cases:
            lines += ["", "[[case]]", f'label = "{case.label}"']
            lines.append(f'rig = {{ "{_SPEED}" = {case.speed} }}')
            if case.force_N != first.force_N:
                lines.append(f'pilot = {{ "{control}.force_N" = {case.force_N} }}')
    return lines


def _expectations(control: ControlName, cases: Sequence[_Case]) -> list[str]:
    """Return the expectations: the loss when compensated, and the motion of the rigid rig."""
    lost = [abs(case.flights[1].outcome.loss) for case in cases]
    lines = []
    if all(map(math.isfinite, lost)):
        most = max(_LOST, math.ceil(100.0 * 1.2 * max(lost)) / 100.0)
        lines += ["", "[[expect]]", 'measure = "loss"               # of the deflection']
        lines += ['configuration = "compensated"', f'most = "{100.0 * most:.0f} %"']
        if most > _LOST:
            lines.append('why = "as flown: the host\'s numbers leave this much"')
    rates = [case.flights[0].outcome.peak_rate_rad_per_s or 0.0 for case in cases]
    if min(rates) > 0.0:
        low, high = 0.5 * min(rates), 2.0 * max(rates)
        lines += ["", "[[expect]]", f'channel = "{RATE[control]}"', 'take = "greatest"']
        lines += ['configuration = "rigid"', f"least = {low:.2g}", f"most = {high:.2g}"]
        flown = f"{min(rates) / DEGREE_rad:.2g} to {max(rates) / DEGREE_rad:.2g} °/s"
        lines.append(f'why = "purpose: the pull turns the aircraft, as flown by {flown}"')
    return lines
