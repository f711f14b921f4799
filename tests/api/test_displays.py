"""Each result is displayed: a short text, HTML with verdict, tables and figure, a report."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coupled
from coupled.api.display import DISPLAYS
from coupled.display import percent
from coupled.flight.manoeuvre import Manoeuvre
from tests.support.rigs import bench

SLOW = {"AuthorityMap", "Export", "ForceDocument", "NominalFit", "Stability", "Survey"}
SLOW |= {
    "PartDiagnosis",
    "WholeDiagnosis",
    "ModelTerms",
    "CalibrationResult",
    "Comparison",
    "Flight",
    "Readings",
}
SWEEP = {
    "name": "bends",
    "run": "appendix-c",
    "configurations": ["uncompensated"],
    "vary": [{"key": "rig.controls.column.loader.bend_m_per_N", "values": [1e-5, 9e-5]}],
}
PULL = coupled.Clamp(deflection_m=0.02)
SWEEP_10_N = coupled.FrequencySweep(force_N=10, duration_s=6)


@cache
def flight(**others: coupled.Pilot) -> Any:
    sweep = coupled.FrequencySweep(force_N=40, duration_s=6)
    return coupled.fly("t37", column=sweep, **others, duration_s=7)


def made(name: str, folder: Path) -> Any:
    """Return a result of a kind."""
    ways: dict[str, Callable[[], Any]] = {
        "Rig": lambda: coupled.load_rig("t37"),
        "Flight": flight,
        "Record": lambda: flight().record,
        "Comparison": lambda: coupled.compare(
            "bench", column=PULL, duration_s=2, dynamic_pressure_Pa=3000.0
        ),
        "CheckResult": lambda: coupled.check("appendix-c"),
        "SweepResult": lambda: coupled.sweep(SWEEP, workers=1),
        "Readings": lambda: coupled.bench(bench(), gradients=3, deflections=3),
        "CalibrationResult": lambda: coupled.calibrate(made("Readings", folder), bench()),
        "ReadingsPlan": lambda: coupled.plan(bench()),
        "PartDiagnosis": lambda: coupled.diagnose("t37", flight().record),
        "WholeDiagnosis": lambda: coupled.diagnose("t37", flight(wheel=SWEEP_10_N).record),
        "NominalFit": lambda: coupled.fit("t37", flight().record, ["loader.mass_kg"]),
        "AuthorityMap": lambda: coupled.map_authority("bench"),
        "Stability": lambda: coupled.stability("bench"),
        "ForceDocument": lambda: coupled.document("bench"),
        "Survey": lambda: coupled.models(["T37", "L17"]),
        "ModelTerms": lambda: coupled.terms("T37"),
        "Export": lambda: coupled.export("t37", folder / "export", runs=[]),
    }
    return ways[name]()


class Page(HTMLParser):
    """What a page shows, and whether each element is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)
        if tag not in ("meta", "br", "img"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=[pytest.mark.slow] if kind.__name__ in SLOW else [])
        for kind in DISPLAYS
    ],
    ids=lambda kind: kind.__name__,
)
def test_a_result_is_displayed_drawn_and_reported(kind: type, tmp_path: Path) -> None:
    result: Any = made(kind.__name__, tmp_path)
    assert type(result).__name__ == kind.__name__
    text = repr(result)
    assert len(text) < 800
    assert len(text.splitlines()[0]) < 260
    html = result._repr_html_()
    page = Page(html)
    assert page.open == []
    assert 'class="verdict' in html
    assert "table" in page.seen or "svg" in page.seen
    assert len(html) < 3_000_000
    assert not re.search(r"[-−]0(\.0*)?( |&nbsp;|\u00a0)%", html + text)
    # Styles act within the part only, since a notebook is one page.
    css = html.partition("<style>")[2].partition("</style>")[0]
    assert all(rule.strip().startswith(".coupled") for rule in re.findall(r"([^{}]+)\{", css))
    if hasattr(result, "plot"):
        figure = result.plot()
        assert figure.axes
        figure.savefig(tmp_path / "figure.png")
        assert (tmp_path / "figure.png").stat().st_size > 5000
    result.report(tmp_path / "report.html")
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert Page(report.replace("<!DOCTYPE html>", "")).open == []
    assert "What made this" in report
    if hasattr(result, "to_polars"):
        frame = result.to_polars()
        assert frame.columns
        assert list(result.to_pandas().columns) == frame.columns


def test_every_public_result_is_displayed() -> None:
    shown = {kind.__name__ for kind in DISPLAYS}
    for kind in (coupled.Rig, coupled.Record):
        assert kind.__name__ in shown
    assert not hasattr(Manoeuvre, "_repr_html_")


def test_two_displays_on_a_page_share_no_id() -> None:
    rig = coupled.load_rig("bench")
    other = rig.changed({"controls.column.loader.bend_m_per_N": 1e-5})
    ids = [set(re.findall(r'\bid="(c[^"]+)"', each._repr_html_())) for each in (rig, other)]
    assert ids[0]
    assert not ids[0] & ids[1]


def test_names_are_shown_and_do_not_act() -> None:
    rig = coupled.load_rig("bench").changed({"noise": {}})
    record = coupled.Record(("time_s", "<script>x</script>"), np.zeros((2, 2)))
    assert "<script" not in rig._repr_html_()
    with pytest.raises(coupled.InputError):  # nothing of it is a record's channel
        record.plot()


def test_a_report_is_one_html_file(tmp_path: Path) -> None:
    with pytest.raises(coupled.InputError, match=r"ends in \.html"):
        coupled.load_rig("bench").report(tmp_path / "rig.pdf")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_share_that_rounds_to_zero_has_no_sign() -> None:
    assert percent(-1e-9) == "0.0 %"
    assert percent(-0.0012) == "-0.1 %"
    assert percent(0.25, 0) == "25 %"
    flown = flight()
    for loss, said in ((-1e-6, "0.0 %"), (1e-6, "0.0 %"), (-0.002, "-0.2 %")):
        shown = replace(flown, outcome=replace(flown.outcome, loss=loss, felt_ratio=1.0))
        assert f", {said} authority lost" in repr(shown)
        assert f"Authority lost: {said.replace('-', '−').replace(' ', chr(0xA0))};" in (
            shown._repr_html_()
        )
