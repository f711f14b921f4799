"""Verdicts as JUnit XML for build servers: a suite for each run, a test for each expectation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby
from xml.etree import ElementTree

from coupled.campaign.verdict import Verdict, verdict_line

_NO_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_xml(verdicts: Sequence[Verdict]) -> str:
    """Return the XML; an unjudged expectation is an error, a missed bound a failure."""
    root = _element(None, "testsuites", **_counts(verdicts))
    for run, group in groupby(verdicts, key=lambda verdict: verdict.run):
        tests = list(group)
        suite = _element(root, "testsuite", name=run, **_counts(tests))
        for verdict in tests:
            place = f"{run}.{verdict.case}"
            name = f"{verdict.what} [{verdict.configuration}]"
            case = _element(suite, "testcase", classname=place, name=name)
            if not verdict.passed:
                kind = "error" if verdict.problem else "failure"
                _element(case, kind, message=verdict_line(verdict))
            else:
                _element(case, "system-out").text = verdict_line(verdict)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _element(
    parent: ElementTree.Element | None, tag: str, **attributes: str
) -> ElementTree.Element:
    allowed = {key: _NO_XML.sub("?", text) for key, text in attributes.items()}
    if parent is None:
        return ElementTree.Element(tag, allowed)
    return ElementTree.SubElement(parent, tag, allowed)


def _counts(verdicts: Sequence[Verdict]) -> dict[str, str]:
    errors = sum(bool(verdict.problem) for verdict in verdicts)
    failures = sum(not verdict.passed for verdict in verdicts) - errors
    return {"tests": str(len(verdicts)), "failures": str(failures), "errors": str(errors)}
