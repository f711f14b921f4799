"""The parameters of an FMU: the numbers of the rig file that may change in flight.

A number may change if the laws reproduce `pack` at other values too. Others are constant in the
FMU: those that change the structure of the loader, and those of exact maps over a step, such as the
frequency of a servo.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from coupled.exporting.fmu.descriptions import PARAMETERS
from coupled.exporting.fmu.laws import ARGUMENTS, Law, computed_number, laws
from coupled.record.channels import ControlName, unit_of
from coupled.rig.control import CONTROL
from coupled.rig.packing import pack
from coupled.rig.parameters import DELAY_SLOTS, GAUGE_SLOTS, Control
from coupled.rig.rig import Rig
from coupled.schema import LARGEST, file_keys

Words = NDArray[np.int64]
AGREES = 1e-12  # relative; the rounding of the laws differs from `pack`
_SMALL = 0.01  # a trial value instead of 0
# Their history is not stored while they are 0.
_WITH_HISTORY = ("loader.delay", "loader.servo_delay", "sensing.gauge_delay")
_RISING = ("schedule.dynamic_pressure", "compensation.inertia_gradient")


class Bounds(NamedTuple):
    """The range of a number; `above` excludes the least value."""

    least: float = -LARGEST
    most: float = LARGEST
    above: bool = False

    def include(self, value: float) -> bool:
        """Return whether a value is within the range."""
        return self.least <= value <= self.most and not (self.above and value == self.least)


class Parameter(NamedTuple):
    """A number of a rig file that may change in flight: its key, unit, range and value."""

    name: str  # by the fields of the sections, with an index from 0
    key: str  # of the file, within the control's table, with an index from 1
    unit: str  # as in the key
    description: str
    start: float
    bounds: Bounds
    whole: bool  # 0 or 1
    rises: bool  # above the value before it


class Place(NamedTuple):
    """A number of the kernels: its word in a control's memory, and whether it is an integer."""

    word: int
    whole: bool


def place_of(name: str) -> Place:
    """Return the place of `parameters.STAGE.NUMBER`, or of `…[ROW]`."""
    kind, offset = CONTROL, 0
    plain, _, row = name.partition("[")
    for part in plain.split("."):
        assert kind.fields is not None
        kind, more = kind.fields[part][:2]
        offset += more
    return Place(offset // 8 + int(row.rstrip("]") or 0), kind == np.dtype(np.int64))


def parameters(rig: Rig, control: str) -> list[Parameter]:
    """Return the numbers of a control that may change in flight, in the order of the file."""
    data = rig.controls[cast(ControlName, control)]
    frame_s, d = 1.0 / rig.frame_rate, unit_of(control)
    known = laws(data, frame_s, frame_s / rig.substeps)
    names = {name for law in known.values() for name in law.of if name}
    found = []
    for name in PARAMETERS:
        elements = sorted((n for n in names if n.partition("[")[0] == name), key=_index)
        for one in elements:
            bounds = _bounds(rig, data, one)
            usable = _usable(rig, control, one, bounds, known)
            if usable is not None:
                found.append(_parameter(data, one, usable, d))
    return found


def _index(name: str) -> int:
    return int(name.partition("[")[2].rstrip("]") or 0)


def _parameter(data: Control, name: str, bounds: Bounds, d: str) -> Parameter:
    plain, _, row = name.partition("[")
    section, _, field = plain.rpartition(".")
    holder = getattr(data, section) if section else data
    kind = type(holder)
    key = next(key for key, of in file_keys(kind, d).items() if of == field)
    extra = kind.model_fields[field].json_schema_extra
    unit = str(extra["unit"]).format(d=d) if isinstance(extra, dict) and "unit" in extra else ""
    dotted = f"{section}.{key}" if section else key
    number = f"[{_index(name) + 1}]" if row else ""
    whole = isinstance(getattr(holder, field), bool)
    rises = plain in _RISING and _index(name) > 0
    text = PARAMETERS[plain]
    start = value(data, name)
    return Parameter(name, dotted + number, unit, text, start, bounds, whole, rises)


def value(data: Control, name: str) -> float:
    """Return a number of a control by its dotted name."""
    found: Any = data
    plain, _, row = name.partition("[")
    for part in plain.split("."):
        found = getattr(found, part)
    return float(found[_index(name)] if row else found)


def _bounds(rig: Rig, data: Control, name: str) -> Bounds:
    """Return the range of a number by its section's declaration, and by the kernels' memory."""
    plain, _, row = name.partition("[")
    section, _, field = plain.rpartition(".")
    holder = getattr(data, section) if section else data
    if isinstance(getattr(holder, field), bool):
        return Bounds(0.0, 1.0)
    least, most, above = -LARGEST, LARGEST, False
    for each in type(holder).model_fields[field].metadata:
        least = getattr(each, "ge", getattr(each, "gt", least))
        above = above or hasattr(each, "gt")
        most = getattr(each, "le", most)
        if hasattr(each, "lt"):
            most = math.nextafter(each.lt, -math.inf)
    if row:
        least, above = 0.0, field in ("mass_factor", "damping_factor")
    if plain in _RISING:
        least = -LARGEST
    substep_s = 1.0 / (rig.frame_rate * rig.substeps)
    if plain in _WITH_HISTORY:
        slots = GAUGE_SLOTS if plain == "sensing.gauge_delay" else DELAY_SLOTS
        most = min(most, (slots - 2) * substep_s)
    if field.endswith("_skew"):
        most = min(most, 1.0 / rig.frame_rate)
    return Bounds(float(least), float(most), above)


def _usable(
    rig: Rig, control: str, name: str, bounds: Bounds, known: Mapping[str, Law]
) -> Bounds | None:
    """Return the range in which the laws reproduce `pack` for a number; None if there is none."""
    data = rig.controls[cast(ControlName, control)]
    now = value(data, name)
    if name in _WITH_HISTORY:
        if now == 0.0:
            return None
        bounds = bounds._replace(above=True)
    tried = [1.07 * now, 0.91 * now] if now != 0.0 else [_SMALL, -_SMALL]
    if bounds == Bounds(0.0, 1.0):
        tried = [1.0 - now]
    tried = [one for one in tried if bounds.include(one)]
    if not tried or not all(_agree(rig, control, name, one, known) for one in tried):
        return None
    if bounds.include(0.0) and not _agree(rig, control, name, 0.0, known):
        return bounds._replace(least=max(bounds.least, 0.0), above=True) if now > 0.0 else None
    return bounds


def _agree(rig: Rig, control: str, name: str, to: float, known: Mapping[str, Law]) -> bool:
    """Return whether the laws reproduce `pack` for another value of a number."""
    data = rig.controls[cast(ControlName, control)]
    changed = _changed(data, name, to)
    whole = _whole_words()
    try:
        found, wanted = words(rig, control, data), words(rig, control, changed)
        for place, law in known.items():
            if name in law.of and not place.startswith("state."):
                _write(found, place_of(place), law, changed)
    except ZeroDivisionError:  # a scale that cannot be 0
        return False
    near = np.isclose(found.view(np.float64), wanted.view(np.float64), rtol=AGREES, atol=0.0)
    return bool(np.where(whole, found == wanted, near).all())


def words(rig: Rig, control: str, data: Control) -> Words:
    """Return the memory of a control with this data, packed alone, in words of eight bytes."""
    controls = {cast(ControlName, control): data}
    packed = pack(rig.model_copy(update={"controls": controls}))
    return np.frombuffer(packed.tobytes(), np.int64).copy()


def evaluated(law: Law, data: Control) -> float:
    """Return a number of the kernels by its law."""
    of = [value(data, name) if name else 1.0 for name in law.of]
    of += [1.0] * (ARGUMENTS - len(of))
    a, b, c, d, e = of
    return computed_number(law.law, law.factor, a, b, c, d, e)


def _write(memory: Words, place: Place, law: Law, data: Control) -> None:
    into = memory if place.whole else memory.view(np.float64)
    into[place.word] = evaluated(law, data)


def _changed(data: Control, name: str, to: float) -> Control:
    """Return a control with one number replaced, unchecked."""
    plain, _, row = name.partition("[")
    section, _, field = plain.rpartition(".")
    holder = getattr(data, section) if section else data
    now = getattr(holder, field)
    new: Any = type(now)(to) if not row else [*now]
    if row:
        new[_index(name)] = to
    made = holder.model_copy(update={field: new})
    return data.model_copy(update={section: made}) if section else cast(Control, made)


def _whole_words() -> NDArray[np.bool_]:
    """Return which words of a control are integers."""
    marked = np.ones(1, CONTROL)  # 1 as an integer differs from 1 as a double
    return np.asarray(np.frombuffer(marked.tobytes(), np.int64) == 1, np.bool_)
