"""The speeds at which an aircraft trims, found by search where the rig's own is none of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

from coupled.errors import InputError
from coupled.flight.airframe import UNTRIMMED
from coupled.rig.parameters import Flight

Make = Callable[[Flight], object]  # makes an aircraft, or raises its fault
_SPEEDS_m_per_s = tuple(float(f"{10.0 * 1.15**k:.3g}") for k in range(30))  # 10 to 576


def with_speeds(error: InputError, flight: Flight, make: Make) -> InputError:
    """Return the fault of an aircraft that does not trim, with speeds at which it does.

    Any other fault is returned as it is. `make` makes the aircraft of a changed `flight`.
    """
    if error.key != f"flight.{UNTRIMMED}":
        return error
    said = error.problem.partition("; choose")[0]
    return InputError(error.file, error.key, f"{said}; {_speeds(flight, _Maker(make))}")


class _Maker:
    """Makes aircraft; equal to any other, so that only the flight keys the cache."""

    def __init__(self, make: Make) -> None:
        self.make = make

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Maker)

    def __hash__(self) -> int:
        return 0


def _speeds(flight: Flight, maker: _Maker) -> str:
    """Return the tried speeds about the nearest that trims, for a sentence."""

    def trims(k: int) -> bool:
        if not 0 <= k < len(_SPEEDS_m_per_s):
            return False
        there = flight.model_copy(update={"calibrated_airspeed": _SPEEDS_m_per_s[k]})
        return _trims(there.model_dump_json(), maker)

    wanted = math.log(flight.calibrated_airspeed)
    nearest = sorted(
        range(len(_SPEEDS_m_per_s)), key=lambda k: abs(math.log(_SPEEDS_m_per_s[k]) - wanted)
    )
    found = next((k for k in nearest if trims(k)), None)
    if found is None:
        tried = f"{_SPEEDS_m_per_s[0]:g} to {_SPEEDS_m_per_s[-1]:g} m/s"
        return f"nor does it at any other speed tried, {tried}; choose another altitude or load"
    low = high = found
    while trims(low - 1):
        low -= 1
    while trims(high + 1):
        high += 1
    slow, fast = _SPEEDS_m_per_s[low], _SPEEDS_m_per_s[high]
    return f"it trims at {slow:g} to {fast:g} m/s, as tried" if low < high else f"try {slow:g} m/s"


@lru_cache(maxsize=256)
def _trims(flight_json: str, maker: _Maker) -> bool:
    try:
        maker.make(Flight.model_validate_json(flight_json))
    except InputError:
        return False
    return True
