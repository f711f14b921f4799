"""An aircraft that is kept flies as a fresh one does, to the byte, whatever it flew before.

Slow: each model that is kept, after flights that stall, tumble, meet the ground, stop the engines,
burn their fuel or lose every number. A property that a reset leaves
changed is detected, and the aircraft is then loaded anew.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from coupled.flight import modelreset
from coupled.flight.addresses import neighbours
from coupled.flight.aircraftcache import PUT_BACK_EXACTLY, AircraftCache, CachedAircraft, in_trim
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.rig.parameters import Flight
from tests.support.runs import shortened

CONTROLS = ("column", "wheel", "pedals")
FLIGHTS = {
    "737": Flight(model="737", altitude=3000.0, calibrated_airspeed=130.0),
    "B747": Flight(model="B747", altitude=3000.0, calibrated_airspeed=150.0),
    "c172p": Flight(model="c172p", altitude=1500.0, calibrated_airspeed=50.0),
    "T37": Flight(
        model="T37",
        altitude=1500.0,
        calibrated_airspeed=144.0,
        properties={"gear/gear-cmd-norm": 0.0},
    ),
    "f16": Flight(model="f16", altitude=3000.0, calibrated_airspeed=200.0, direct_controls=False),
}
Spoil = Callable[[JSBSimAirframe], None]


def made(model: str) -> JSBSimAirframe:
    return JSBSimAirframe(FLIGHTS[model], 1.0 / 120.0, CONTROLS)


def put(airframe: JSBSimAirframe, values: dict[str, float]) -> None:
    for name, value in values.items():
        if airframe.has(name):
            airframe.lever(name).set(value)


def steered(airframe: JSBSimAirframe, seed: int, frames: int) -> bytes:
    """Fly with commands that wander over their whole range, and return the motion."""
    walk = np.random.default_rng(seed).normal(0.0, 0.1, (frames, 3)).cumsum(axis=0)
    motions = []
    for commands in np.clip(walk, -1.0, 1.0).tolist():
        airframe.step(tuple(commands))
        motions.append(airframe.motion())
    return np.array(motions).tobytes()


def tumble(airframe: JSBSimAirframe) -> None:
    steered(airframe, 3, 1200)


def crash(airframe: JSBSimAirframe) -> None:
    height = airframe.lever("position/h-agl-ft").read
    for _ in range(6000):
        airframe.step((1.0, 0.1, 0.0))
        if height() < 2.0:
            break
    for _ in range(60):
        airframe.step((0.5, 0.0, 0.0))


def stall(airframe: JSBSimAirframe) -> None:
    put(airframe, {f"fcs/throttle-cmd-norm{i}": 0.0 for i in ("", "[1]", "[2]", "[3]")})
    for _ in range(1200):
        airframe.step((-1.0, 0.3, 1.0))


def stop_engines(airframe: JSBSimAirframe) -> None:
    put(airframe, {"propulsion/active_engine": -1.0, "propulsion/cutoff_cmd": 1.0})
    put(airframe, {f"propulsion/engine{i}/set-running": 0.0 for i in ("", "[1]", "[2]", "[3]")})
    for _ in range(600):
        airframe.step((0.0, 0.0, 0.0))


def burn(airframe: JSBSimAirframe) -> None:
    put(airframe, {f"propulsion/tank[{i}]/contents-lbs": 3.0 for i in range(6)})
    put(airframe, {"fcs/flap-cmd-norm": 1.0, "gear/gear-cmd-norm": 1.0})
    for _ in range(1800):
        airframe.step((0.1, 0.0, 0.0))


def lose_every_number(airframe: JSBSimAirframe) -> None:
    for _ in range(20):
        airframe.step((float("nan"), 0.0, 0.0))


def shake(airframe: JSBSimAirframe) -> None:
    put(airframe, {"atmosphere/randomseed": 7.0, "atmosphere/turb-type": 3.0})
    put(airframe, {"atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps": 30.0})
    put(airframe, {"atmosphere/turbulence/milspec/severity": 4.0})
    for _ in range(240):
        airframe.step((0.0, 0.1, 0.0))


def brake(airframe: JSBSimAirframe) -> None:
    put(airframe, {"fcs/left-brake-cmd-norm": 1.0})


PUT_BACK: list[Spoil] = [tumble, crash, stall, stop_engines, burn, lose_every_number]
LEFT: list[Spoil] = [shake, brake]


@pytest.mark.slow
@pytest.mark.parametrize("model", sorted(PUT_BACK_EXACTLY))
def test_whatever_it_flew_before_a_kept_aircraft_flies_as_a_fresh_one(model: str) -> None:
    fresh = steered(made(model), 5, 1200)
    cached = in_trim(made(model), "any")
    assert isinstance(cached.airframe, JSBSimAirframe)
    for spoil in (*PUT_BACK, *reversed(PUT_BACK)):
        spoil(cached.airframe)
        assert cached.state() != cached.trimmed
        assert cached.restarted(), f"{model} after {spoil.__name__}"
        assert steered(cached.airframe, 5, 1200) == fresh, f"{model} after {spoil.__name__}"


@pytest.mark.slow
@pytest.mark.parametrize("model", sorted(PUT_BACK_EXACTLY))
def test_a_property_that_a_reset_leaves_changed_is_detected(model: str) -> None:
    for spoil in LEFT:
        cached = in_trim(made(model), "any")
        assert isinstance(cached.airframe, JSBSimAirframe)
        spoil(cached.airframe)
        assert not cached.restarted()


def test_a_reset_keeps_the_limits_of_a_stall() -> None:
    """JSBSim's own sets them to zero, and then a stall ends as it begins."""
    cached = in_trim(made("c172p"), "any")
    assert isinstance(cached.airframe, JSBSimAirframe)
    fresh = made("c172p")
    assert cached.restarted()
    stall(cached.airframe)
    stall(fresh)
    reads = [each.reader("aero/stall-hyst-norm") for each in (fresh, cached.airframe)]
    assert [read() for read in reads if read is not None] == [1.0, 1.0]


@pytest.mark.parametrize("values", [(0.36, 0.08), (0.0, 0.0)])  # at no place, and at several
def test_an_aircraft_whose_stall_s_limits_are_not_found_is_not_kept(
    values: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(modelreset, "neighbours", lambda found, _: neighbours(found, values))
    assert in_trim(made("c172p"), "any").kind is None


def test_an_object_that_is_no_aerodynamics_has_no_limits() -> None:
    assert neighbours(object(), (0.36, 0.09)) is None
    assert neighbours(made("c172p")._fdm.get_propulsion(), (0.36, 0.09)) is None


def short(run: str, force_N: float, changes: dict[str, Any] | None = None) -> Manoeuvre:
    found = shortened(run, 1, 40)
    pilot = found.pilots["column"].model_copy(update={"force_N": force_N, "start_s": 0.0})
    rig = found.rig.changed(changes) if changes else found.rig
    return replace(found, pilots={"column": pilot}, rig=rig)


@pytest.mark.slow
@pytest.mark.parametrize("run", ["pull-up-737", "pull-up-c172p"])
def test_flights_from_the_cache_have_the_bytes_of_flights_without(
    run: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    restarts, restarted = list[bool](), CachedAircraft.restarted

    def told(cached: CachedAircraft) -> bool:
        restarts.append(restarted(cached))
        return restarts[-1]

    monkeypatch.setattr(CachedAircraft, "restarted", told)
    flights = [short(run, force_N) for force_N in (170.0, -90.0, 40.0)]
    alone = [fly(flight).data.tobytes() for flight in flights]
    cache = AircraftCache()
    together = [fly(flight, cache=cache).data.tobytes() for flight in (*flights, *flights[::-1])]
    assert together == [*alone, *alone[::-1]]
    assert restarts == [True] * 4  # the first two, of a kind not yet known to come again, load


@pytest.mark.parametrize(
    ("run", "changes"),
    [
        ("awjsra-shear", None),
        ("pull-up-737", {"flight.mass": 1.1}),
        ("pull-up-737", {"flight.gust_rms_m_per_s": 1.0}),
        ("pull-up-737", {"flight.pitch_damping": 0.9}),
    ],
)
def test_what_a_reset_may_not_restore_is_not_kept(run: str, changes: dict[str, Any] | None) -> None:
    cache, flight, made = AircraftCache(), short(run, 20.0, changes), []

    def make() -> Any:
        made.append(1)
        return object()

    for _ in range(3):
        cache.keep(cache.take(flight, make))
    assert len(made) == 3
