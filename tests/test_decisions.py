"""Each entry of the decisions begins with the decision."""

from __future__ import annotations

from pathlib import Path

TEXT = (Path(__file__).parents[1] / "docs" / "decisions.md").read_text(encoding="utf-8")


def test_each_entry_begins_with_the_decision() -> None:
    for section in TEXT.split("\n## ")[1:]:
        for paragraph in section.split("\n\n")[1:]:
            assert paragraph.startswith(("**", "<img")), paragraph[:60]
