"""The expectations of a run file, `[[expect]]`, checked before anything is flown.

An expectation is about a channel, a figure of a comparison, or a limit of the standards. Its other
keys select rows and flights, and give the bounds. `why` is the origin of the bounds, above all
whether they only pin the model's earlier result.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from pydantic import ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from coupled.errors import InputError, nearest
from coupled.record.channels import CONTROL_NAMES, ControlName, channel
from coupled.schema import Section, named, quantity

Figure = Literal[
    "asked_norm",
    "reached_norm",
    "hand_travel_norm",
    "loss",
    "loss_closed_form",
    "felt_ratio",
    "felt_ratio_closed_form",
    "force_N",
    "force_step_N",
    "peak_rate_rad_per_s",
    "peak_load_factor",
    "time_to_attitude_s",
    "surface_stop_norm",
]
Take = Literal["every", "mean", "lowest", "greatest", "last"]
Standard = Literal[
    "25.143(d) two hands",
    "25.143(d) one hand",
    "25.143(d) long-term",
    "Part 60 2.a force",
    "Part 60 2.b.4 rate",
    "rate against rigid",
    "Part 60 4.a latency 150 ms",
    "Part 60 4.a latency 300 ms",
    "Part 60 4.a latency 100 ms",
]
SMALL_RATE: Standard = "Part 60 2.b.4 rate"  # a small pitch input's
RATE: Standard = "rate against rigid"
LATENCIES: tuple[Standard, ...] = (
    "Part 60 4.a latency 150 ms",
    "Part 60 4.a latency 300 ms",
    "Part 60 4.a latency 100 ms",
)
RATES = (SMALL_RATE, RATE)  # compared with the rigid flight
REFERENCE = "rigid"

SHARES: tuple[Figure, ...] = ("loss", "loss_closed_form")  # a bound of 1 is trivial
RELATIVE: tuple[Figure, ...] = (*SHARES, "asked_norm", "reached_norm", "hand_travel_norm")
RELATIVE += ("surface_stop_norm",)
RELATIVE += ("felt_ratio", "felt_ratio_closed_form")
_PER_CENT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*%\s*")


class UnjudgedError(Exception):
    """Why an expectation cannot be judged: a figure of its flight is not defined."""


class Expect(Section):
    """One expectation, of exactly one of `channel`, `measure` and `standard`."""

    channel: str | None = None
    measure: Figure | None = None
    standard: Standard | None = None
    control: ControlName | None = None
    case: str | None = None
    configuration: str | None = None
    minus: str | None = None
    at: float | None = quantity("s", None, ge=0)
    start: float | None = named("from_s", None, ge=0)
    end: float | None = named("to_s", None, gt=0)
    take: Take = "every"
    reaches: float | None = None
    by: float | None = quantity("s", None, ge=0)
    not_before: float | None = quantity("s", None, ge=0)
    least: float | None = None
    most: float | None = None
    equal: float | None = named("is", None)
    within: float | None = quantity("", None, ge=0)
    why: str | None = None

    @field_validator("least", "most", "equal", "within", mode="before")
    @classmethod
    def _in_shares(cls, value: Any, info: ValidationInfo) -> Any:
        """Return a bound given in per cent as a share; refuse a share of 1 or more."""
        measure, channel = info.data.get("measure"), info.data.get("channel") or ""
        if isinstance(value, str):
            found = _PER_CENT.fullmatch(value)
            if found is None or not (measure in RELATIVE or channel.endswith("_norm")):
                raise PydanticCustomError("number", "should be a number, without quotes")
            return float(found[1]) / 100.0
        if measure in SHARES and isinstance(value, (int, float)) and abs(value) >= 1:
            message = 'is a share, of which 1 is everything: write 0.01 or "1 %" for one per cent'
            raise PydanticCustomError("share", message)
        return value

    @property
    def bounds(self) -> tuple[float | None, float | None]:
        """The least and the largest value of the figure, in its own unit."""
        if self.equal is not None and self.within is not None:
            return self.equal - self.within, self.equal + self.within
        if self.reaches is not None:
            return self.not_before, self.by
        return self.least, self.most

    @property
    def reference(self) -> str | None:
        """The configuration of the reference flight, if any."""
        return REFERENCE if self.standard in RATES else self.minus

    def concerns(self, case: str, configuration: str) -> bool:
        """Return whether the expectation applies to a flight."""
        if self.case not in (None, case) or configuration == self.reference:
            return False
        return self.configuration in (None, configuration)

    @property
    def quantity(self) -> str:
        """A name that ends in the unit of the figure and its bounds."""
        if self.reaches is not None or self.standard in LATENCIES:
            return "time_s"
        if self.standard in RATES:
            return "rate_rad_per_s"
        return self.channel or self.measure or "force_N"

    @property
    def words(self) -> str:
        """The subject of the expectation, in words."""
        text = self.channel or self.measure or self.standard or ""
        if self.control is not None:
            text += f", {self.control}"
        if self.reaches is not None:
            text += f" reaches {self.reaches:g}"
        elif self.take != "every":
            text += f", {self.take}"
        if self.at is not None:
            text += f" at {self.at:g} s"
        if self.start is not None or self.end is not None:
            text += f" from {self.start or 0.0:g} s"
        if self.end is not None:
            text += f" to {self.end:g} s"
        return text if self.minus is None else f"{text}, minus {self.minus}"


_ROWS = ("at", "start", "end", "reaches")
_BOUNDS = ("least", "most", "equal", "within")
_KEYS = {"at": "at_s", "start": "from_s", "end": "to_s", "equal": "is", "by": "by_s"}
_KEYS["not_before"] = "not_before_s"


def check_expectations(
    expectations: Sequence[Expect],
    file: object,
    cases: Mapping[str, Sequence[str]],
    configurations: Sequence[str],
    duration_s: float,
) -> None:
    """Refuse expectations that can never be judged; `cases` are the channels by case label."""
    for i, expect in enumerate(expectations):
        place = f"expect[{i}]"
        _check_subject(expect, file, place)
        _check_bounds(expect, file, place)
        _check_times(expect, file, place, duration_s)
        _check_flights(expect, file, place, list(cases), configurations)
        for label, channels in cases.items():
            if expect.case in (None, label):
                _check_channels(expect, file, place, channels)


def _given(expect: Expect, fields: Sequence[str]) -> list[str]:
    """Return the keys, of some fields, that an expectation has."""
    return [_KEYS.get(field, field) for field in fields if getattr(expect, field) is not None]


def _check_subject(expect: Expect, file: object, place: str) -> None:
    subjects = _given(expect, ("channel", "measure", "standard"))
    if len(subjects) != 1:
        raise InputError(file, place, "give one of channel, measure and standard")
    alien: list[str] = []
    if expect.channel is None:
        alien += _given(expect, _ROWS)
        if expect.take != "every":
            alien.append("take")
    if expect.standard is None:
        alien += _given(expect, ("control",))
    else:
        alien += _given(expect, (*_BOUNDS, "minus"))
    if alien:
        raise InputError(file, f"{place}.{alien[0]}", f"cannot be given with {subjects[0]}")


def _check_bounds(expect: Expect, file: object, place: str) -> None:
    if expect.reaches is not None:
        alien = _given(expect, (*_BOUNDS, "minus", "at"))
        if alien:
            raise InputError(file, f"{place}.{alien[0]}", "cannot be given with reaches")
        if not _given(expect, ("by", "not_before")):
            raise InputError(file, place, "reaches needs by_s, not_before_s, or both")
    else:
        alien = _given(expect, ("by", "not_before"))
        if alien:
            raise InputError(
                file, f"{place}.{alien[0]}", "needs the level that is reached: reaches"
            )
        if (expect.equal is None) != (expect.within is None):
            raise InputError(file, place, "give is and within together")
        if expect.equal is not None and _given(expect, ("least", "most")):
            raise InputError(file, place, "give is and within, or least and most, not both")
        if expect.standard is None and not _given(expect, _BOUNDS):
            raise InputError(file, place, "has no bound: give least, most, or is and within")
    low, high = expect.bounds
    if low is not None and high is not None and low > high:
        raise InputError(file, place, f"nothing is at least {low:g} and at most {high:g}")


def _check_times(expect: Expect, file: object, place: str, duration_s: float) -> None:
    if expect.at is not None and (_given(expect, ("start", "end")) or expect.take != "every"):
        raise InputError(file, f"{place}.at_s", "is one moment: no from_s, to_s or take with it")
    for field in ("at", "start", "end", "by"):
        value = getattr(expect, field)
        if value is None:
            continue
        key = f"{place}.{_KEYS[field]}"
        if field == "end" and value > duration_s:
            problem = f"is {value:g}, after the run's end; give at most duration_s = {duration_s:g}"
            raise InputError(file, key, problem)
        if field != "end" and value >= duration_s:
            problem = f"is {value:g}; give less than duration_s = {duration_s:g}, when the run ends"
            raise InputError(file, key, problem)
    if expect.start is not None and expect.end is not None and expect.start >= expect.end:
        raise InputError(file, f"{place}.to_s", "must be after from_s")


def _check_flights(
    expect: Expect, file: object, place: str, cases: Sequence[str], configurations: Sequence[str]
) -> None:
    if expect.case is not None and expect.case not in cases:
        raise InputError(
            file, f"{place}.case", f"no {expect.case!r}; {nearest(expect.case, cases)}"
        )
    wanted = {"configuration": expect.configuration, "minus": expect.minus}
    if expect.standard in RATES:
        wanted["standard"] = REFERENCE
    for key, name in wanted.items():
        if name is not None and name not in configurations:
            problem = f"the run flies no {name!r}; {nearest(name, configurations)}"
            raise InputError(file, f"{place}.{key}", problem)
    if not any(expect.concerns(case, c) for case in cases for c in configurations):
        raise InputError(file, place, f"compares {expect.reference} with itself alone")


def _check_channels(expect: Expect, file: object, place: str, channels: Sequence[str]) -> None:
    if expect.channel is not None and expect.channel not in channels:
        hint = nearest(expect.channel, channels)
        raise InputError(file, f"{place}.channel", f"no {expect.channel!r}; {hint}")
    controls = [name for name in CONTROL_NAMES if channel(name, "force") in channels]
    if expect.control is not None and expect.control not in controls:
        hint = nearest(expect.control, controls)
        raise InputError(file, f"{place}.control", f"the rig has no {expect.control}; {hint}")
    needs_motion = expect.standard in RATES or expect.standard in LATENCIES
    if needs_motion and "pitch_rate_rad_per_s" not in channels:
        raise InputError(file, f"{place}.standard", "the rig has no aircraft whose rate this is")
