"""An aircraft that is kept between the flights of a sweep, put back and trimmed for each.

To load a T-37 takes an eighth of a flight of 20 s. JSBSim's reset spares it, but loses what a model
says of some things: the limits between which a c172p's stall has hysteresis, and where the
aerodynamic reference point moves to. No property shows that. So only those models are kept of
which a test has found that each record is the same to the byte, whatever they flew before
(`tests/flight/test_kept`), in flights that change nothing of the aircraft but its commands.
Beside this, all properties are compared with those of the first trim, bit for bit, and a flight
that ended early leaves no aircraft. Where anything differs, the aircraft is loaded anew.
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
from coupled.flight.putback import tells
from coupled.rig.parameters import Flight

# Of JSBSim's package. A c172p's stall, and an awjsra's trim, are others after a reset.
PUT_BACK_EXACTLY = frozenset({"737", "B747", "T37", "f16"})
# What of a flight section does no more than to set where it is trimmed, or changes no aircraft.
_HARMLESS = frozenset(
    {"model", "altitude", "calibrated_airspeed", "flight_path", "direct_controls", "motion_stamp"}
    | {"properties", "gust_length"}
)


@dataclass(frozen=True)
class Lent:
    """An aircraft as a flight has it; `kind` is None where it is not kept after it.

    `reads` are all its properties, `trimmed` their values in its first trim.
    """

    airframe: Airframe
    kind: Hashable = None
    reads: tuple[Read, ...] = ()
    trimmed: bytes = b""

    def state(self) -> bytes:
        """Return the properties as they are now, one after another."""
        return array("d", [read() for read in self.reads]).tobytes()

    def restarted(self) -> bool:
        """Put the aircraft back and trim it; return whether it is as it was in its first trim."""
        assert isinstance(self.airframe, JSBSimAirframe)
        try:
            self.airframe.restart()
        except InputError:
            return False
        return self.state() == self.trimmed


def in_trim(airframe: JSBSimAirframe, kind: Hashable) -> Lent:
    """Return an aircraft in its first trim, with what that is."""
    found = (airframe.reader(name) for name in airframe.names() if tells(name))
    lent = Lent(airframe, kind, tuple(read for read in found if read is not None))
    return replace(lent, trimmed=lent.state())


class Hangar:
    """Where the aircraft of the last flight waits for another of its kind."""

    def __init__(self) -> None:
        self._asked: Hashable = None
        self._waiting: dict[Hashable, Lent] = {}

    def lend(self, manoeuvre: Manoeuvre, make: Callable[[], Airframe]) -> Lent:
        """Return an aircraft for a manoeuvre: the one that waits, put back, or a new one."""
        kind = _kind(manoeuvre)
        # Taken out, so that no two threads ever fly one aircraft.
        waiting = self._waiting.pop(kind, None)
        if waiting is not None and waiting.restarted():
            return waiting
        airframe = make()
        # To look up its properties takes a while: only once a kind is flown again and again.
        again, self._asked = kind is not None and kind == self._asked, kind
        if not again or not isinstance(airframe, JSBSimAirframe):
            return Lent(airframe)
        return in_trim(airframe, kind)

    def take_back(self, lent: Lent) -> None:
        """Keep an aircraft after a flight that reached its end, in place of any other."""
        if lent.kind is not None:
            self._waiting = {lent.kind: lent}


def _kind(manoeuvre: Manoeuvre) -> Hashable:
    """Return what one aircraft flies of; None where it is not kept."""
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
