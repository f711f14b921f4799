"""The report of a check: each expectation with its value, bounds and margin."""

from __future__ import annotations

from itertools import groupby

from coupled.campaign.check import CheckResult
from coupled.campaign.verdict import Verdict as Judged
from coupled.campaign.verdict import verdict_line
from coupled.display import System
from coupled.reports.page import Provenance, Report, Section, Verdict
from coupled.tables.campaign import verdict_tables


def check_report(checked: CheckResult, made: Provenance, system: System = "si") -> Report:
    """Return the report: a table per case, in the units of `system`; the verdict lists failures."""
    runs = list(dict.fromkeys(verdict.run for verdict in checked.verdicts))
    groups = groupby(checked.verdicts, key=lambda v: v.run)
    sections = [Section(run, tuple(verdict_tables(list(group), system))) for run, group in groups]
    settings = (("runs", ", ".join(runs)),)
    title = ", ".join(runs) or "Expectations"
    return Report("Check", title, _verdict(checked, system), tuple(sections), settings, made)


def _verdict(checked: CheckResult, system: System) -> Verdict:
    failed = [verdict for verdict in checked.verdicts if not verdict.passed]
    said = f"{checked.total - len(failed)} of {checked.total} expectations hold."
    remarks = [_remark(verdict, system) for verdict in failed]
    return Verdict(said, "bad" if failed else "good", tuple(remarks))


def _remark(verdict: Judged, system: System) -> str:
    where = f"{verdict.run}, {verdict.case}: {verdict.what} [{verdict.configuration}]"
    at = "" if verdict.at_s is None else f", at {verdict.at_s:.4g} s"
    why = f". Why: {verdict.why}" if verdict.why else ""
    return f"{where}: {verdict_line(verdict, system)}{at}{why}"
