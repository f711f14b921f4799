"""The result of a diagnosis, with figures that are computed on first use.

Each part (`Part`) is diagnosed alone, since the measured signals cut the chain between them. The
verdict of the whole is that of the part that comes first in the order

    unexplained, ambiguous with a faulty stage, mostly, effect, ambiguous without one, no_gap

so that no effect of one part hides an unexplained stage of another. A part is ambiguous without a
faulty stage if a noise floor hides whether it has a gap; this does not change the verdict on the
gaps of other parts, as within one control. A control that breakout and friction hold does not move,
and is not judged; it changes no verdict on the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from coupled.arguments import public
from coupled.errors import joined
from coupled.gap.chain import STAGES, Part
from coupled.gap.effects.effect import Effect, keys_of
from coupled.gap.effects.library import EFFECTS
from coupled.gap.findings.budget import ChannelShrink, Shrink
from coupled.gap.findings.changed import Comparison
from coupled.gap.findings.curves import Curve, Curves
from coupled.gap.findings.flown import (
    Again,
    ChannelAgain,
    EffectInFlight,
    closed_loop,
    in_flight,
    in_words,
    nearer,
)
from coupled.gap.findings.healthy import Baseline
from coupled.gap.findings.proposal import EffectPower, ProposedTest, in_one_line, next_tests, power
from coupled.gap.findings.result import FORMAT, EffectResult, Findings, Verdict, placed
from coupled.gap.findings.summary import (
    MISFIT,
    NOISE,
    capital,
    filtered_words,
    no_gap_in,
    summary,
)
from coupled.gap.search.case import Case
from coupled.gap.search.found import Alike, Choice
from coupled.gap.signals.output import Output
from coupled.gap.signals.reading import Reading, worth_recording
from coupled.gap.thresholds import CERTAIN
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.results import TableResult, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

COLUMNS = (
    *("control", "effect", "stage", "probability"),
    *("key", "unit", "filed", "found", "low", "high"),
)


@dataclass(frozen=True, kw_only=True)
class Diagnosis(Findings, TableResult):
    """The findings of a diagnosis, and the rig with the effects found (`improved`).

    `parts` are the diagnoses that it consists of: one, or that of each judged control and of the
    airframe. `closed_loop`, `in_flight`, `next_tests` and `power` are computed on first use: each
    takes as long as the diagnosis or longer.
    """

    shrink: Shrink
    nominal: Rig = field(repr=False, compare=False)
    improved: Rig = field(repr=False, compare=False)
    records: Mapping[str, Record] = field(repr=False, compare=False)
    # Channels whose logs were filtered, and the source of their noise floors.
    filtered: Mapping[str, str] = field(default_factory=dict)
    # What of the records is not judged, or judged with changes; a sentence each.
    left_out: tuple[str, ...] = ()
    # Parameters of the effects found that the records determine only together.
    inseparable: tuple[Alike, ...] = ()
    # What of the trim comes from the records or their manifests, in words; empty if nothing.
    trim: str = ""

    def __repr__(self) -> str:
        words: list[str] = [self.verdict]
        for effect in self.effects:
            numbers = (f"{p.key} = {p.found:.4g} {p.unit}".strip() for p in effect.parameters)
            words.append(", ".join((effect.label.replace(" ", "_"), *numbers)))
        return f"Diagnosis({self.nominal.name}, {self.control}: {'; '.join(words)})"

    def to_polars(self) -> pl.DataFrame:
        """Return a row a parameter of the effects found; the units are in the column `unit`."""
        rows = []
        for effect in self.effects:
            head = (self.control_of(effect), effect.name, effect.stage, effect.probability)
            for p in effect.parameters:
                row = (*head, p.key, p.unit, p.filed, p.found, p.found_low, p.found_high)
                rows.append(dict(zip(COLUMNS, row, strict=True)))
        return frame_of(rows, COLUMNS)

    @property
    def parts(self) -> tuple[PartDiagnosis, ...]:
        """The diagnoses of the parts, in the order of the rig's controls."""
        raise NotImplementedError

    @property
    def controls(self) -> tuple[ControlName, ...]:
        """The judged controls, in the order of the rig."""
        return tuple(one.part.control for one in self.parts if one.part.own)

    def control_of(self, effect: EffectResult) -> str | None:
        """Return the control of an effect; None for one of the airframe."""
        return effect.control

    @property
    def curves(self) -> tuple[Curve, ...]:
        """Functions of one signal that describe what no effect explains; no causes."""
        return tuple(one for curved in self._curved for one in curved.found)

    @property
    def shrunk_by_curves(self) -> tuple[ChannelShrink, ...]:
        """RMS of each channel on held-out stretches with the curves; empty without curves."""
        return tuple(one for curved in self._curved for one in curved.shrink)

    @property
    def _curved(self) -> list[Curves]:
        return [part.curved for part in self.parts if part.curved is not None]

    @property
    def credible(self) -> tuple[EffectResult, ...]:
        """The effects of the rig with the curves."""
        return tuple(one for one in self.effects if one.probability >= CERTAIN)

    @property
    def flight_in_words(self) -> str:
        """How the effects change the flight, and which to correct first; nothing without one."""
        credible = [effect.label for effect in self.credible]
        return "" if self.in_flight is None else in_words(self.in_flight, credible)

    @property
    def with_curves(self) -> Rig:
        """The rig with the credible effects and the curves; without curves, the improved rig."""
        rigs = [p.improved if p.curved is None else p.curved.rig for p in self.parts]
        return _joined(rigs, self.parts)

    @cached_property
    def closed_loop_with_curves(self) -> tuple[ChannelAgain, ...] | None:
        """The same as `closed_loop`, of the rig with the curves; None if there are none."""
        if not self._curved:
            return None
        return closed_loop(self.nominal, self.with_curves, self.controls, self._again)

    @property
    def first(self) -> Record:
        """The first record, with which flights and next tests are computed."""
        return next(iter(self.records.values()))

    @cached_property
    def closed_loop(self) -> tuple[ChannelAgain, ...] | None:
        """RMS differences from the record of both rigs flown with its force; None if no effect."""
        if not self.effects:
            return None
        return closed_loop(self.nominal, self.improved, self.controls, self._again)

    @cached_property
    def _again(self) -> Again | None:
        """The simulation with the first record's force."""
        return Again.of(self.nominal, self.controls, self.first)

    @cached_property
    def in_flight(self) -> tuple[EffectInFlight, ...] | None:
        """The change of the flight by each effect, largest first; None without flight or effect."""
        if not self.effects or self._again is None:
            return None
        every = [(part, effect) for part in self.parts for effect in part.choice.fit.effects]

        def rig_with(kept: Sequence[int]) -> Rig:
            some = [every[i] for i in kept]
            rigs = [part.rig_with([e for of, e in some if of is part]) for part in self.parts]
            return _joined(rigs, self.parts)

        alone = len(self.parts) == 1
        names = [(None if alone else part.part.owner(e.stage), e.name) for part, e in every]
        return in_flight(names, rig_with, self.controls, self._again)

    @property
    def improves(self) -> bool:
        """Whether the improved rig's flight is no further from the record than the filed rig's."""
        return self.closed_loop is None or nearer(self.closed_loop)

    @property
    def improves_with_curves(self) -> bool:
        """Whether the rig with the curves flies no further from the record than the filed rig."""
        flown = self.closed_loop_with_curves if self._curved else self.closed_loop
        return flown is None or nearer(flown)

    @cached_property
    def next_tests(self) -> tuple[ProposedTest, ...]:
        """The tests that would discriminate the first alternatives, best first; empty if none."""
        return tuple(test for part in self.parts for test in part.next_tests)

    @property
    def next_test(self) -> str:
        """What to record next, in a sentence; empty if no record would help."""
        parts = sorted(self.parts, key=lambda part: not part.next_tests)
        return next((part.next_test for part in parts if part.next_test), "")

    @cached_property
    def power(self) -> tuple[EffectPower, ...]:
        """The smallest size of each effect that would have been detected."""
        return tuple(
            replace(one, control=part.part.owner(one.stage))
            for part in self.parts
            for one in part.power
        )

    @cached_property
    def summary(self) -> str:
        """The faults, their sizes, probabilities and shares of the gap, and what to record next."""
        words = {part.control: part.words() for part in self.parts}
        clear = [name for name, one in words.items() if one.startswith(no_gap_in([name]))]
        words |= {name: words[name].removeprefix(no_gap_in([name])).strip() for name in clear}
        said = [self.trim, *(f"{capital(name)}: {one}" for name, one in words.items() if one)]
        said += [no_gap_in(clear)] if clear else []
        said += [self.flight_in_words]
        said += [self.next_test, *self.left_out]
        return " ".join(one for one in said if one)

    @property
    def beside_healthy(self) -> dict[str, Any]:
        """The JSON of the comparison with the healthy machine, by part; empty without one."""
        known = {part.control: part.beside_healthy for part in self.parts}
        return {name: one for name, one in known.items() if one}

    def owned(self, one: EffectResult | EffectInFlight | EffectPower) -> dict[str, Any]:
        """Return the JSON of a result of an effect; with its control, where several are judged."""
        found = one.as_dict()
        return found | {"control": one.control} if len(self.parts) > 1 else found

    @public
    def as_dict(self, with_power: bool = False) -> dict[str, Any]:
        """Return the JSON's content: the keys of the contract, and those of docs/diagnosis.md."""
        found: dict[str, Any] = {
            "format": FORMAT,
            "verdict": self.verdict,
            "controls": list(self.controls),
            "stages": {stage.name: stage.as_dict() for stage in self.stages},
            "effects": [self.owned(effect) for effect in self.effects],
            "rivals": [list(group) for group in self.rivals],
            "budget": {one.stage: one.as_dict() for one in self.budget},
            "budget_95": {one.stage: one.intervals() for one in self.budget},
            "shrink": self.shrink.as_dict(),
            "settings": {one.name: one.factor for one in self.settings if one.value is None},
        }
        found |= {one.name: one.value for one in self.settings if one.value is not None}
        if self._curved:
            found["curves"] = [one.as_dict() for one in self.curves]
            found["shrink"]["with_curves"] = [one.as_dict() for one in self.shrunk_by_curves]
        words = {
            "inseparable": [one.as_dict() for one in self.inseparable],
            "filtered": dict(self.filtered),
            "left_out": list(self.left_out),
            "trim": self.trim,
            "healthy": self.beside_healthy,
        }
        found |= {name: one for name, one in words.items() if one}
        for name in ("closed_loop", "closed_loop_with_curves"):
            flown: tuple[ChannelAgain, ...] | None = getattr(self, name)
            if flown is not None:
                found[name] = {one.channel: one.as_dict() for one in flown}
        if self.in_flight is not None:
            found["in_flight"] = [self.owned(one) for one in self.in_flight]
        if self.next_tests:
            found["next_tests"] = [test.as_dict() for test in self.next_tests]
        found["next_test"] = self.next_test
        if with_power:
            found["power"] = [self.owned(one) for one in self.power]
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class PartDiagnosis(Diagnosis):
    """The diagnosis of one control, or of the airframe alone (`part`)."""

    part: Part
    readers: tuple[Reading, ...] = field(repr=False, compare=False)
    outputs: tuple[Output, ...] = field(repr=False, compare=False)
    choice: Choice = field(repr=False, compare=False)
    baseline: Baseline | None = field(default=None, repr=False, compare=False)
    change: Comparison | None = field(default=None, repr=False, compare=False)
    curved: Curves | None = field(default=None, repr=False, compare=False)

    @property
    def parts(self) -> tuple[PartDiagnosis, ...]:
        """The diagnosis itself."""
        return (self,)

    def control_of(self, effect: EffectResult) -> str | None:
        """Return the control of an effect; None for one of the airframe."""
        return self.part.owner(effect.stage)

    def placed(self, stage: str) -> str:
        """Return the name of a stage among those of all parts."""
        return placed(stage, self.part.owner(stage))

    @property
    def gains(self) -> list[float]:
        """The log evidence lost without each of the effects, in their order."""
        return sorted((step.gain for step in self.choice.steps), reverse=True)

    def rig_with(self, effects: Sequence[Effect]) -> Rig:
        """Return the rig with some of the effects found, and the fitted nuisance parameters."""
        return self._case.with_only(self.choice.fit, effects)

    @cached_property
    def _case(self) -> Case:
        return Case(self.nominal, self.part.control, self.outputs)

    @cached_property
    def next_tests(self) -> tuple[ProposedTest, ...]:
        """The tests that would discriminate the first alternatives, best first; empty if none."""
        return next_tests(self.nominal, self.first, self.part.control, self.choice)

    @property
    def next_test(self) -> str:
        """What to record next, in a sentence; empty if no record would help."""
        lacking = [
            worth_recording(self.nominal, self.part.control, stage.name, stage.missing)
            for stage in (self.stages if self.nominal.controls else ())
        ]
        wanted = [stage.hidden.wanted for stage in self.stages if stage.hidden is not None]
        return in_one_line(self.next_tests, sorted(set().union(*lacking)), wanted)

    @cached_property
    def power(self) -> tuple[EffectPower, ...]:
        """The smallest size of each effect that would have been detected."""
        library = [effect for effect in EFFECTS if self.part.frees(keys_of([effect]))]
        root = self.choice.without_effects.rig
        return power(root, self.part.control, self.outputs, library)

    @cached_property
    def summary(self) -> str:
        """The faults, their sizes, probabilities and shares of the gap, and what to record next."""
        said = (self.trim, self.words(self.flight_in_words, self.next_test), *self.left_out)
        return " ".join(words for words in said if words)

    def words(self, flight: str = "", next_test: str = "") -> str:
        """Return the summary's sentences on the part, with those on the flight and a next test."""
        filtered = filtered_words(self.filtered)
        missed = self.baseline is not None and self.baseline.missed
        floor = MISFIT if missed else NOISE
        said = summary(self, self.shrink, flight, filtered, next_test, floor)
        said += "".join(f" Not distinguished: {one.words}." for one in self.inseparable)
        said += "".join(f" {one.sentence}" for one in self.curves)
        if self.curved is not None and self.curved.instead:
            said += f" {self.curved.better_than([one.name for one in self.effects])}"
        held = "" if self.baseline is None else self.baseline.words
        changed = "" if self.change is None else self.change.words
        return " ".join(words for words in (held, changed, said) if words)

    @property
    def beside_healthy(self) -> dict[str, Any]:
        """The JSON of the comparison with the healthy machine; empty without one."""
        if self.baseline is None:
            return {}
        compared = {} if self.change is None else self.change.as_dict()
        return self.baseline.as_dict() | compared


_WORST: tuple[Verdict, ...] = ("unexplained", "ambiguous", "mostly", "effect")


def verdict_of_all(parts: Sequence[Findings]) -> Verdict:
    """Return the verdict on several parts, by the order of the module's docstring."""
    with_gap = {part.verdict for part in parts if part.guilty}
    found = next((verdict for verdict in _WORST if verdict in with_gap), None)
    if found is not None:
        return found
    # Of controls that breakout and friction hold, the structure bends at most.
    still = [any(s.hidden is not None and s.hidden.still for s in part.stages) for part in parts]
    judged = [part for part, held in zip(parts, still, strict=True) if not held] or parts
    return "ambiguous" if any(part.verdict == "ambiguous" for part in judged) else "no_gap"


@dataclass(frozen=True, kw_only=True, repr=False)
class WholeDiagnosis(Diagnosis):
    """The diagnosis of several controls and the airframe, from those of its parts.

    The names of stages are `column.loader`, …, and `airframe`; the faulty ones are listed first.
    """

    each: tuple[PartDiagnosis, ...] = field(repr=False)

    @classmethod
    def of(cls, parts: Sequence[PartDiagnosis], records: Mapping[str, Record]) -> WholeDiagnosis:
        """Return the diagnosis of all parts; the airframe is last, if it is a separate part."""
        stages = [replace(s, name=part.placed(s.name)) for part in parts for s in part.stages]
        stages.sort(key=lambda one: (not one.guilty, STAGES.index(one.name.rpartition(".")[2])))
        pool = [part for part in parts if part.effects] or parts
        widest = max((part.shrink.widest for part in pool), key=lambda one: one.before / one.floor)
        effects = [
            (gain, replace(effect, control=part.part.owner(effect.stage)))
            for part in parts
            for gain, effect in zip(part.gains, part.effects, strict=True)
        ]
        effects.sort(key=lambda one: -one[0])
        return cls(
            control=joined([part.control for part in parts if part.part.own]),
            verdict=verdict_of_all(parts),
            stages=tuple(stages),
            effects=tuple(effect for _, effect in effects),
            rivals=tuple(group for part in parts for group in part.rivals),
            settings=tuple(
                replace(one, name=placed(one.name, part.part.owner(one.stage)))
                for part in parts
                for one in part.settings
            ),
            budget=tuple(
                replace(one, stage=part.placed(one.stage)) for part in parts for one in part.budget
            ),
            shrink=Shrink(widest, tuple(one for part in parts for one in part.shrink.channels)),
            nominal=_joined([part.nominal for part in parts], parts),
            improved=_joined([part.improved for part in parts], parts),
            records=records,
            filtered={name: one for part in parts for name, one in part.filtered.items()},
            left_out=tuple(dict.fromkeys(words for part in parts for words in part.left_out)),
            inseparable=tuple(one for part in parts for one in part.inseparable),
            trim=next((part.trim for part in parts if part.trim), ""),
            each=tuple(parts),
        )

    @property
    def parts(self) -> tuple[PartDiagnosis, ...]:
        """The diagnoses of the controls, and of the airframe."""
        return self.each


def _joined(rigs: Sequence[Rig], parts: Sequence[PartDiagnosis]) -> Rig:
    """Return the rig that has the controls and the aircraft of the parts' rigs."""
    if len(rigs) == 1:
        return rigs[0]
    changes: dict[str, Any] = {}
    for rig, part in zip(rigs, parts, strict=True):
        if part.part.own:
            changes[f"controls.{part.control}"] = rig.controls[part.part.control]
        if part.part.airframe:
            changes["flight"] = rig.flight
    return rigs[-1].changed(changes)
