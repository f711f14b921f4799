"""The package's prose is the field's: terms that only its makers understood stay out of it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PRIVATE = {"told", "astray", "calm", "guilt", "spare", "whereabouts"}
PRIVATE |= {"belief", "believed", "believes"}
PHRASES = ("stands there twice", "simulation and record part")
TEXTS = [
    *sorted((ROOT / "coupled").rglob("*.py")),
    *sorted((ROOT / "examples").rglob("*.py")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "aircraft").rglob("*.md")),
    *sorted((ROOT / "runs").glob("*.toml")),
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
]


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_private_term_is_left(path: Path) -> None:
    text = path.read_text(encoding="utf-8").lower()
    assert sorted(PRIVATE & set(re.findall(r"[a-z]+", text))) == []
    assert not [phrase for phrase in PHRASES if phrase in " ".join(text.split())]
