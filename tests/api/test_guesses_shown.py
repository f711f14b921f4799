"""A result's figure, its display in a notebook and its report name the guesses of its rig."""

from __future__ import annotations

from pathlib import Path

import coupled
from coupled.resources import shipped_rigs
from tests.support.commands import coupled as run

NOTE = "Guesses, not measurements: mass of the column."


def test_displays_name_the_guesses_of_their_rig(tmp_path: Path) -> None:
    text = shipped_rigs()["bench"].read_text(encoding="utf-8")
    guessed = text.replace("travel_m", 'guesses = ["loader.mass_kg"]\ntravel_m', 1)
    (tmp_path / "mine.toml").write_text(guessed, encoding="utf-8")
    for file, named in (("mine.toml", True), (str(shipped_rigs()["bench"]), False)):
        rig = coupled.load_rig(tmp_path / file)
        assert (NOTE in " ".join(rig.plot().get_suptitle().split())) is named
        assert (NOTE in rig._repr_html_()) is named
        rig.report(tmp_path / "r.html")
        assert (NOTE in (tmp_path / "r.html").read_text(encoding="utf-8")) is named


def test_a_calibration_names_the_guesses_that_it_rests_on(tmp_path: Path) -> None:
    assert run(tmp_path, "bench", "-o", "b.csv").returncode == 0
    text = shipped_rigs()["report-column"].read_text(encoding="utf-8")
    guessed = text.replace("travel_m", 'guesses = ["loader.mass_kg"]\ntravel_m', 1)
    (tmp_path / "mine.toml").write_text(guessed, encoding="utf-8")
    done = run(tmp_path, "calibrate", "b.csv", "--rig", "mine.toml", "--report", "r.html")
    assert done.returncode == 0, done.stderr
    assert NOTE in " ".join(done.stderr.split())
    assert NOTE in (tmp_path / "r.html").read_text(encoding="utf-8")
