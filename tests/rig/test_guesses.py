"""Guesses of a rig: what tables, figures and reports say of them, and when a number is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.authority.compare import compare
from coupled.errors import InputError
from coupled.flight.runfile import manoeuvres_from_table
from coupled.plots.flights import draw_comparison
from coupled.record.channels import unit_of
from coupled.resources import shipped_rigs
from coupled.rig.guesses import guess_note, without_guesses
from coupled.rig.rig import Rig
from coupled.rig.rigedit import differences, edited
from coupled.rig.rigfile import read_rig
from coupled.schema import loads_toml
from tests.support.commands import coupled

BEND = "loader.bend_m_per_N"
GUESSED = f'guesses = ["loader.mass_kg", "{BEND}"]\ntravel_m'
RUN = """
name = "pull"
card = "A pull."
rig = "./mine.toml"
duration_s = 2.0
configurations = ["rigid", "uncompensated"]
bench = { time_s = [0.0], dynamic_pressure_Pa = [3000.0] }
pilot = { column = { kind = "step", force_N = 60.0 } }
[[expect]]
measure = "loss"
configuration = "uncompensated"
most = 0.5
"""


def written(folder: Path) -> Path:
    file = folder / "mine.toml"
    text = shipped_rigs()["bench"].read_text(encoding="utf-8").replace("travel_m", GUESSED, 1)
    file.write_text(text, encoding="utf-8")
    (folder / "pull.toml").write_text(RUN, encoding="utf-8")
    return file


def test_a_note_names_the_weightiest_guess_first(tmp_path: Path) -> None:
    rig = read_rig(written(tmp_path))
    assert guess_note(rig.controls) == "Guesses, not measurements: K and mass of the column."
    varied = [f"controls.column.{BEND}"]
    assert (
        guess_note(rig.controls, ("column",), varied)
        == "Guesses, not measurements: mass of the column."
    )
    assert guess_note(rig.changed({"controls.column.guesses": []}).controls) == ""


def test_a_note_of_three_controls_has_one_and() -> None:
    rig = read_rig(shipped_rigs()["t37"])
    keys = {f"controls.{name}.guesses": [f"travel_{unit_of(name)}"] for name in rig.controls}
    note = guess_note(rig.changed(keys).controls)
    assert note == "Guesses, not measurements: travel of the column, wheel and pedals."


def test_a_guess_that_is_no_number_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path)
    for wrong in ("loader.weight_kg", "loader", "surface", "loader.mass_kg.x"):
        with pytest.raises(InputError, match=r"controls\.column\.guesses: .* is no number"):
            read_rig(file, {"controls.column.guesses": [wrong]})


def test_a_number_that_is_written_anew_is_no_guess(tmp_path: Path) -> None:
    file = written(tmp_path)
    old = read_rig(file)
    new = old.changed({f"controls.column.{BEND}": 1e-4})
    text = edited(file.read_text(encoding="utf-8"), differences(old, new))
    again = loads_toml(text, file)["controls"]["column"]
    assert again["guesses"] == ["loader.mass_kg"]
    assert again["loader"]["bend_m_per_N"] == 1e-4
    settled = without_guesses(new.controls, {f"controls.column.{BEND}"})
    assert settled == {"controls.column.guesses": ["loader.mass_kg"]}


def test_a_comparison_says_what_rests_on_guesses(tmp_path: Path) -> None:
    written(tmp_path)
    table = loads_toml(RUN, tmp_path / "pull.toml")
    flights = compare(manoeuvres_from_table(table, tmp_path / "pull.toml"))
    lost = round(100.0 * flights.loss("uncompensated"))
    said = (
        f"Guesses, not measurements: K and mass of the column. The {lost} % lost depends on them."
    )
    assert lost > 5
    assert said in flights.remarks()
    assert "Guesses" in " ".join(draw_comparison(flights).get_suptitle().split())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "report"),
    [
        (("check", "./pull.toml", "--report", "r.html"), True),
        (("map", "./mine.toml", "-o", "map.svg"), False),
    ],
)
def test_commands_mark_guesses(tmp_path: Path, words: tuple[str, ...], report: bool) -> None:
    written(tmp_path)
    done = coupled(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert "note: Guesses, not measurements: K and mass of the column.\n" in done.stderr
    if report:
        assert "K and mass of the column." in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_a_rig_without_guesses_is_not_marked(tmp_path: Path) -> None:
    rig: Rig = read_rig(shipped_rigs()["t37"])
    assert guess_note(rig.controls) == ""
