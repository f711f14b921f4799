"""The decisions: the contents are the headings, and each entry begins with the decision."""

from __future__ import annotations

import re
from pathlib import Path

TEXT = (Path(__file__).parents[1] / "docs" / "decisions.md").read_text(encoding="utf-8")


def anchor(heading: str) -> str:
    """Return the anchor that a forge gives a heading."""
    return re.sub(r"[^a-z0-9 -]", "", heading.lower()).replace(" ", "-")


def test_the_contents_are_the_headings() -> None:
    headings = re.findall(r"^## (.+)$", TEXT, re.MULTILINE)
    assert headings[0] == "Contents"
    listed = re.findall(r"^- \[(.+)\]\(#(.+)\)$", TEXT, re.MULTILINE)
    assert listed == [(heading, anchor(heading)) for heading in headings[1:]]


def test_each_entry_begins_with_the_decision() -> None:
    for section in TEXT.split("\n## ")[2:]:
        for paragraph in section.split("\n\n")[1:]:
            assert paragraph.startswith(("**", "<img")), paragraph[:60]
