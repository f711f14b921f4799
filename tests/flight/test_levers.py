"""The levers of a recorded flight move the model's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.levers import Levers
from coupled.gap.checks import trimmed
from coupled.gap.diagnose import diagnose
from coupled.gap.signals.conditions import wrappers_of
from coupled.record.importing.convert import import_log
from coupled.record.levers import lever_channel, levers_of
from coupled.record.record import Record
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.alone import alone, gaps, noisy
from tests.support.ownlogs import PROPERTIES, flown

THRUSTS = ("propulsion/engine/thrust-lbs", "propulsion/engine[1]/thrust-lbs")


@pytest.mark.parametrize(
    ("name", "lever"),
    [
        ("throttle_norm", ("throttle", 0)),
        ("throttle_1_norm", ("throttle", 1)),
        ("fcs/throttle-cmd-norm[1]", ("throttle", 1)),
        ("fcs/flap-pos-norm", ("flap", 0)),
        ("gear/gear-cmd-norm", ("gear", 0)),
        ("fcs/pitch-trim-cmd-norm", None),  # the elevator's position has it
        ("throttle_percent", None),
    ],
)
def test_a_lever_has_its_property_or_its_short_name(
    name: str, lever: tuple[str, int] | None
) -> None:
    assert levers_of(["time_s", name]) == ({} if lever is None else {name: lever})


def test_a_command_goes_before_the_position_that_follows_it() -> None:
    names = ("fcs/flap-pos-norm", "fcs/flap-cmd-norm")
    assert [*levers_of(names)] == ["fcs/flap-cmd-norm"]
    assert [lever_channel(name) for name in names] == ["flap_norm"] * 2


@pytest.mark.parametrize(
    ("recorded", "moves"),
    [
        (("throttle_norm",), (True, True)),
        (("throttle_0_norm", "throttle_1_norm"), (True, False)),
    ],
)
def test_one_throttle_moves_all_engines_and_several_their_own(
    recorded: tuple[str, ...], moves: tuple[bool, bool]
) -> None:
    cut = np.linspace(0.9, 0.4, 240)
    positions = dict(zip(recorded, (cut, np.full(240, 0.9)), strict=False))
    flight = read_rig(shipped_rigs()["737"]).flight
    assert flight is not None
    made = make_aircraft(
        flight,
        1.0 / 120.0,
        ["column"],
        [aircraft_folder()],
        record=THRUSTS,
        conditions=[Levers(positions, 1.0)],
    )
    before = made.extra()
    for _ in range(240):
        made.step((0.0, 0.0, 0.0))
    less = [after < 0.8 * then for after, then in zip(made.extra(), before, strict=True)]
    assert tuple(less) == moves


def test_a_throttle_at_rest_is_that_of_its_engine() -> None:
    """Only those that move were passed on, and one that moves alone moved all engines."""
    time_s = np.arange(480) / 120.0
    cut = np.interp(time_s, [1.0, 2.0], [0.9, 0.4])
    channels = ("time_s", "throttle_norm", "throttle_1_norm")
    record = Record(channels, np.column_stack((time_s, cut, np.full(480, 0.9))))
    flight = read_rig(shipped_rigs()["737"]).flight
    assert flight is not None
    acting = wrappers_of(record, 1.0 / 120.0)
    folders = [aircraft_folder()]
    made = make_aircraft(
        flight, 1.0 / 120.0, ["column"], folders, record=THRUSTS, conditions=acting
    )
    before = made.extra()
    for _ in range(480):
        made.step((0.0, 0.0, 0.0))
    first, second = (after / then for after, then in zip(made.extra(), before, strict=True))
    assert first < 0.8
    assert second == pytest.approx(1.0, abs=0.05)


def stepped(at_s: float, by: float) -> Callable[[float], float]:
    return lambda time_s: by * min(max(2.0 * (time_s - at_s), 0.0), 1.0)


def log(
    folder: Path,
    lever: str,
    by: float,
    length_s: float = 8.0,
    rate_Hz: float = 120.0,
    clp: float = 1.0,
) -> Record:
    """Return the record of a log of bare JSBSim in which a lever moves."""
    made, _ = flown(
        folder,
        {"/Clp": clp},
        length_s,
        rate_Hz=rate_Hz,
        properties=(*PROPERTIES, lever),
        levers={lever: stepped(3.0, by)},
    )
    return noisy(import_log(made)[0])


@pytest.mark.parametrize(
    ("lever", "by", "rate_Hz"),
    [
        ("fcs/throttle-cmd-norm", -0.6, 120.0),
        ("fcs/throttle-cmd-norm", 0.25, 30.0),  # of four steps a row
        ("fcs/flap-cmd-norm", 0.33, 120.0),
    ],
)
def test_a_lever_of_a_log_explains_the_motion_that_it_makes(
    tmp_path: Path, lever: str, by: float, rate_Hz: float
) -> None:
    record = log(tmp_path, lever, by, rate_Hz=rate_Hz)
    name = lever_channel(lever)
    still = record.data.copy()
    still[:, record.channels.index(name)] = record[name][0]
    assert max(gaps(alone(), record, {}).values()) < 1.5
    assert max(gaps(alone(), Record(record.channels, still), {}).values()) > 5.0


def test_a_lever_that_no_event_moves_is_as_recorded(tmp_path: Path) -> None:
    """The conditions of a simulated flight are known, and may leave the throttle to the user."""
    record = log(tmp_path, "fcs/throttle-cmd-norm", -0.6)
    known = Record(record.channels, record.data, {"conditions": {}})
    assert max(gaps(alone(), known, {}).values()) < 1.5


def test_flaps_that_a_log_begins_with_are_those_of_the_trim(tmp_path: Path) -> None:
    flaps = "fcs/flap-cmd-norm"
    made, _ = flown(tmp_path, {}, 8.0, properties=(*PROPERTIES, flaps), before={flaps: 0.33})
    record = noisy(import_log(made)[0])
    _, said = trimmed(alone(), {"log": record})
    assert f"{flaps} 0.33" in said
    assert max(gaps(alone(), record, {}).values()) < 1.2
    without = [i for i, name in enumerate(record.channels) if name != "flap_norm"]
    unknown = Record(tuple(record.channels[i] for i in without), record.data[:, without])
    assert max(gaps(alone(), unknown, {}).values()) > 5.0


def test_the_noise_of_a_throttle_at_rest_is_no_thrust(tmp_path: Path) -> None:
    """The model's moved by the noise of the first row throughout: 4 noise floors of speed."""
    record = log(tmp_path, "fcs/throttle-cmd-norm", 0.0)
    for first in (-0.01, 0.01):
        data = record.data.copy()
        noise = np.random.default_rng(3).normal(scale=5e-3, size=len(data))
        noise[0] = first
        data[:, record.channels.index("throttle_norm")] = 0.7 + noise
        assert max(gaps(alone(), Record(record.channels, data), {}).values()) < 1.5


def test_a_lever_in_percent_is_refused(tmp_path: Path) -> None:
    record = log(tmp_path, "fcs/throttle-cmd-norm", -0.6)
    data = record.data.copy()
    data[:, record.channels.index("throttle_norm")] *= 100.0
    with pytest.raises(InputError, match=r"throttle_norm: reaches 72.*from 0 to 1: in percent"):
        diagnose(alone(), {"log": Record(record.channels, data)})


@pytest.mark.slow
def test_an_effect_is_found_in_a_flight_whose_throttle_moves(tmp_path: Path) -> None:
    found = diagnose(alone(), {"log": log(tmp_path, "fcs/throttle-cmd-norm", -0.3, 20.0, clp=0.7)})
    (effect,) = found.effects
    (factor,) = effect.parameters
    assert (found.verdict, effect.name) == ("effect", "roll_damping")
    assert factor.low is not None and factor.high is not None
    assert factor.low < 0.7 < factor.high
