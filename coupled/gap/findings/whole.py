"""The diagnosis of several controls at once, and of the aircraft that they move.

Each part (`Part`) is diagnosed alone, since the measured signals cut the chain between
them. The verdict of the whole is that of the part that comes first in the order

    unexplained, ambiguous with a faulty stage, mostly, effect, ambiguous without one, no_gap

so that no effect of one part hides an unexplained stage of another. A part is ambiguous without a
faulty stage if a noise floor hides whether it has a gap; this does not change the verdict on the
gaps of other parts, as within one control.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from coupled.gap.chain import STAGES
from coupled.gap.findings.budget import Shrink
from coupled.gap.findings.diagnosis import Diagnosis, PartDiagnosis
from coupled.gap.findings.flown import in_words
from coupled.gap.findings.proposal import EffectPower, ProposedTest
from coupled.gap.findings.result import Findings, StageResult, Verdict, placed
from coupled.gap.findings.summary import capital, joined, no_gap_in
from coupled.record.record import Record
from coupled.rig.rig import Rig

_WORST: tuple[Verdict, ...] = ("unexplained", "ambiguous", "mostly", "effect")


def verdict_of_all(parts: Sequence[Findings]) -> Verdict:
    """Return the verdict on several parts, by the rule of this module."""
    with_gap = {part.verdict for part in parts if part.guilty}
    found = next((verdict for verdict in _WORST if verdict in with_gap), None)
    if found is not None:
        return found
    return "ambiguous" if any(part.verdict == "ambiguous" for part in parts) else "no_gap"


@dataclass(frozen=True, kw_only=True)
class WholeDiagnosis(Diagnosis):
    """The diagnosis of several controls and the airframe, from those of its parts.

    The names of stages are `column.loader`, …, and `airframe`; the faulty ones are listed first.
    """

    each: tuple[PartDiagnosis, ...] = field(repr=False)

    __repr__ = Diagnosis.__repr__

    @classmethod
    def of(cls, parts: Sequence[PartDiagnosis], records: Mapping[str, Record]) -> WholeDiagnosis:
        """Return the diagnosis of all parts; the airframe is last, if it is a separate part."""
        stages = [_placed(part, stage) for part in parts for stage in part.stages]
        stages.sort(key=lambda one: (not one.guilty, STAGES.index(one.name.rpartition(".")[2])))
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
                replace(one, stage=placed(one.stage, part.part.owner(one.stage)))
                for part in parts
                for one in part.budget
            ),
            shrink=_shrink(parts),
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

    def joined(self, rigs: Sequence[Rig]) -> Rig:
        """Return the rig that has the controls and the aircraft of the parts' rigs."""
        return _joined(rigs, self.parts)

    @cached_property
    def next_tests(self) -> tuple[ProposedTest, ...]:
        """The tests that would discriminate the first alternatives of each part, best first."""
        return tuple(test for part in self.parts for test in part.next_tests)

    @property
    def next_test(self) -> str:
        """What to record next, in a sentence; a test of alternatives comes first."""
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
        """The faults of each part, and what to record next."""
        words = {part.control: part.words() for part in self.parts}
        clear = [name for name, one in words.items() if one.startswith(no_gap_in([name]))]
        words |= {name: words[name].removeprefix(no_gap_in([name])).strip() for name in clear}
        said = [self.trim, *(f"{capital(name)}: {one}" for name, one in words.items() if one)]
        said += [no_gap_in(clear)] if clear else []
        said += [in_words(self.in_flight)] if self.in_flight is not None else []
        said += [self.next_test, *self.left_out]
        return " ".join(one for one in said if one)

    @property
    def beside_healthy(self) -> dict[str, Any]:
        """The JSON of each part's comparison with the healthy machine; empty without one."""
        known = {part.control: part.beside_healthy for part in self.parts}
        return {name: one for name, one in known.items() if one}


def _placed(part: PartDiagnosis, stage: StageResult) -> StageResult:
    """Return a stage of a part with its name among all stages."""
    return replace(stage, name=placed(stage.name, part.part.owner(stage.name)))


def _joined(rigs: Sequence[Rig], parts: Sequence[PartDiagnosis]) -> Rig:
    """Return the rig that has the controls and the aircraft of the parts' rigs."""
    changes: dict[str, Any] = {}
    for rig, part in zip(rigs, parts, strict=True):
        if part.part.own:
            changes[f"controls.{part.control}"] = rig.controls[part.part.control]
        if part.part.airframe:
            changes["flight"] = rig.flight
    return rigs[-1].changed(changes)


def _shrink(parts: Sequence[PartDiagnosis]) -> Shrink:
    """Return how far the gaps shrink; the widest is that of the parts with effects, if any."""
    pool = [part for part in parts if part.effects] or parts
    widest = max((part.shrink.widest for part in pool), key=lambda one: one.before / one.floor)
    return Shrink(widest, tuple(one for part in parts for one in part.shrink.channels))
