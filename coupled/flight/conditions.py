"""The adverse conditions of a run: wind, gust, turbulence and events, read and applied."""

from __future__ import annotations

from typing import Any

from coupled.errors import InputError
from coupled.flight.event import Event, Events, check_events
from coupled.flight.weather import (
    DiscreteGust,
    Gust,
    MovingAir,
    Turbulence,
    TurbulentAir,
    Wind,
    check_gust,
    check_wind,
)
from coupled.flight.wrapper import Wrapper
from coupled.schema import Section, build

_TABLES: dict[str, type[Section]] = {"wind": Wind, "gust": Gust, "turbulence": Turbulence}


class Conditions(Section):
    """The conditions of a run file."""

    wind: Wind | None = None
    gust: Gust | None = None
    turbulence: Turbulence | None = None
    event: dict[str, Event] = {}

    @property
    def given(self) -> list[str]:
        """The tables of the file that need an aircraft."""
        there = [key for key in Conditions.model_fields if getattr(self, key)]
        on_aircraft = any(event.service is None for event in self.event.values())
        return [key for key in there if key != "event" or on_aircraft]


def build_conditions(table: dict[str, Any], file: object) -> None:
    """Replace a run's tables by checked sections."""
    for key, section in _TABLES.items():
        if key in table:
            table[key] = build(section, table[key], file, key)
    events = table.get("event", {})
    if not isinstance(events, dict):
        raise InputError(file, "event", "each is written [event.NAME]")
    if events:
        table["event"] = {
            name: build(Event, event, file, f"event.{name}") for name, event in events.items()
        }
        check_events(table["event"], file)
    if "wind" in table:
        check_wind(table["wind"], file)
    if "gust" in table:
        check_gust(table["gust"], file)


def condition_wrappers(
    conditions: Conditions, file: object, frame_s: float, seed: int
) -> list[Wrapper]:
    """Return the conditions as wrappers of an aircraft, in the order in which they act."""
    found: list[Wrapper] = []
    if conditions.wind is not None:
        found.append(MovingAir(conditions.wind, frame_s))
    if conditions.event:
        found.append(Events(conditions.event, file, frame_s))
    if conditions.gust is not None:
        found.append(DiscreteGust(conditions.gust, file, frame_s))
    if conditions.turbulence is not None:
        found.append(TurbulentAir(conditions.turbulence, file, seed))
    return found
