"""Diagnoses of trials with and without a rule, kept in files, and the loss without it."""

from __future__ import annotations

import importlib
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest
from scipy.stats import t as student

from coupled.blind.trials.answers import Answer, read_answers
from coupled.blind.trials.key import Key
from coupled.files import json_text, write_text
from coupled.gap.batch import Job, made_by
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.result import FORMAT
from coupled.gap.search.descent import WHOLE, Descent
from coupled.gap.search.evidence import Evidence
from coupled.gap.search.found import Fit
from coupled.gap.search.problem import ModelError, Problem
from coupled.gap.signals.output import stage_gaps, stage_limits
from coupled.record.record import Record, read_record
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.rules import RULES, Rule, patched, watched, without
from tests.support.trials import is_right

WITH = "with-all"  # the folder of the answers by all rules


@dataclass
class Known:
    """The shared data of one record's runs: records, searches, fits, signatures, noise floors.

    `saved_s` is the CPU time saved by reuse. Nothing is added once it is `closed`. Keys refer to
    objects that are kept alive, so that no id is used twice.
    """

    made: dict[Any, tuple[Any, float, Any]] = field(default_factory=dict)
    saved_s: float = 0.0
    closed: bool = False

    def of(self, key: Any, objects: Any, make: Callable[[], Any]) -> Any:
        """Return the stored value of a key, or compute it; the key has the ids of `objects`."""
        if key in self.made:
            value, took_s, _ = self.made[key]
            self.saved_s += took_s
            return value
        start_s = self.clock_s
        value = make()
        if not self.closed:
            self.made[key] = value, self.clock_s - start_s, objects
        return value

    @property
    def clock_s(self) -> float:
        """CPU time without reuse, s."""
        return time.process_time() + self.saved_s


def _key_of(fit: Fit | None) -> Any:
    """Return the identity of a fit."""
    return None if fit is None else (fit.effects, tuple(fit.values.items()))


@contextmanager
def shared(known: Known, searched: bool) -> Iterator[None]:
    """Share data between one record's runs in this context, with the search if `searched`.

    Shared values depend on their arguments only.
    """
    beam = importlib.import_module("coupled.gap.search.beam")
    screen = importlib.import_module("coupled.gap.search.screen").Screen
    case_class = importlib.import_module("coupled.gap.search.case").Case
    module = importlib.import_module("coupled.gap.diagnose")
    plain_fit, plain_signatures = Problem.fit, screen._signatures
    plain_prepare, plain_search = module.prepare, module.search
    plain_evidence, plain_noise = beam.evidence, case_class.with_lower_noise
    plain_colour, plain_shots = case_class.without_colour_allowance, vars(case_class)["by_shots"]

    def fit(
        self: Problem,
        effects: Any,
        start: Mapping[str, float] | None = None,
        parent: Fit | None = None,
        descent: Descent = WHOLE,
        near: Fit | None = None,
        part: Any = "all",
    ) -> Fit:
        begun = tuple(sorted((start or {}).items()))
        nuisances = tuple(self.beside(effects))
        key = (
            *("fit", id(self.case), tuple(effects), nuisances, begun, descent.steps, descent.most),
            *(part, _key_of(parent), _key_of(near)),
        )
        made: Fit = known.of(
            key,
            self.case,
            lambda: plain_fit(self, effects, start, parent, descent, near, part),
        )
        return made

    def signatures(self: Any, current: Fit, effect: Any) -> Any:
        key = ("signatures", id(self.problem.case), effect, _key_of(current))
        return known.of(key, self.problem.case, lambda: plain_signatures(self, current, effect))

    def log_evidence(problem: Problem, fitted: Fit, error: ModelError) -> Evidence:
        terms = error.power.tobytes(), error.samples.tobytes()
        key = ("evidence", id(problem.case), id(fitted), *terms)
        made: Evidence = known.of(
            key, (problem.case, fitted), lambda: plain_evidence(problem, fitted, error)
        )
        return made

    def lower_noise(self: Any, rig: Any) -> Any:
        key = ("noise", id(self), id(rig))
        return known.of(key, (self, rig), lambda: plain_noise(self, rig))

    def colour(self: Any, root: Any) -> Any:
        gaps, limits = stage_gaps(self.outputs, root), stage_limits(self.outputs)
        over = tuple(at for at, gap in gaps.items() if gap > limits[at])
        return known.of(("colour", id(self), over), self, lambda: plain_colour(self, root))

    def shots(self: Any) -> Any:
        return known.of(("shots", id(self)), self, lambda: plain_shots.func(self))

    def prepared(rig: Any, records: Any, part: Any, tell: Any, base: Any, *rest: Any) -> Any:
        def make() -> Any:
            return plain_prepare(rig, records, part, tell, base, *rest)

        flight, _ = rest
        return known.of(("prepared", part.name), None, make) if flight is None else make()

    def search(case: Any, library: Any) -> Any:
        if not searched:
            return plain_search(case, library)
        return known.of(("search", id(case)), case, lambda: plain_search(case, library))

    with (
        patched(Problem, "fit", fit),
        patched(screen, "_signatures", signatures),
        patched(beam, "evidence", log_evidence),
        patched(case_class, "with_lower_noise", lower_noise),
        patched(case_class, "without_colour_allowance", colour),
        patched(case_class, "by_shots", property(shots)),
        patched(module, "prepare", prepared),
        patched(module, "search", search),
        # Curves name no cause and do not affect the verdict.
        patched(module, "find_curves", lambda *_: None),
    ):
        yield


@dataclass
class Runs:
    """The runs of one record: with all rules, and without each rule."""

    job: Job
    known: Known = field(default_factory=Known)

    @cached_property
    def read(self) -> tuple[Rig, Record]:
        """The rig and the record."""
        return read_rig(self.job.rig), read_record(self.job.record)

    def diagnosed(self, rule: Rule | None, known: Known, searched: bool) -> dict[str, Any]:
        """Return the JSON of a diagnosis without a rule, and its CPU time, `cpu_s`."""
        rig, record = self.read
        start_s = known.clock_s
        with shared(known, searched), without(rule) if rule is not None else ExitStack():
            found = diagnose(rig, {str(self.job.record): record}, self.job.control, workers=1)
        return {
            "format": FORMAT,
            "record": self.job.name,
            "verdict": found.verdict,
            "stages": {stage.name: stage.as_dict() for stage in found.stages},
            "effects": [found.owned(effect) for effect in found.effects],
            "rivals": [list(group) for group in found.rivals],
            "made": made_by(self.job),
            "cpu_s": known.clock_s - start_s,
        }

    def with_all(self, rules: Sequence[Rule]) -> dict[str, Any]:
        """Return the JSON with all rules, and in `acts` the rules that have an effect."""
        acted = set[str]()
        with watched(rules, acted):
            found = self.diagnosed(None, self.known, searched=True)
        self.known.closed = True
        return found | {"acts": sorted(acted), "watched": [rule.name for rule in rules]}

    def without(self, rule: Rule) -> dict[str, Any]:
        """Return the JSON without a rule."""
        if rule.fresh:
            return self.diagnosed(rule, Known(closed=True), searched=False)
        return self.diagnosed(rule, self.known, searched=rule.after_search)


def run(todo: Sequence[Job], rules: Sequence[Rule], output: Path) -> None:
    """Diagnose records with all rules and without each active rule; store the answers."""
    every = tuple(dict.fromkeys((*RULES, *rules)))
    for number, job in enumerate(todo, 1):
        runs, made = Runs(job), made_by(job)
        base = kept(_place(output, WITH, job), made)
        if base is not None and not {rule.name for rule in rules} <= {*base["watched"]}:
            base = None  # made before one of the rules was added to this tool
        new = [one for one in rules if kept(_place(output, one.name, job), made) is None]
        new = [one for one in new if base is None or one.name in base["acts"]]
        if base is None or any(not one.fresh for one in new):
            _tell(number, todo, "with all rules")
            base = runs.with_all(every)
            _keep(_place(output, WITH, job), base)
        for rule in (one for one in new if one.name in base["acts"]):
            _tell(number, todo, f"without {rule.name}")
            _keep(_place(output, rule.name, job), runs.without(rule))


def _place(output: Path, folder: str, job: Job) -> Path:
    return output / folder / f"{job.name}.json"


def _tell(number: int, todo: Sequence[Job], what: str) -> None:
    print(f"{number}/{len(todo)} {todo[number - 1].name} {what}", file=sys.stderr, flush=True)


def _keep(file: Path, table: Mapping[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, json_text(table, indent=1))


def kept(file: Path, made: Mapping[str, str]) -> dict[str, Any] | None:
    """Return a stored answer of this version and record, or None."""
    if not file.is_file():
        return None
    try:
        table = json.loads(file.read_text(encoding="utf-8"))
    except ValueError:
        return None
    return table if table.get("made") == made else None


def newcombe(both: int, first: int, second: int, neither: int) -> tuple[float, float]:
    """Return the 95 % interval of the difference of two paired shares, first less second.

    `both`, `first`, `second` and `neither` count the pairs in which both, only one or none is
    right. The method is number 10 of Newcombe, Statistics in Medicine 17 (1998), pp. 2635-2650.
    """
    count = both + first + second + neither
    one, other = (both + first) / count, (both + second) / count
    low_1, high_1 = binomtest(both + first, count).proportion_ci(method="wilson")
    low_2, high_2 = binomtest(both + second, count).proportion_ci(method="wilson")
    product = float(both + first) * (second + neither) * (both + second) * (first + neither)
    excess = float(both * neither - first * second)
    excess = max(excess - count / 2.0, 0.0) if excess > 0.0 else excess
    phi = excess / math.sqrt(product) if product > 0.0 else 0.0

    def away(a: float, b: float) -> float:
        return math.sqrt(max(a * a - 2.0 * phi * a * b + b * b, 0.0))

    gap = one - other
    return gap - away(one - low_1, high_2 - other), gap + away(high_1 - one, other - low_2)


def brier(answer: Answer) -> float:
    """Return the sum of (probability - truth)² over the effects of an answer and of its truth."""
    true = answer.truth.names
    stated = {name: effect.probability for name, effect in answer.found.items()}
    names = true | stated.keys()
    return sum((stated.get(name, 0.0) - (name in true)) ** 2 for name in names)


def said(answer: Answer) -> tuple[str, frozenset[str], frozenset[str]]:
    """Return the parts of an answer that are compared."""
    return answer.verdict, frozenset(answer.found), answer.possible


HEAD = "rule|acts|changed|records|with|without|loss, points|95 %|Brier loss|95 %|CPU, s"


def row(rule: Rule, key: Key, todo: Sequence[Job], output: Path) -> str:
    """Return the row of a rule, over the first records that have all their answers."""
    base, other, acts, saved_s = list[str](), list[str](), set[str](), list[float]()
    for job in todo:
        made = made_by(job)
        first = kept(_place(output, WITH, job), made)
        if first is None:
            break
        base.append(job.name)
        if rule.name in first["acts"]:
            second = kept(_place(output, rule.name, job), made)
            if second is None:
                base.pop()
                break
            acts.add(job.name)
            saved_s.append(first["cpu_s"] - second["cpu_s"])
            other.append(job.name)
    if not base:
        return f"{rule.name}: no record has been diagnosed"

    def answers(folder: str, names: Sequence[str]) -> dict[str, Answer]:
        part = replace(key, records={name: key.records[name] for name in names})
        return {one.record: one for one in read_answers(output / folder, part)} if names else {}

    known = answers(WITH, base)
    found = known | answers(rule.name, other)
    pairs = [(is_right(known[name]), is_right(found[name])) for name in base]
    counts = [pairs.count(one) for one in ((True, True), (True, False), (False, True))]
    both, lost, gained = counts
    low, high = newcombe(both, lost, gained, len(pairs) - sum(counts))
    changed = sum(said(known[name]) != said(found[name]) for name in base)
    worse = 100.0 * np.array([brier(found[name]) - brier(known[name]) for name in base])
    few = len(worse) < 2
    half = 0.0 if few else float(student.ppf(0.975, len(worse) - 1) * worse.std(ddof=1))
    half /= math.sqrt(len(worse))
    loss = 100.0 * (lost - gained) / len(pairs)
    cells = [
        *(rule.name, len(acts), changed, len(base), both + lost, both + gained),
        *(f"{loss:.1f}", f"{100.0 * low:.1f} to {100.0 * high:.1f}"),
        *(f"{worse.mean():.2f}", f"{worse.mean() - half:.2f} to {worse.mean() + half:.2f}"),
        "" if rule.after_search or not saved_s else f"{np.mean(saved_s):.1f}",
    ]
    return "|".join(map(str, cells))
