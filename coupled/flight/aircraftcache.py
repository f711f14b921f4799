"""A cache of a sweep's aircraft, which is reset and trimmed for each flight.

To load a T-37 takes an eighth of a flight of 20 s. JSBSim's reset avoids this, but does not restore
all state (`modelreset`). The moving aerodynamic reference point is not restored, and an awjsra's
nozzles start from their last position, as each kinematic component does; with their position and
the wind set back, the next trim still differs by 1e-14.

So an aircraft is kept only for models whose records do not depend on earlier flights, to the byte
(`tests/flight/test_aircraftcache`), and only for flights that change nothing but its commands. In
addition all properties are compared with those of the first trim, bit for bit, and a flight that
ended early keeps no aircraft. If anything differs, the aircraft is loaded again.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

from coupled.errors import InputError
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.bench import Airframe
from coupled.flight.everyframe import Read
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.modelreset import is_state_property
from coupled.rig.parameters import Flight
from coupled.rig.recorder import ZEROS

# Models of JSBSim's package that its reset restores exactly.
PUT_BACK_EXACTLY = frozenset({"737", "B747", "T37", "c172p", "f16"})
# Keys of a flight section that only set its trim, or change no aircraft.
_HARMLESS = frozenset(
    {"model", "altitude", "calibrated_airspeed", "flight_path", "direct_controls", "motion_stamp"}
    | {"properties", "gust_length", *ZEROS.values()}
)


@dataclass(frozen=True)
class CachedAircraft:
    """An aircraft for one flight; `kind` is None if it is not kept afterwards.

    `reads` are all its properties, `trimmed` their values in its first trim, to which `restart`
    returns it.
    """

    airframe: Airframe
    kind: Hashable = None
    reads: tuple[Read, ...] = ()
    trimmed: bytes = b""
    restart: Callable[[], None] | None = None

    def state(self) -> bytes:
        """Return the current values of the properties, concatenated."""
        return array("d", [read() for read in self.reads]).tobytes()

    def restarted(self) -> bool:
        """Reset and trim the aircraft; return whether its state equals that of its first trim."""
        assert self.restart is not None
        try:
            self.restart()
        except InputError:
            return False
        return self.state() == self.trimmed


def in_trim(airframe: JSBSimAirframe, kind: Hashable) -> CachedAircraft:
    """Return an aircraft in its first trim, with its state if a reset may restore it."""
    restart = airframe.restarter()
    if restart is None:
        return CachedAircraft(airframe)
    found = (airframe.reader(name) for name in airframe.names() if is_state_property(name))
    reads = tuple(read for read in found if read is not None)
    cached = CachedAircraft(airframe, kind, reads, restart=restart)
    return replace(cached, trimmed=cached.state())


def started_aircraft(airframe: Airframe, kind: Hashable) -> CachedAircraft:
    """Return an airframe in its first trim, with its state if a reset may restore it."""
    if kind is None or not isinstance(airframe, JSBSimAirframe):
        return CachedAircraft(airframe)
    return in_trim(airframe, kind)


class AircraftCache:
    """A cache of the last flight's aircraft, for another flight of the same kind."""

    def __init__(self) -> None:
        self._asked: Hashable = None
        self._waiting: dict[Hashable, CachedAircraft] = {}

    def take(self, manoeuvre: Manoeuvre, make: Callable[[], Airframe]) -> CachedAircraft:
        """Return an aircraft for a manoeuvre: the cached one, reset, or a new one."""
        kind = flight_kind(manoeuvre)
        # Removed from the cache, so that no two threads fly one aircraft.
        waiting = self._waiting.pop(kind, None)
        if waiting is not None and waiting.restarted():
            return waiting
        airframe = make()
        # Collecting the properties is slow, so it is done only for a kind that is repeated.
        again, self._asked = kind is not None and kind == self._asked, kind
        return started_aircraft(airframe, kind if again else None)

    def keep(self, cached: CachedAircraft) -> None:
        """Keep an aircraft after a complete flight, in place of any other."""
        if cached.kind is not None:
            self._waiting = {cached.kind: cached}


def flight_kind(manoeuvre: Manoeuvre) -> Hashable:
    """Return the key of a manoeuvre's aircraft; None if it is not kept."""
    rig = manoeuvre.rig
    flight = rig.flight
    if flight is None or flight.model not in PUT_BACK_EXACTLY or manoeuvre.conditions.given:
        return None
    plain = Flight(**{name: getattr(flight, name) for name in _HARMLESS})
    if flight != plain:
        return None
    asked = (tuple(rig.controls), tuple(manoeuvre.record_properties))
    files = (str(manoeuvre.rig_file), str(manoeuvre.file), manoeuvre.source is None)
    return (flight.model_dump_json(), rig.frame_rate, *asked, *files)
