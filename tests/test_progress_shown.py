"""Commands that take long say what they do, drawing and planning too."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.commands import coupled


@pytest.mark.parametrize(
    ("module", "words", "says"),
    [
        ("maps", ("map", "bench"), ("column: losses over q̄ and deflection", "drawing the maps")),
        (
            "calibration",
            ("calibrate", "--plan", "--rig", "t37"),
            ("2 gradients by 2 deflections", "the fewest readings that reach it"),
        ),
    ],
)
def test_long_work_says_what_it_does(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    module: str,
    words: tuple[str, ...],
    says: tuple[str, ...],
) -> None:
    said: list[str] = []

    @contextmanager
    def watched(first: str = "") -> Iterator[Callable[[str, int, int], None]]:
        said.append(first)
        yield lambda label, done, total: said.append(label)

    monkeypatch.setattr(f"coupled.cli.{module}.progress", watched)
    done = coupled(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert set(says) <= set(said)
