"""Models whose surfaces have other properties: stabilators, elevons, actuators that are late."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.exporting.write import export
from coupled.flight.airframe import packaged_models
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Doublet
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig

# Two elevons, each with its own command; the rest of the T-37 stays on elevator and ailerons.
ELEVONS = """
    <property value="0">fcs/left-elevon-cmd-norm</property>
    <property value="0">fcs/right-elevon-cmd-norm</property>
    <channel name="elevons">
      <fcs_function name="fcs/mixed-elevator"><function><product><value>0.5</value><sum>
        <property>fcs/left-elevon-cmd-norm</property>
        <property>fcs/right-elevon-cmd-norm</property>
      </sum></product></function><output>fcs/elevator-cmd-norm</output></fcs_function>
      <fcs_function name="fcs/mixed-aileron"><function><product><value>0.5</value><difference>
        <property>fcs/left-elevon-cmd-norm</property>
        <property>fcs/right-elevon-cmd-norm</property>
      </difference></product></function><output>fcs/aileron-cmd-norm</output></fcs_function>
    </channel>
"""
POSITIONS = """
    <channel name="elevon positions">
      <fcs_function name="fcs/left-elevon-pos-deg"><function><product>
        <value>57.29577951308232</value><sum><property>fcs/elevator-pos-rad</property>
        <property>fcs/left-aileron-pos-rad</property></sum></product></function></fcs_function>
      <fcs_function name="fcs/right-elevon-pos-rad"><function><difference>
        <property>fcs/elevator-pos-rad</property>
        <property>fcs/left-aileron-pos-rad</property></difference></function></fcs_function>
    </channel>
"""


def own_t37(folder: Path, edit: Any) -> Path:
    """Return a folder of models with an edited copy of the T-37."""
    shutil.copytree(packaged_models()["T37"] / "T37", folder / "T37")
    path = folder / "T37" / "T37.xml"
    text = edit(path.read_text())
    path.write_text(text)
    return folder


def within_controls(text: str, before: str, after: str) -> str:
    """Return a model's text with components at both ends of its flight controls."""
    begin = re.search(r"<flight_control[^>]*>", text)
    assert begin is not None
    text = text[: begin.end()] + before + text[begin.end() :]
    return text.replace("</flight_control>", after + "</flight_control>")


def flown(rig: Rig) -> Record:
    pull = Doublet(force_N=30.0, half_period_s=0.5, start_s=0.2)
    return fly(Manoeuvre(rig, {"column": pull, "wheel": pull}, 2.0))


def t37(**changes: Any) -> Rig:
    given = {key.replace("__", "."): value for key, value in changes.items()}
    return read_rig(shipped_rigs()["t37"]).changed(given)


def test_a_stabilator_by_other_names_flies_as_the_elevator(tmp_path: Path) -> None:
    def renamed(text: str) -> str:
        for part in ("cmd-norm", "pos-rad", "pos-norm"):
            text = text.replace(f"fcs/elevator-{part}", f"fcs/stabilator-{part}")
        size = "<abs><property>fcs/stabilator-pos-rad</property></abs>"
        text = text.replace("<property>fcs/mag-elevator-pos-rad</property>", size)
        declared = '<property value="0">fcs/stabilator-cmd-norm</property>'
        return within_controls(text, declared, "")

    rig = t37(
        flight__model_folder=str(own_t37(tmp_path, renamed)),
        controls__column__command_property="fcs/stabilator-cmd-norm",
        controls__column__surface_property="fcs/stabilator-pos-rad",
    )
    found, wanted = flown(rig), flown(t37())
    np.testing.assert_array_equal(found.data, wanted.data)
    assert np.ptp(found["elevator_rad"]) > 0.01
    newton = fly(
        Manoeuvre(
            rig.changed({"flight.trim": "newton"}),
            {"column": Doublet(force_N=0.0, half_period_s=0.1)},
            0.1,
        )
    )
    assert np.abs(newton["pitch_rate_rad_per_s"]).max() < 1e-5
    made = export(rig)
    (system,) = [text for at, text in made.files.items() if at.name == "coupled-column.xml"]
    assert b"<output>fcs/stabilator-cmd-norm</output>" in system
    rig.save(tmp_path / "saved.toml")
    assert read_rig(tmp_path / "saved.toml") == rig
    says = r"does not move its elevator at once; .*controls\.column\.surface_property and command_"
    with pytest.raises(InputError, match=says):
        flown(rig.changed({"controls.column.command_property": []}))


def test_elevons_move_with_column_and_wheel_and_are_recorded_by_their_means(
    tmp_path: Path,
) -> None:
    models = own_t37(tmp_path, lambda text: within_controls(text, ELEVONS, POSITIONS))
    commands = ["fcs/left-elevon-cmd-norm", "fcs/right-elevon-cmd-norm"]
    places = ["fcs/left-elevon-pos-deg", "fcs/right-elevon-pos-rad"]
    rig = t37(
        flight__model_folder=str(models),
        controls__column__command_property=commands,
        controls__wheel__command_property=[commands[0], f"-{commands[1]}"],
        controls__column__surface_property=places,
        controls__wheel__surface_property=[places[0], f"-{places[1]}"],
    )
    found, wanted = flown(rig), flown(t37())
    scale = np.ptp(wanted.data, axis=0) + 1e-6
    assert np.max(np.abs(found.data - wanted.data) / scale) < 1e-6
    with pytest.raises(InputError, match=r"column\.command_property: several properties"):
        export(rig)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("surface_property", "fcs/stabilator-pos-rad", "has no property 'fcs/stabilator-pos-rad'"),
        ("surface_property", "fcs/elevator-pos-norm", "is no angle; name a property in rad or deg"),
        ("command_property", "fcs/stab", r"column\.command_property: T37 has no property"),
        ("command_property", "elevator", "should be a JSBSim property"),
        ("surface_property", [], ""),
    ],
)
def test_a_name_that_the_model_lacks_is_one_line(key: str, value: Any, says: str) -> None:
    if not says:
        assert t37(**{f"controls__column__{key}": value}) == t37()
        return
    with pytest.raises(InputError, match=says):
        flown(t37(**{f"controls__column__{key}": value}))


READS = """
    <channel name="what FlightGear has">
      <fcs_function name="fcs/of-flightgear"><function><sum>
        <property>/controls/flight/spoilers</property>
        <property>systems/electrical/volts</property>
      </sum></function></fcs_function>
    </channel>
"""


@pytest.mark.slow
def test_properties_of_flightgear_are_listed_and_made_from_the_rig(tmp_path: Path) -> None:
    rig = t37(flight__model_folder=str(own_t37(tmp_path, lambda t: within_controls(t, READS, ""))))
    names = "/controls/flight/spoilers, systems/electrical/volts; give each a value in fl"
    with pytest.raises(InputError, match=rf"flight\.properties: T37 reads .* does: {names}"):
        flown(rig)
    one = rig.changed({"flight.properties": {"systems/electrical/volts": 28.0}})
    with pytest.raises(InputError, match="does: /controls/flight/spoilers; give each"):
        flown(one)
    values = {"systems/electrical/volts": 28.0, "/controls/flight/spoilers": 0.5}
    both = rig.changed({"flight.properties": values})
    pull = Doublet(force_N=30.0, half_period_s=0.5)
    record = fly(Manoeuvre(both, {"column": pull}, 0.5, record_properties=("fcs/of-flightgear",)))
    assert set(record["fcs/of-flightgear"].tolist()) == {28.5}
    with pytest.raises(InputError, match="has no property 'no/such'"):
        flown(both.changed({"flight.properties": {**values, "no/such": 1.0}}))


LATE = """<channel name="late"><actuator name="fcs/late"><input>fcs/elevator-cmd-norm</input>
    <delay>0.2</delay><output>fcs/late-cmd-norm</output></actuator></channel>"""


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("part", ["fcs/flap", "gear/gear"])
def test_a_property_that_the_model_sets_itself_is_refused(
    tmp_path: Path, own: bool, part: str
) -> None:
    """Else the flight would have its flaps up, say, against the rig file."""
    folder = str(own_t37(tmp_path, lambda text: text)) if own else ""
    rig = t37(flight__model_folder=folder)
    says = f"{part}-pos-norm: T37 sets it itself, to [01] in trim; leave it out, or give {part}-cmd"
    with pytest.raises(InputError, match=says):
        flown(rig.changed({"flight.properties": {f"{part}-pos-norm": 0.5}}))


def test_an_actuator_with_a_delay_moves_its_surface_late(tmp_path: Path) -> None:
    def late(text: str) -> str:
        read = "<input>fcs/elevator-cmd-norm</input>"
        assert text.count(read) == 1
        return within_controls(text.replace(read, "<input>fcs/late-cmd-norm</input>"), LATE, "")

    folder = str(own_t37(tmp_path, late))
    rig = t37(flight__model_folder=folder)
    with pytest.raises(InputError, match=r"at once; .* moves it, give direct_controls = false"):
        flown(rig)
    found = flown(rig.changed({"flight.direct_controls": False}))["elevator_rad"]
    wanted = flown(t37())["elevator_rad"]
    rows = round(0.2 * 120) - 1  # JSBSim's actuator is a step early
    np.testing.assert_allclose(found[: rows + 20], found[0], atol=1e-5)
    np.testing.assert_allclose(found[rows + 20 : 100], wanted[20 : 100 - rows], atol=1e-3)
