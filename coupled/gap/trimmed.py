"""The rig and the trim of a record: from its manifest, otherwise from its first rows.

A rig file describes a machine. The trim of its aircraft (speed, altitude, flight path, flaps) is a
condition of the flight and no fault, so it is taken from the record. Other values of a manifest's
rig (a mass, a moment, a bend) are not used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.altered import STILL
from coupled.gap.checks import SPEED, start_of
from coupled.gap.thresholds import OTHER_SPEED, OTHER_ALTITUDE_m, OTHER_PATH_rad
from coupled.record.channels import motion_channels
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.rig.rig import Rig
from coupled.rig.rigfile import rig_from_table
from coupled.schema import changed, file_keys

# The keys of a rig's `flight` that define the initial trim, not the aircraft.
TRIM_KEYS = (
    "altitude_m",
    "calibrated_airspeed_m_per_s",
    "flight_path_rad",
    "trim",
    "landing",
    "properties",
)
ALTITUDE = "altitude_m"
_FIELDS = file_keys(Flight, "m")


def rig_of_manifests(records: Mapping[str, Record]) -> Rig:
    """Return the rig in the manifests of some records, from the first manifest.

    Raises InputError if a record has no manifest with a rig, or if the rigs differ.
    """
    found: Rig | None = None
    for file, record in records.items():
        table = record.manifest.get("rig")
        if not isinstance(table, Mapping):
            problem = "is missing, and no manifest beside the record holds a rig: give the rig file"
            raise InputError(file, "--rig", problem)
        rig = rig_from_table(table, f"{file} (its manifest)")
        found = rig if found is None else found
        if (rig.controls, rig.structure) != (found.controls, found.structure):
            first = next(iter(records))
            problem = f"its manifest holds another rig than that of {first}: give the rig file"
            raise InputError(file, "--rig", problem)
    assert found is not None
    return found


def trimmed(rig: Rig, records: Mapping[str, Record]) -> tuple[Rig, str]:
    """Return a rig with the trim at the start of the records, and a sentence about the change.

    The sentence is empty if the trim is that of the rig file, or if there is no aircraft. Raises
    InputError if a manifest has another aircraft, if the records differ in their trim, or if the
    aircraft cannot be trimmed at it.
    """
    if rig.flight is None:
        return rig, ""
    each = {file: _manifest_trim(rig.flight, record, file) for file, record in records.items()}
    first, taken = next(iter(each.items()))
    for file, other in each.items():
        if other != taken:
            problem = f"was flown from another trim than {first}: diagnose the two one by one"
            raise InputError(file, "flight", problem)
    source = f"the manifest of {first}"
    if taken is None:
        taken, source = _measured_trim(rig, records[first], first), f"the first rows of {first}"
    new = {key: value for key, value in taken.items() if not _same(rig.flight, key, value)}
    if not new:
        return rig, ""
    was = ", ".join(_change(rig.flight, key, value) for key, value in new.items())
    return rig.changed({f"flight.{key}": value for key, value in new.items()}), (
        f"Trim taken from {source}, not from the rig file: {was}."
    )


def _same(flight: Flight, key: str, value: Any) -> bool:
    """Tell whether a value of the rig file equals the flown one, to a relative 1e-6."""
    filed = getattr(flight, _FIELDS[key])
    if isinstance(value, float) and isinstance(filed, float):
        return math.isclose(value, filed, rel_tol=1e-6, abs_tol=1e-9)
    return bool(value == filed)


def _change(flight: Flight, key: str, value: Any) -> str:
    """Return a text of the change of a key."""
    if key == "properties":
        return "properties of the model"
    before = getattr(flight, _FIELDS[key])
    if isinstance(value, float):
        return f"{key} {before:.4g} → {value:.4g}"
    return f"{key} {before} → {value}"


def _manifest_trim(flight: Flight, record: Record, file: str) -> dict[str, Any] | None:
    """Return the trim in a record's manifest, by keys of a rig file; None if it has none."""
    table = record.manifest.get("rig")
    given = table.get("flight") if isinstance(table, Mapping) else None
    if not isinstance(given, Mapping):
        return None
    if given.get("model") != flight.model:
        problem = f"is {given.get('model')!r} in the manifest, {flight.model!r} in the rig file"
        raise InputError(file, "flight.model", f"{problem}: another rig's file?")
    return {key: given[key] for key in TRIM_KEYS if key in given}


def _measured_trim(rig: Rig, record: Record, file: str) -> dict[str, Any]:
    """Return the measured trim at a record's start; empty if it is the rig's or not measured."""
    assert rig.flight is not None
    if SPEED not in record:
        return {}
    flight, found = rig.flight, dict[str, Any]()
    wanted = start_of(record, SPEED)
    altitude = start_of(record, ALTITUDE) if ALTITUDE in record else flight.altitude
    elsewhere = abs(altitude - flight.altitude) > OTHER_ALTITUDE_m
    if abs(wanted / trim_speed(rig) - 1.0) <= OTHER_SPEED and not elsewhere:
        return {}
    if ALTITUDE in record:
        found["altitude_m"] = altitude
    if "pitch_rad" in record and "alpha_rad" in record:
        path = start_of(record, "pitch_rad") - start_of(record, "alpha_rad")
        if abs(path - flight.flight_path) > OTHER_PATH_rad:
            found["flight_path_rad"] = path
    speed = flight.calibrated_airspeed
    try:
        for _ in range(3):  # the two speeds are nearly in proportion
            found["calibrated_airspeed_m_per_s"] = speed
            there = rig.changed({f"flight.{key}": value for key, value in found.items()})
            speed *= wanted / trim_speed(there)
        found["calibrated_airspeed_m_per_s"] = speed
        trim_speed(rig.changed({f"flight.{key}": value for key, value in found.items()}))
    except InputError:
        problem = (
            f"starts at {wanted:.4g}, where the rig's {flight.model} does not trim;"
            f" the rig file has it at {trim_speed(rig):.4g}: another rig's file?"
        )
        raise InputError(file, SPEED, problem) from None
    return found


def trim_speed(rig: Rig) -> float:
    """Return the true airspeed at which the rig's aircraft is trimmed, m/s."""
    assert rig.flight is not None
    still = changed(rig.flight, STILL, rig.name, "flight")
    return _trim_speed(still.model_dump_json(), rig.frame_rate)


@lru_cache(maxsize=64)
def _trim_speed(flight: str, rate_Hz: float) -> float:
    still = Flight.model_validate_json(flight)
    airframe = make_aircraft(still, 1.0 / rate_Hz, ["column"], [aircraft_folder()])
    return airframe.motion()[motion_channels(["column"], flown=True).index(SPEED)]
