"""Force and friction that depend on another channel of the record, such as a temperature.

The records are of closed forms, or of SciPy's integrator: no stage of the package made them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.gap.chain import Part
from coupled.gap.diagnose import diagnose
from coupled.gap.freed import default_keys
from coupled.gap.nominal import fit_nominal
from coupled.gap.prepare import prepare
from coupled.plots.gapview import View
from coupled.plots.signatures import draw_signature
from coupled.record.channels import unit_at_end
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.hosted import Feel, OtherInputs
from coupled.rig.replay import drive_loader
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support import threecontrols
from tests.support.machines import sprung, sprung_rig
from tests.support.rigs import bench

Floats = NDArray[np.float64]
RATE_Hz, SECONDS = 100.0, 20.0
COLD, CHANNEL, LOADER = 20.0, "motor_temperature_degC", "controls.column.loader."
FORCE, FRICTION = 0.35, -0.12  # N/°C


def temperature(times: Floats) -> Floats:
    """Return the temperature of a motor that warms up while a fan cools it at times, °C."""
    return np.asarray(COLD + 15.0 * -np.expm1(-times / 8.0) + 4.0 * np.sin(0.7 * times))


def rig(numbers: dict[str, Any] | None = None, drive: str = "displacement") -> Rig:
    """Return the rig of a mass on a spring with friction, whose file names the temperature."""
    named = {"regressor": CHANNEL, "regressor_reference": COLD} | (numbers or {})
    changes = {LOADER + key: value for key, value in named.items()}
    return sprung_rig(RATE_Hz).changed(changes | {"controls.column.drive": drive})


def with_channel(record: Record, channel: Floats, name: str = CHANNEL) -> Record:
    return Record((*record.channels, name), np.column_stack((record.data, channel)))


def moved(
    per_degC: float = 0.0, rubs: float = 0.0, dry_N: float = 0.0, size: float = 1.0
) -> Record:
    """Return a record of that mass under an imposed motion, its force in closed form.

    A force of `per_degC` N/°C acts with the pilot's, and dry friction of `dry_N` changes by `rubs`
    N/°C. The temperature is read in units of 1/`size` °C.
    """
    times = np.arange(round(SECONDS * RATE_Hz)) / RATE_Hz
    way, speed, gained = (np.zeros_like(times) for _ in range(3))
    for most, turn in ((0.02, 1.3), (0.01, 4.1), (0.004, 9.7)):
        way += most * (1.0 - np.cos(turn * times))
        speed += most * turn * np.sin(turn * times)
        gained += most * turn**2 * np.cos(turn * times)
    warm = temperature(times) - COLD
    force = 2.0 * gained + 40.0 * speed + 1000.0 * way - per_degC * warm
    force += (dry_N + rubs * warm) * np.sign(speed)
    rng = np.random.default_rng(4)
    force += 0.05 * rng.normal(size=len(times))
    read = size * (COLD + warm + 0.1 * rng.normal(size=len(times)))
    names = ("time_s", "column_force_N", "column_computed_m", CHANNEL)
    return Record(names, np.column_stack((times, force, way, read)))


@pytest.mark.parametrize("size", [pytest.param(1.0, marks=pytest.mark.slow), 1e4])
def test_a_force_that_depends_on_a_channel_is_named_and_measured(size: float) -> None:
    """In any unit of the channel, whose name ends the parameter's."""
    found = diagnose(rig({"regressor_reference": COLD * size}), {"r": moved(FORCE, size=size)})
    assert found.verdict == "effect"
    told = found.as_dict()["effects"][0]
    assert (told["name"], told["stage"]) == ("regressor_force", "loader")
    number = told["parameters"]["force_N_per_degC"]
    assert number["value"] == pytest.approx(FORCE / size, rel=0.02)
    assert number["low"] < FORCE / size < number["high"]
    (part,) = found.parts
    assert "regressor force" in draw_signature(View(part)).subfigs[0].get_suptitle()


def test_a_channel_that_nothing_depends_on_gives_no_effect() -> None:
    found = diagnose(rig(), {"r": moved()})
    assert (found.verdict, found.effects) == ("no_gap", ())


@pytest.mark.slow
@pytest.mark.parametrize("filed_N", [3.0, 0.0])
def test_friction_that_falls_with_a_temperature_is_named_and_measured(filed_N: float) -> None:
    """A mass under a given force, by SciPy; without its friction in the file, both are named."""

    def friction(times: Floats) -> Floats:
        return 3.0 + FRICTION * (temperature(times) - COLD)

    record = sprung(friction, seconds=SECONDS)
    warm = with_channel(record, temperature(record.time_s))
    found = diagnose(rig({"friction_N": filed_N}, "force"), {"r": warm})
    by_name = {effect.name: effect for effect in found.effects}
    assert found.verdict == "effect"
    assert by_name["regressor_friction"].value == pytest.approx(FRICTION, rel=0.1)
    if not filed_N:
        assert sum(effect.stage == "loader" for effect in found.effects) == 2


def test_a_fit_finds_both_from_a_wrong_start() -> None:
    keys = ["loader.regressor_force_N_per_unit", "loader.regressor_friction_N_per_unit"]
    keys += ["loader.friction_N"]
    wrong = {"regressor_force_N_per_unit": -1.0, "regressor_friction_N_per_unit": 0.2}
    start = rig(wrong | {"friction_N": 5.0})
    record = moved(FORCE, FRICTION, dry_N=4.0)
    force, friction, dry = fit_nominal(start, {"r": record}, keys).numbers
    assert force.found == pytest.approx(FORCE, rel=0.02)
    assert friction.found == pytest.approx(FRICTION, rel=0.03)
    assert dry.found == pytest.approx(4.0, rel=0.02)


def test_a_fit_frees_them_if_the_file_names_a_channel() -> None:
    keys = default_keys(rig(), "column", {"loader"})
    assert sum("regressor" in key for key in keys) == 2
    assert not any("regressor" in key for key in default_keys(sprung_rig(), "column", {"loader"}))


def test_effects_of_a_channel_are_tried_only_if_it_is_named_and_changes() -> None:
    def tried(nominal: Rig, record: Record) -> set[str]:
        known = prepare(nominal, {"r": record}, Part("column")).library
        return {effect.name for effect in known if effect.name.startswith("regressor")}

    record, both = moved(), {"regressor_force", "regressor_friction"}
    still = record.data.copy()
    still[:, -1] = COLD
    assert tried(rig(), record) == both
    assert tried(rig(), Record(record.channels, still)) == set()
    assert tried(sprung_rig().changed({"controls.column.drive": "displacement"}), record) == set()


def test_a_record_without_the_channel_is_refused_with_the_nearest_name() -> None:
    other = "motor_temprature_degC"
    record = moved()
    record = Record((*record.channels[:-1], other), record.data)
    with pytest.raises(InputError, match=rf"no channel {CHANNEL}, the regressor.*{other}"):
        diagnose(rig(), {"r.csv": record})
    with pytest.raises(InputError, match=f"no channel {CHANNEL}"):
        fit_nominal(rig(), {"r.csv": record})


def test_a_flight_without_the_channel_is_refused_by_its_file() -> None:
    """The aircraft is judged beside the controls, and none of them is judged before the check."""
    flying = read_rig(shipped_rigs()["c172p"])
    record = threecontrols.flown(flying, {}, 4.0)
    with pytest.raises(InputError, match=rf"^r\.csv: has no channel {CHANNEL}, the regressor"):
        diagnose(flying.changed({"controls.column.loader.regressor": CHANNEL}), {"r.csv": record})


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"regressor": "column_force_N"}, "is a channel of the column itself"),
        ({"regressor": ""}, "letters, digits"),
        ({"regressor": None, "regressor_force_N_per_unit": 1.0}, "needs the name of a channel"),
        ({"regressor": None, "regressor_friction_N_per_unit": 1.0}, "needs the name of a channel"),
    ],
)
def test_a_regressor_that_cannot_be_one_is_refused(numbers: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        rig(numbers)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("motor_temperature_K", "K"), ("fan_rad_per_s", "rad_per_s"), ("load", "load")],
)
def test_the_unit_of_a_channel_ends_its_name(name: str, unit: str) -> None:
    assert unit_at_end(name) == unit


def test_the_loader_balances_the_force_of_a_regressor() -> None:
    """At rest K·x = F + a·(r − r₀); friction of the regressor holds at rest, and never below 0."""
    plain = {"bend_m_per_N": 0.0, "controls.column.compensation.bend_m_per_N": 0.0}
    frames = 1000
    away = OtherInputs(regressor=np.full(frames, 12.0))

    def rest(numbers: dict[str, float]) -> float:
        one = bench({**plain, **numbers, "regressor": CHANNEL})
        nodes = np.full(frames * one.substeps + 1, 40.0)
        flat = np.full(frames, 560.0)
        return float(drive_loader(one, "column", nodes, Feel(flat), np.zeros(frames), away)[0][-1])

    assert rest({"regressor_force_N_per_unit": -0.5}) == pytest.approx(34.0 / 560.0, rel=1e-6)
    held = rest({"friction_N": 2.0, "regressor_friction_N_per_unit": 3.5})  # 44 N in all
    assert held == 0.0
    less = {"friction_N": 2.0, "regressor_friction_N_per_unit": -3.5}
    assert rest(less) == pytest.approx(40.0 / 560.0, rel=1e-4)
