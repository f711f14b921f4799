"""JSBSim's models, surveyed: where they trim, what moves them, and a first rig that flies."""

from __future__ import annotations

import json
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from coupled.authority.compare import fly_and_judge
from coupled.errors import InputError
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Step
from coupled.rig.rigfile import read_rig
from coupled.surveying.draft import draft, kind_of
from coupled.surveying.survey import (
    Surveyed,
    chosen_model,
    chosen_models,
    known_models,
    survey,
    surveyed,
)
from tests.support.commands import coupled, files

MODELS = known_models()
SECTIONS = ("loader", "schedule", "compensation")


def test_a_model_that_trims_is_found_with_its_controls_and_rigs() -> None:
    found = survey(chosen_model("T37"), speeds=True)
    assert found.flight is not None
    assert found.holds
    assert found.controls == ("column", "wheel", "pedals")
    assert found.direct
    assert found.rigs == ("report-column", "t37")
    assert found.mass_kg == pytest.approx(4056 * 0.4536, rel=1e-3)  # JSBSim's empty weight
    # It trims from 90 to 320 kt, as was measured by hand; the search goes by tenths.
    assert found.slowest < 50.0
    assert found.fastest > 150.0


@pytest.mark.slow
def test_a_model_that_does_not_trim_has_the_reason() -> None:
    lacking = survey(chosen_model("L17"))
    assert lacking.flight is None
    assert "JSBSim does not create, as FlightGear does: fcs/flaps-pos-deg" in lacking.why
    glider = survey(chosen_model("minisgs"))
    assert "m/s² backwards remain with no more thrust from the throttle" in glider.why


@pytest.mark.slow
def test_a_law_of_the_models_own_is_told_from_direct_controls() -> None:
    found = survey(chosen_model("f16"))
    assert found.controls
    assert not found.direct
    mixed = survey(chosen_model("A320"))
    assert mixed.controls == ("column", "wheel")
    assert mixed.lacking[0].startswith("pedals: moves its rudder by more than the command")


def fly_first_rig(found: Surveyed, folder: Path, models: str = "") -> None:
    """Fly a pull on a drafted rig: it is read, it trims, the nose goes up, at both speeds."""
    file = folder / "first.toml"
    file.write_text(draft(found, "first", models), encoding="utf-8")
    for speed in (found.slowest, found.fastest):
        rig = read_rig(file, {"flight.calibrated_airspeed_m_per_s": speed})
        column = rig.controls["column"]
        pull = Step(force_N=column.loader.breakout + column.loader.friction + 20.0)
        flown = fly_and_judge(Manoeuvre(rig, {"column": pull}, 2.0))
        assert not flown.ended_early, found.model
        assert flown.record["column_deflection_m"][-1] > 0.0
        assert (flown.outcome.peak_rate_rad_per_s or 0.0) > 0.0


def test_a_first_rig_flies(tmp_path: Path) -> None:
    fly_first_rig(survey(chosen_model("F80C"), speeds=True), tmp_path)


TAILS = """
  <channel name="tails">
    <fcs_function name="fcs/left-stab-pos-deg"><function><product><value>57.29577951308232</value>
      <property>fcs/stab-angle</property></product></function></fcs_function>
    <fcs_function name="fcs/right-stab-pos-rad"><function>
      <property>fcs/stab-angle</property></function></fcs_function>
  </channel>
</flight_control>"""


@pytest.mark.slow
def test_a_surface_of_other_names_is_found(tmp_path: Path) -> None:
    """A stabilator of two halves, one in degrees; a tab that moves otherwise is none of them."""
    shutil.copytree(MODELS["T37"] / "T37", tmp_path / "T37")
    file = tmp_path / "T37" / "T37.xml"
    text = file.read_text().replace("fcs/elevator-pos-rad", "fcs/stab-angle")
    file.write_text(text.replace("</flight_control>", TAILS))
    found = survey(chosen_model(str(file)))
    assert found.controls == ("column", "wheel", "pedals") and found.direct
    fly_first_rig(replace(found, slowest=80.0, fastest=120.0), tmp_path, ".")
    text = (tmp_path / "first.toml").read_text()
    assert 'surface_property = ["fcs/left-stab-pos-deg", "fcs/right-stab-pos-rad"]' in text
    half = file.read_text().replace("<value>57.29577951308232</value>", "<value>30</value>")
    file.write_text(half)
    with pytest.raises(InputError, match=r"does not move its elevator within 1 s; .*surface_prop"):
        surveyed("T37", chosen_model(str(file)))


def test_every_guess_of_a_first_rig_is_listed_as_one(tmp_path: Path) -> None:
    found = survey(chosen_model("J3Cub"), speeds=True)
    text = draft(found, "cub")
    assert kind_of(found.mass_kg).name in text
    file = tmp_path / "cub.toml"
    file.write_text(text, encoding="utf-8")
    read_rig(file)
    for control in tomllib.loads(text)["controls"].values():
        tables = {"": control} | {f"{name}.": control[name] for name in SECTIONS}
        numbers = {
            f"{section}{key}"
            for section, table in tables.items()
            for key, value in table.items()
            if type(value) in (float, int, list)
        }
        assert set(control["guesses"]) == numbers - {"guesses", "schedule.dynamic_pressure_Pa"}
    for key in ("altitude_m", "calibrated_airspeed_m_per_s"):
        line = next(line for line in text.splitlines() if line.startswith(key))
        assert "trims" in line, line


def test_the_command_lists_models_and_writes_a_rig(tmp_path: Path) -> None:
    done = coupled(tmp_path, "models", "T37", "L17", "--json", "models.json", columns=200)
    assert done.returncode == 0, done.stderr
    assert "1 of 2 trim, 1 can be flown by a rig" in done.stdout
    first, second = json.loads((tmp_path / "models.json").read_text())
    assert first["trims"]
    assert first["rigs"] == ["report-column", "t37"]
    assert "does not create" in second["why_not"]
    done = coupled(tmp_path, "new", "rig", "OV10", "first.toml")
    assert done.returncode == 0, done.stderr
    assert read_rig(tmp_path / "first.toml").flight is not None


@pytest.mark.slow
def test_a_rig_is_written_for_the_folder_of_a_model(tmp_path: Path) -> None:
    shutil.copytree(MODELS["J3Cub"] / "J3Cub", tmp_path / "mycub")
    (tmp_path / "mycub" / "J3Cub.xml").rename(tmp_path / "mycub" / "mycub.xml")
    done = coupled(tmp_path, "new", "rig", "./mycub")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "mycub.toml").read_text()
    assert 'model = "mycub"' in text
    assert 'model_folder = "."' in text


@pytest.fixture
def variants(tmp_path: Path) -> Path:
    """Return a folder of two models; one has two main files, neither with its folder's name."""
    folder = tmp_path / "hangar"
    shutil.copytree(MODELS["J3Cub"] / "J3Cub", folder / "J3Cub")
    shutil.copytree(MODELS["T37"] / "T37", folder / "Tweet")
    (folder / "Tweet" / "T37.xml").rename(folder / "Tweet" / "t37a.xml")
    shutil.copyfile(folder / "Tweet" / "t37a.xml", folder / "Tweet" / "t37b.xml")
    return folder


def test_a_folder_of_models_is_listed_with_variants(variants: Path) -> None:
    labels = ["J3Cub", "Tweet/t37a", "Tweet/t37b"]
    assert [each.label for each in chosen_models([str(variants)])] == labels
    assert all(each.own and each.path.is_file() for each in chosen_models([str(variants)]))
    with pytest.raises(InputError, match=r"holds 2 models; name the file of one: Tweet/t37a"):
        chosen_model(str(variants / "Tweet"))
    packaged = chosen_model("f22/yf22")
    assert not packaged.own
    assert packaged.path.name == "yf22.xml"
    done = coupled(variants, "models", "Tweet", "--json", "-", columns=200)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [(one["model"], one["trims"], one["rigs"]) for one in found] == [
        ("Tweet/t37a", True, []),
        ("Tweet/t37b", True, []),
    ]


@pytest.mark.slow
def test_a_rig_is_written_for_the_file_of_a_variant(variants: Path) -> None:
    done = coupled(variants, "new", "rig", "Tweet/t37b.xml")
    assert done.returncode == 0, done.stderr
    flight = read_rig(variants / "t37b.toml").flight
    assert flight is not None
    assert (flight.model, flight.model_file) == ("Tweet", "t37b")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("new", "rig", "T73"), "no JSBSim model"),
        (("new", "rig", "L17"), "FlightGear does: fcs/flaps-pos-deg"),
        (("new", "rig", "T37", "rig.txt"), "ends in .toml"),
        (("models", "T73"), "T73: is no JSBSim model and no folder of one"),
        (("models", "."), "is no JSBSim model and no folder of one"),
    ],
)
def test_a_model_that_cannot_be_surveyed_is_refused_in_one_line(
    tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    done = coupled(tmp_path, *words)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert files(tmp_path) == set()


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_every_packaged_model_that_jsbsim_trims_flies_with_a_first_rig(
    model: str, tmp_path: Path
) -> None:
    found = survey(chosen_model(model), speeds=True)
    if found.flight is None:
        assert found.why
    elif found.controls:
        fly_first_rig(found, tmp_path)
    else:
        assert found.lacking
