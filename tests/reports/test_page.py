"""The HTML report: self-contained, complete, and with all names escaped."""

from __future__ import annotations

from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from pypdf import PdfReader

from coupled.plots.saving import svg_text
from coupled.reports.page import (
    Drawing,
    InputFile,
    Provenance,
    Report,
    Section,
    Text,
    Verdict,
    render,
    typeset,
)
from coupled.tables.table import Mark, Table
from tests.support.browser import CHROMIUM, PAPERS, printed

MADE = Provenance(
    "coupled compare x", (("coupled", "1"),), (InputFile("x.toml", "ab12", "name = 1"),)
)
EMPTY_TAGS = {"meta", "br"}


class Page(HTMLParser):
    """A page taken apart: its ids, what it refers to, its words, and whether its tags close."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: Counter[str] = Counter()
        self.refers: list[str] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        if tag not in EMPTY_TAGS:
            self.open.append(tag)
        for name, value in attrs:
            text = value or ""
            if name == "id":
                self.ids[text] += 1
            if name in ("href", "src", "xlink:href", "action", "data"):
                self.refers.append(text)
            self.refers += [part.partition(")")[0] for part in text.split("url(")[1:]]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in EMPTY_TAGS:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def drawn(color: str = "red") -> Drawing:
    figure = Figure(figsize=(4, 3))
    axes = figure.subplots(1, 2)
    axes[0].plot([0, 1, 2], [0, 4, 1], "o-", color=color, label="a")
    axes[1].imshow([[0, 1], [2, 3]])
    axes[0].legend()
    return Drawing(svg_text(figure), "A line and an image")


def report_of(word: str = "x") -> Report:
    table = Table(("what", "N"), ((word, "1.5"), ("  of it", "-0.5"), ("is", Mark("FAIL", "bad"))))
    sections = (
        Section(word, (Text((word,)), table, drawn())),
        Section("second", (drawn("blue"), drawn("red")), own_page=True),
    )
    return Report("Kind", word, Verdict(word, "good", (word,)), sections, (("rig", word),), MADE)


def test_the_page_is_self_contained() -> None:
    text = render(report_of())
    page = Page(text)
    assert not page.open
    assert page.tags["svg"] == 3
    assert page.tags["script"] == page.tags["link"] == page.tags["iframe"] == 0
    inside = [target for target in page.refers if target.startswith("#")]
    assert len(inside) > 10
    assert {target[1:] for target in inside} <= set(page.ids)
    assert max(page.ids.values()) == 1
    beside = [target for target in page.refers if not target.startswith("#")]
    assert len(beside) == 3
    assert all(target.startswith("data:image/png;base64,") for target in beside)
    assert "@import" not in text


def test_verdict_comes_first_and_the_command_is_there() -> None:
    page = Page(render(report_of("What it says")))
    words = [word.strip() for word in page.words if word.strip()]
    assert words.index("What it says") < words.index("N")
    assert "coupled compare x" in words
    assert "ab12" in words
    assert "name = 1" in words


def test_the_same_report_gives_the_same_bytes() -> None:
    assert render(report_of()) == render(report_of())


@pytest.mark.slow
@given(st.text(max_size=30))
def test_no_name_acts_on_the_page(word: str) -> None:
    plain = Page(render(_words_only("x")))
    page = Page(render(_words_only(f"</style><script>{word}")))
    assert page.tags == plain.tags
    assert not page.open


def _words_only(word: str) -> Report:
    table = Table((word,), ((word,), (Mark(word, "good"),)), caption=word)
    made = Provenance(word, ((word, word),), (InputFile(word, word, word),))
    section = Section(word, (Text((word,)), table))
    return Report(word, word, Verdict(word, "bad", (word,)), (section,), ((word, word),), made)


@pytest.mark.parametrize(
    ("plain", "set_"),
    [
        ("-0.5 N", "−0.5\u00a0N"),
        ("5.1 to 20.0 %, x", "5.1 to 20.0\u00a0%, x"),
        ("1.95e-4 m/N", "1.95e-4\u00a0m/N"),
        ("737-200, rows 2-6", "737-200, rows 2-6"),
        ("3 sides of 4 nets", "3 sides of 4 nets"),
    ],
)
def test_numbers_are_typeset(plain: str, set_: str) -> None:
    assert typeset(plain) == set_


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")
@pytest.mark.parametrize("paper", PAPERS)
def test_a_browser_prints_it_and_asks_for_nothing(paper: str, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_text(render(report_of("What it says")), encoding="utf-8")
    pdf, said = printed(file, paper)
    assert said == []
    pages = PdfReader(pdf).pages
    assert [round(float(size)) for size in pages[0].mediabox[2:]] == list(PAPERS[paper])
    assert "What it says" in (pages[0].extract_text() or "")
    assert "second" in (pages[1].extract_text() or "")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")
def test_the_browser_test_detects_a_request(tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    text = render(report_of()).replace("</main>", '<img src="http://127.0.0.1:9/x.png"></main>')
    file.write_text(text, encoding="utf-8")
    _, said = printed(file, "A4")
    assert "Content Security Policy" in said[0]
