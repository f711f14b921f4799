"""What a diagnosis tells beyond where and which: the flight again, and what to record next."""

from __future__ import annotations

from collections.abc import Mapping

from coupled.gap.diagnose import Diagnosis
from coupled.gap.flown import closed_loop
from coupled.gap.next_test import in_one_line, next_test
from coupled.record.record import Record


def add_report(whole: Diagnosis, records: Mapping[str, Record]) -> None:
    """Add to a diagnosis, by the first of its records, `closed_loop` and `next_test`.

    `next_tests` holds the tests that were computed, where there are rivals to tell apart.
    """
    first = next(iter(records.values()))
    if whole.choice.steps:
        flown = closed_loop(whole.nominal, whole.improved, whole.control, first)
        if flown is not None:
            whole.found["closed_loop"] = flown
    tests = next_test(whole.nominal, first, whole.control, whole.choice)
    lacking = sorted(
        {
            name
            for found in whole.found["stages"].values()
            if "gap" not in found
            for name in found["missing"]
        }
    )
    if tests:
        whole.found["next_tests"] = tests
    whole.found["next_test"] = in_one_line(tests, lacking)
