"""The report of a check: each expectation, what was found, and by how much it holds."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from coupled.campaign.check import CheckResult
from coupled.campaign.verdict import Verdict as Judged
from coupled.campaign.verdict import figures, finding, wanted
from coupled.reports.page import Made, Mark, Report, Section, Table, Verdict, passed

_HEADS = ("", "case", "expected of", "configuration", "found", "wanted", "margin")


def check_report(checked: CheckResult, made: Made) -> Report:
    """Return the report: a table a run; what fails is named in the verdict."""
    runs = list(dict.fromkeys(verdict.run for verdict in checked.verdicts))
    groups = groupby(checked.verdicts, key=lambda v: v.run)
    sections = [Section(run, (_table(list(group)),)) for run, group in groups]
    settings = (("runs", ", ".join(runs)),)
    return Report(
        "Check", ", ".join(runs), _verdict(checked.verdicts), tuple(sections), settings, made
    )


def _verdict(verdicts: Sequence[Judged]) -> Verdict:
    failed = [verdict for verdict in verdicts if not verdict.passed]
    said = f"{len(verdicts) - len(failed)} of {len(verdicts)} expectations hold."
    remarks = [f"{v.run}, {v.case}: {v.what} [{v.configuration}]: {finding(v)}" for v in failed]
    return Verdict(said, "bad" if failed else "good", tuple(remarks))


def _table(verdicts: Sequence[Judged]) -> Table:
    return Table(_HEADS, tuple(_row(verdict) for verdict in verdicts), words=4)


def _row(verdict: Judged) -> tuple[str | Mark, ...]:
    mark = passed(verdict.passed)
    if verdict.value is None or verdict.margin is None:
        what = f"{verdict.what}: {verdict.problem}"
        return mark, verdict.case, what, verdict.configuration, "–", wanted(verdict), "–"
    found, margin = figures(verdict)
    numbers = (found, wanted(verdict), margin)
    return mark, verdict.case, verdict.what, verdict.configuration, *numbers
