"""The next test: the record that would discriminate two alternatives (T-optimal design).

Each candidate test is simulated with one alternative, with noise. Both alternatives are fitted to
the simulated record, since without the fit any test would seem to separate them. The criterion is
the log-likelihood gain of the true one over the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.gap.effects.effect import Effect, value_of
from coupled.gap.effects.library import EFFECTS
from coupled.gap.findings.flown import fly_force
from coupled.gap.findings.summary import plain
from coupled.gap.search.case import Case
from coupled.gap.search.evidence import likelier_by
from coupled.gap.search.found import Choice
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Output, white
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import PUSHED, SEPARATED_GAIN, TEST_EDGE_s, TEST_s
from coupled.record.channels import ControlName, channel, noisy_channels
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ProposedTest:
    """A test that would discriminate two alternatives, and its log-likelihood gain."""

    text: str
    rivals: tuple[str, str]
    gain: float

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {"words": self.text, "rivals": list(self.rivals), "gain": self.gain}


@dataclass(frozen=True)
class Push:
    """A possible test: its description, its force and q̄ at each frame, its control and rig."""

    text: str
    force_N: Floats
    pressure_Pa: Floats
    rig: Rig
    control: ControlName


def next_tests(
    nominal: Rig, record: Record, control: ControlName, choice: Choice
) -> tuple[ProposedTest, ...]:
    """Return the tests that would discriminate the first alternatives found, the best first."""
    step = next((step for step in choice.steps if step.rivals), None)
    if step is None or channel(control, "force") not in record:
        return ()
    rival = step.rivals[0]
    others = tuple(effect for effect in choice.fit.effects if effect is not step.effect)
    noise = {name: white(record[name]) for name in _noisy(nominal, record)}
    found = []
    pair = ((*others, rival.effect), (*others, step.effect))
    of_air = all(effect.stage == "airframe" for effects in pair for effect in effects)
    # A fault of the aircraft may show in the motion by any control that the record moves.
    pushed = [c for c in nominal.controls if of_air and _is_pushed(record, c)]
    for test in (test for c in pushed or [control] for test in pushes(nominal, record, c)):
        real = _as_flown(rival.fit.rig, test.rig, control).changed({"noise": noise})
        gain = _gain(test, real, control, pair, {**rival.fit.values, **choice.fit.values})
        if gain is not None:
            rivals = (step.effect.name, rival.effect.name)
            found.append(ProposedTest(test.text, rivals, gain))
    return tuple(sorted(found, key=lambda item: -item.gain))


def _is_pushed(record: Record, control: ControlName) -> bool:
    """Tell whether the force on a control is more than noise."""
    force = channel(control, "force")
    return force in record and float(np.std(record[force])) > PUSHED * white(record[force])


def _as_flown(rig: Rig, test: Rig, control: ControlName) -> Rig:
    """Return the rig in a test's flight condition; parameters of effects in the flight are kept."""
    if test.flight is None:
        return rig
    freed = [p.key for effect in EFFECTS for p in effect.parameters if p.key.startswith("flight.")]
    kept = {key: value_of(rig, control, key) for key in (*freed, "flight.terms")}
    return rig.changed({"flight": test.flight}).changed(kept)


def _noisy(rig: Rig, record: Record) -> list[str]:
    channels = noisy_channels(list(rig.controls), flown=rig.flight is not None)
    return [name for name in channels if name in record]


def _gain(
    test: Push,
    real: Rig,
    control: ControlName,
    pair: tuple[tuple[Effect, ...], tuple[Effect, ...]],
    start: dict[str, float],
) -> float | None:
    """Return the gain of the first set over the second on a record simulated with the first."""
    try:
        record = fly_force(real, {test.control: test.force_N}, test.pressure_Pa, seed=5)
    except InputError:
        return None
    if record.manifest["ended_early"]:
        return None
    stages = {effect.stage for effect in pair[0] + pair[1]}
    outputs = list[Output]()
    if stages != {"airframe"}:
        outputs += Reader(test.rig, record, control, surface_points).outputs()
    if "airframe" in stages:
        outputs += airframe_outputs(test.rig, record)
    case = Case(test.rig, control, outputs)
    right, wrong = (Problem(case).fit(effects, start) for effects in pair)
    return likelier_by(outputs, right, wrong)


def pushes(nominal: Rig, record: Record, control: ControlName) -> Iterator[Push]:
    """Yield possible tests: forces up to the record's largest, at its q̄ and at others."""
    most = float(np.max(np.abs(record[channel(control, "force")])))
    if most == 0.0:
        return
    written = f"{most:.0f}" if most >= 10.0 else f"{most:.2g}"
    rate = nominal.frame_rate
    time = np.arange(round(TEST_s * rate)) / rate
    settings = _pressures(nominal, record, control, len(time))
    for text, shape in _shapes(time):
        for where, pressure, rig in settings:
            on = f" on the {control}" if len(nominal.controls) > 1 else ""
            text_of = f"{text} of ±{written} N{on} for {TEST_s:g} s {where}"
            yield Push(text_of, most * shape, pressure, rig, control)


def _shapes(time: Floats) -> list[tuple[str, Floats]]:
    """Return forces that a hand can apply, scaled to ±1, zero at both ends."""
    quiet = np.clip(np.minimum(time, time[-1] - time) / TEST_EDGE_s, 0.0, 1.0)
    slow = np.abs(((time / 5.0 + 0.75) % 1.0) * 4.0 - 2.0) - 1.0
    chirp = np.sin(2.0 * np.pi * (0.1 + 0.07 * time) * time)
    holds = np.repeat([1.0, -0.6, 0.3, -1.0, 0.5, 0.0], -(-len(time) // 6))[: len(time)]
    width = max(3, round(TEST_EDGE_s / (time[1] - time[0])))
    edge = np.hanning(width + 2)
    steps = np.convolve(holds, edge / edge.sum(), mode="same")
    return [
        ("slow triangles", slow * quiet),
        ("a sweep from 0.1 to 3 Hz", chirp * quiet),
        ("steps that are held", steps * quiet),
    ]


def _pressures(
    nominal: Rig, record: Record, control: ControlName, frames: int
) -> list[tuple[str, Floats, Rig]]:
    """Return a test's possible q̄: as recorded, and over the bench's table or at a higher speed."""
    name = "dynamic_pressure_Pa"
    usual = float(np.median(record[name])) if name in record else 0.0
    level = np.full(frames, usual)
    here = [(f"at {usual / 1000.0:.2g} kPa", level, nominal)]
    table = nominal.controls[control].schedule.dynamic_pressure
    if nominal.flight is None and len(table) == 1:
        return here
    if nominal.flight is None:
        whole = np.linspace(table[0], table[-1], frames)
        text = f"while q̄ goes from {table[0] / 1000.0:.2g} to {table[-1] / 1000.0:.2g} kPa"
        return [*here, (text, whole, nominal)]
    faster = {"flight.calibrated_airspeed_m_per_s": 1.2 * nominal.flight.calibrated_airspeed}
    return [*here, ("at 1.2 times the airspeed", level, nominal.changed(faster))]


def in_one_line(
    tests_found: Sequence[ProposedTest], lacking: Sequence[str], wanted: Sequence[str] = ()
) -> str:
    """Return what to record next, in a sentence; empty if no record would help.

    `lacking` are channels, `wanted` sentences on how to raise a stage above its noise floor.
    """
    if tests_found:
        best = tests_found[0]
        one, other = map(plain, best.rivals)
        if best.gain < SEPARATED_GAIN:
            return (
                f"No candidate test discriminates {one} from {other}:"
                " this rig responds alike to both."
            )
        return f"To discriminate {one} from {other}, record {best.text}."
    if wanted:
        return wanted[0]
    if lacking:
        return f"Record {', '.join(lacking)} too: without it stages cannot be judged."
    return ""
