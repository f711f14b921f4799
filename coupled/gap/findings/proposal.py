"""What would have shown, and what to record next.

An effect shows if its signature raises a stage from its noise floor to its limit. The signature is
first made orthogonal to those of the nuisance parameters. The smallest size is found by bisection.
A deviation within the tolerance of a nuisance parameter is no effect.

The next test would discriminate two alternatives (T-optimal design). Each candidate test is
simulated with one alternative, with noise. Both alternatives are fitted to the simulated record,
since without the fit any test would seem to separate them. The criterion is the log-likelihood gain
of the true one over the other.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.gap.effects.effect import Effect, apply, keys_of, possible, touched, value_of
from coupled.gap.effects.library import EFFECTS
from coupled.gap.effects.settings import settings
from coupled.gap.findings.flown import fly_force
from coupled.gap.findings.othercauses import rests
from coupled.gap.findings.summary import plain
from coupled.gap.noise.noise import rms_of
from coupled.gap.search.case import Case
from coupled.gap.search.evidence import likelier_by
from coupled.gap.search.found import Choice
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Floats, Output, white
from coupled.gap.signals.reading import is_constant
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.stages.tried import lacking_keys
from coupled.gap.thresholds import DOUBLED, FAR, MOST, RIVAL_GAIN, SMALL, FLIGHT_s, PIECE_s
from coupled.record.channels import ControlName, channel, noisy_channels
from coupled.record.record import Record
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class EffectPower:
    """The smallest size of an effect that would have been detected.

    `judged`: its stage can be judged; `shows`: some size within its bounds would be detected.
    """

    name: str
    stage: str
    judged: bool = True
    shows: bool = False
    parameters: tuple[tuple[str, float], ...] = ()
    control: str | None = None  # where several are judged; None for the airframe

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        found: dict[str, Any] = {"name": self.name, "stage": self.stage}
        if not self.judged:
            return found | {"judged": False}
        found["shows"] = self.shows
        return found | ({"parameters": dict(self.parameters)} if self.shows else {})


def power(
    nominal: Rig, control: ControlName, outputs: Sequence[Output], library: Sequence[Effect]
) -> tuple[EffectPower, ...]:
    """Return the smallest detectable size of each effect."""
    lacking, found = lacking_keys(nominal), []
    for effect in library:
        ours = [] if lacking & keys_of([effect]) else touched(outputs, [effect])
        values = _least(Case(nominal, control, ours), effect) if ours else None
        keys = [(p.named(control), effect.value_key(p)) for p in effect.free if p.role != "shape"]
        sizes = () if values is None else tuple((name, values[key]) for name, key in keys)
        found.append(EffectPower(effect.name, effect.stage, bool(ours), values is not None, sizes))
    return tuple(found)


def _values(case: Case, effect: Effect, size: float) -> dict[str, float]:
    """Return the parameters of an effect of a size; at size 1 they are the fit's first start."""
    values = {}
    for p in effect.free:
        start = p.starts[0]
        if p.role == "shape":
            value = start
        elif p.mode == "factor":
            off = size * (start - 1.0)
            value = 1.0 + math.copysign(max(abs(off), p.tolerance), off)
        elif p.is_limit:
            value = start / size
        else:
            key = p.above or p.key
            filed = value_of(case.nominal, case.control, key) if p.mode == "value" else 0.0
            value = float(filed) + size * start
        values[effect.value_key(p)] = float(np.clip(value, p.low, p.high))
    return values


def _signature(case: Case, effect: Effect, size: float) -> float:
    """Return the largest rms signature of an effect in an output, nuisance parameters profiled.

    It is relative to that which raises a residual of noise to the output's limit; 0 if the rig
    cannot have the effect.
    """
    rig = possible(case.nominal, case.control, [effect], _values(case, effect, size))
    if rig is None:
        return 0.0
    largest = 0.0
    for output in case.outputs:
        change = output.residual(rig) - output.residual(case.nominal)
        basis = _settings(case, output, effect)
        if basis.size:
            change = change - basis @ np.linalg.lstsq(basis, change, rcond=None)[0]
        wanted = math.sqrt(output.limit**2 - 1.0)
        largest = max(largest, rms_of(change) / wanted)
    return largest


def _settings(case: Case, output: Output, effect: Effect) -> Floats:
    """Return the signatures of the stage's nuisance parameters, a column each."""
    columns = []
    known = settings(case.nominal, case.control, [output])
    beside = [one for name, one in known.items() if name != effect.name]
    for setting in (*beside, *(case.contact if effect.dry else ())):
        if output.stage in setting.shows_in:
            (number,) = setting.free
            nudge = MOST * (number.high - number.starts[0])
            values = {setting.value_key(number): number.starts[0] + nudge}
            rig = apply(case.nominal, case.control, [setting], values)
            columns.append(output.residual(rig) - output.residual(case.nominal))
    return np.column_stack(columns) if columns else np.empty((0, 0))


def _least(case: Case, effect: Effect) -> dict[str, float] | None:
    """Return the smallest parameters at which an effect is detected; None if at no size."""

    def shows(size: float) -> bool:
        return _signature(case, effect, size) >= 1.0

    if not effect.free:
        return {} if shows(1.0) else None
    high = 1.0
    while not shows(high):
        high *= 10.0
        if high > FAR:
            return None
    low = high / 10.0
    while shows(low):
        low, high = low / 10.0, low
        if low < 1.0 / FAR:
            break
    while high > (1.0 + SMALL) * low:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if shows(middle) else (middle, high)
    return _values(case, effect, high)


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
    """Return the tests that would discriminate the first alternatives found, the best first.

    They are forces up to the record's, which a bench that imposes the motion cannot apply, and
    which show nothing more of a loader that rests in the record.
    """
    step = next((step for step in choice.steps if step.rivals), None)
    if step is None or channel(control, "force") not in record:
        return ()
    if nominal.controls[control].drive != "force":
        return ()
    if step.effect.stage == "loader" and rests(nominal, control, [record]):
        return ()
    rival = step.rivals[0]
    others = tuple(effect for effect in choice.fit.effects if effect is not step.effect)
    channels = noisy_channels(list(nominal.controls), flown=nominal.flight is not None)
    noise = {name: white(record[name]) for name in channels if name in record}
    found = []
    pair = ((*others, rival.effect), (*others, step.effect))
    of_air = all(effect.stage == "airframe" for effects in pair for effect in effects)
    # A fault of the aircraft may show in the motion by any control that the record moves.
    pushed = [c for c in nominal.controls if of_air and _is_pushed(record, c)]
    for test in (test for c in pushed or [control] for test in pushes(nominal, record, c)):
        real = _as_flown(rival.fit.rig, test.rig, control).changed({"noise": noise})
        start = {**rival.fit.values, **choice.fit.values}
        gain = _gain(test, real, control, pair, start, record.channels)
        if gain is not None:
            rivals = (step.effect.name, rival.effect.name)
            found.append(ProposedTest(test.text, rivals, gain))
    return tuple(sorted(found, key=lambda item: -item.gain))


def _is_pushed(record: Record, control: ControlName) -> bool:
    """Tell whether the force on a control is more than noise."""
    force = channel(control, "force")
    return force in record and float(np.std(record[force])) > DOUBLED * white(record[force])


def _as_flown(rig: Rig, test: Rig, control: ControlName) -> Rig:
    """Return the rig in a test's flight condition; parameters of effects in the flight are kept."""
    if test.flight is None:
        return rig
    freed = [p.key for effect in EFFECTS for p in effect.parameters if p.key.startswith("flight.")]
    kept = {key: value_of(rig, control, key) for key in (*freed, "flight.terms")}
    return rig.changed({"flight": test.flight}).changed(kept)


def _gain(
    test: Push,
    real: Rig,
    control: ControlName,
    pair: tuple[tuple[Effect, ...], tuple[Effect, ...]],
    start: dict[str, float],
    recorded: Collection[str],
) -> float | None:
    """Return the gain of the first set over the second on a record simulated with the first.

    It has the `recorded` channels: the user's bench has no other sensors.
    """
    try:
        record = fly_force(real, {test.control: test.force_N}, test.pressure_Pa, seed=5)
    except InputError:
        return None
    if record.manifest["ended_early"]:
        return None
    kept = [k for k, name in enumerate(record.channels) if name in recorded]
    names = tuple(record.channels[k] for k in kept)
    record = replace(record, channels=names, data=record.data[:, kept])
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
    time = np.arange(round(FLIGHT_s * rate)) / rate
    settings = _pressures(nominal, record, control, len(time))
    for text, shape in _shapes(time):
        for where, pressure, rig in settings:
            on = f" on the {control}" if len(nominal.controls) > 1 else ""
            text_of = f"{text} of ±{written} N{on} for {FLIGHT_s:g} s {where}"
            yield Push(text_of.rstrip(), most * shape, pressure, rig, control)


def _shapes(time: Floats) -> list[tuple[str, Floats]]:
    """Return forces that a hand can apply, scaled to ±1, zero at both ends."""
    quiet = np.clip(np.minimum(time, time[-1] - time) / PIECE_s, 0.0, 1.0)
    slow = np.abs(((time / 5.0 + 0.75) % 1.0) * 4.0 - 2.0) - 1.0
    chirp = np.sin(2.0 * np.pi * (0.1 + 0.07 * time) * time)
    holds = np.repeat([1.0, -0.6, 0.3, -1.0, 0.5, 0.0], -(-len(time) // 6))[: len(time)]
    width = max(3, round(PIECE_s / (time[1] - time[0])))
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
    schedule = nominal.controls[control].schedule
    table = schedule.dynamic_pressure
    if nominal.flight is None and is_constant(schedule):
        return [("", level, nominal)]
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
        if best.gain < DOUBLED * RIVAL_GAIN:
            return (
                f"No candidate test discriminates {one} from {other}:"
                " this rig responds alike to both."
            )
        return f"To discriminate {one} from {other}, record {best.text}."
    if wanted:
        return wanted[0]
    if lacking:
        them = "them" if len(lacking) > 1 else "it"
        return f"Also record {', '.join(lacking)}: some stages cannot be judged without {them}."
    return ""
