"""The result of a diagnosis, with figures that are computed on first use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from coupled.arguments import public
from coupled.gap.findings.changed import Comparison
from coupled.gap.findings.curves import Curve, Curves
from coupled.gap.findings.flown import Again, ChannelAgain, closed_loop, nearer
from coupled.gap.findings.healthy import Baseline
from coupled.gap.findings.inflight import EffectInFlight, in_flight, in_words
from coupled.gap.findings.inseparable import Alike
from coupled.gap.findings.power import EffectPower, power
from coupled.gap.findings.proposal import ProposedTest, in_one_line, next_tests
from coupled.gap.findings.result import FORMAT, EffectResult, Findings
from coupled.gap.findings.shrink import Shrink
from coupled.gap.findings.summary import MISFIT, NOISE, filtered_words, summary
from coupled.gap.search.case import Case
from coupled.gap.search.found import Choice
from coupled.gap.signals.output import Output
from coupled.gap.signals.reading import worth_recording
from coupled.gap.thresholds import CERTAIN
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.results import TableResult, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

COLUMNS = ("effect", "stage", "probability", "key", "unit", "filed", "found", "low", "high")


@dataclass(frozen=True)
class Diagnosis(Findings, TableResult):
    """The findings of a diagnosis, and the rig with the effects found (`improved`).

    `closed_loop`, `in_flight`, `next_tests` and `power` are computed on first use: each simulates
    the rig and takes as long as the diagnosis or longer.
    """

    control: ControlName
    shrink: Shrink
    nominal: Rig = field(repr=False, compare=False)
    improved: Rig = field(repr=False, compare=False)
    records: Mapping[str, Record] = field(repr=False, compare=False)
    outputs: tuple[Output, ...] = field(repr=False, compare=False)
    choice: Choice = field(repr=False, compare=False)
    baseline: Baseline | None = field(default=None, repr=False, compare=False)
    change: Comparison | None = field(default=None, repr=False, compare=False)
    # Channels whose logs were filtered, and the source of their noise floors.
    filtered: Mapping[str, str] = field(default_factory=dict)
    # What of live records is not judged, or judged with changes; a sentence each.
    left_out: tuple[str, ...] = ()
    # Parameters of the effects found that the records determine only together.
    inseparable: tuple[Alike, ...] = ()
    # The curves beside the effects that are credible; None if there are none.
    curved: Curves | None = field(default=None, repr=False, compare=False)
    # What of the trim comes from the records or their manifests, in words; empty if nothing.
    trim: str = ""

    def __repr__(self) -> str:
        found = "; ".join(
            ", ".join(
                [e.name, *(f"{p.key} = {p.found:.4g} {p.unit}".strip() for p in e.parameters)]
            )
            for e in self.effects
        )
        words = f"{self.verdict}; {found}" if found else self.verdict
        return f"Diagnosis({self.nominal.name}, {self.control}: {words})"

    def to_polars(self) -> pl.DataFrame:
        """Return a row a parameter of the effects found; the units are in the column `unit`."""
        rows = []
        for effect in self.effects:
            head = {"effect": effect.name, "stage": effect.stage, "probability": effect.probability}
            rows += [
                head
                | {"key": p.key, "unit": p.unit, "filed": p.filed, "found": p.found}
                | {"low": p.found_low, "high": p.found_high}
                for p in effect.parameters
            ]
        return frame_of(rows, COLUMNS)

    @property
    def curves(self) -> tuple[Curve, ...]:
        """Functions of one signal that describe what no effect explains; no causes."""
        return () if self.curved is None else self.curved.found

    @property
    def credible(self) -> tuple[EffectResult, ...]:
        """The effects of the rig with the curves."""
        return tuple(one for one in self.effects if one.probability >= CERTAIN)

    @property
    def with_curves(self) -> Rig:
        """The rig with the credible effects and the curves; without curves, the improved rig."""
        return self.improved if self.curved is None else self.curved.rig

    @cached_property
    def closed_loop_with_curves(self) -> tuple[ChannelAgain, ...] | None:
        """The same as `closed_loop`, of the rig with the curves; None if there are none."""
        if self.curved is None:
            return None
        return closed_loop(self.nominal, self.with_curves, self.control, self.first, self._again)

    @property
    def first(self) -> Record:
        """The first record, with which flights and next tests are computed."""
        return next(iter(self.records.values()))

    @cached_property
    def closed_loop(self) -> tuple[ChannelAgain, ...] | None:
        """RMS differences from the record of both rigs flown with its force; None if no effect."""
        if not self.choice.steps:
            return None
        return closed_loop(self.nominal, self.improved, self.control, self.first, self._again)

    @cached_property
    def _again(self) -> Again | None:
        """The simulation with the first record's force."""
        return Again.of(self.nominal, self.control, self.first)

    @cached_property
    def in_flight(self) -> tuple[EffectInFlight, ...] | None:
        """The change of the flight by each effect, largest first; None without flight or effect."""
        if not self.choice.steps or self._again is None:
            return None
        case = Case(self.nominal, self.control, self.outputs)
        return in_flight(case, self.choice.fit, self.control, self._again)

    @property
    def improves(self) -> bool:
        """Whether the improved rig's flight is no further from the record than the filed rig's."""
        return self.closed_loop is None or nearer(self.closed_loop)

    @property
    def improves_with_curves(self) -> bool:
        """Whether the rig with the curves flies no further from the record than the filed rig."""
        if self.curved is None:
            return self.improves
        return self.closed_loop_with_curves is None or nearer(self.closed_loop_with_curves)

    @cached_property
    def next_tests(self) -> tuple[ProposedTest, ...]:
        """The tests that would discriminate the first alternatives, best first; empty if none."""
        return next_tests(self.nominal, self.first, self.control, self.choice)

    @property
    def next_test(self) -> str:
        """What to record next, in a sentence; empty if no record would help."""
        lacking = [
            worth_recording(self.nominal, self.control, stage.name, stage.missing)
            for stage in self.stages
        ]
        wanted = [stage.hidden.wanted for stage in self.stages if stage.hidden is not None]
        return in_one_line(self.next_tests, sorted(set().union(*lacking)), wanted)

    @cached_property
    def power(self) -> tuple[EffectPower, ...]:
        """The smallest size of each effect that would have been detected."""
        return power(self.choice.without_effects.rig, self.control, self.outputs)

    @cached_property
    def summary(self) -> str:
        """The faults, their sizes, probabilities and shares of the gap, and what to record next."""
        flight = "" if self.in_flight is None else in_words(self.in_flight)
        filtered = filtered_words(self.filtered)
        missed = self.baseline is not None and self.baseline.missed
        floor = MISFIT if missed else NOISE
        said = summary(self, self.shrink, flight, filtered, self.next_test, floor)
        said += "".join(f" Not distinguished: {one.words}." for one in self.inseparable)
        said += "".join(f" {one.sentence}" for one in self.curves)
        held = "" if self.baseline is None else self.baseline.words
        changed = "" if self.change is None else self.change.words
        return " ".join(
            words for words in (self.trim, held, changed, said, *self.left_out) if words
        )

    @public
    def as_dict(self, with_power: bool = False) -> dict[str, Any]:
        """Return the JSON's content: the keys of the contract, and those of docs/diagnosis.md."""
        found: dict[str, Any] = {
            "format": FORMAT,
            "verdict": self.verdict,
            "stages": {stage.name: stage.as_dict() for stage in self.stages},
            "effects": [effect.as_dict() for effect in self.effects],
            "rivals": [list(group) for group in self.rivals],
            "budget": {one.stage: one.as_dict() for one in self.budget},
            "budget_95": {one.stage: one.intervals() for one in self.budget},
            "shrink": self.shrink.as_dict(),
            "settings": {one.name: one.factor for one in self.settings if one.yields is None},
        }
        found |= {one.name: one.yields for one in self.settings if one.yields is not None}
        if self.curved is not None:
            found["curves"] = [one.as_dict() for one in self.curves]
            found["shrink"]["with_curves"] = [one.as_dict() for one in self.curved.shrink]
        if self.inseparable:
            found["inseparable"] = [one.as_dict() for one in self.inseparable]
        if self.filtered:
            found["filtered"] = dict(self.filtered)
        if self.left_out:
            found["left_out"] = list(self.left_out)
        if self.trim:
            found["trim"] = self.trim
        if self.baseline is not None:
            compared = {} if self.change is None else self.change.as_dict()
            found["healthy"] = self.baseline.as_dict() | compared
        if self.closed_loop is not None:
            found["closed_loop"] = {again.channel: again.as_dict() for again in self.closed_loop}
        if self.closed_loop_with_curves is not None:
            flown = self.closed_loop_with_curves
            found["closed_loop_with_curves"] = {one.channel: one.as_dict() for one in flown}
        if self.in_flight is not None:
            found["in_flight"] = [one.as_dict() for one in self.in_flight]
        if self.next_tests:
            found["next_tests"] = [test.as_dict() for test in self.next_tests]
        found["next_test"] = self.next_test
        if with_power:
            found["power"] = [one.as_dict() for one in self.power]
        return found
