"""A control-loading rig: its data, their physical limits, and changes to them.

Beyond each value's own bounds a rig is refused if it is physically impossible: a gradient stiffer
than the structure (K̂·G_T ≥ 1, where eq. (12) is singular), a table that does not rise, a converter
that the signal would overflow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import PrivateAttr, ValidationError

from coupled.arguments import public
from coupled.errors import MISSING, InputError, MissingKeyError, nearest, shown_value
from coupled.files import check_target, write_text
from coupled.record.channels import (
    CONTROL_NAMES,
    SURFACES,
    control_channels,
    noisy_channels,
    unit_of,
)
from coupled.resources import aircraft_folder
from coupled.results import Result
from coupled.rig.bounds import check_bounds
from coupled.rig.curves import check_curves
from coupled.rig.guesses import check_guesses
from coupled.rig.parameters import (
    DELAY_SLOTS,
    GAUGE_SLOTS,
    MAX_NODES,
    MAX_ROWS,
    Control,
    Schedule,
)
from coupled.rig.rigdata import RigData
from coupled.rig.rigedit import updated
from coupled.rig.rigwrite import rig_text
from coupled.rig.structure import Structure, check_structure
from coupled.schema import (
    Section,
    build,
    changed,
    faults_of,
    file_keys,
    grouped,
    known_keys,
)


@public
class Rig(RigData, Result):
    """A control-loading rig, and the aircraft that it is coupled to.

    Without `flight` it is a bench: q̄ is given, and there is no aircraft. `noise` has the standard
    deviation of a channel's white noise by the channel's name. SI throughout.

    A number has one name, its dotted key in a rig file, which ends in its unit: `rig[key]` reads
    it, `changed` replaces it, `save` writes it.

    >>> import coupled
    >>> rig = coupled.load_rig("t37").changed({"controls.column.loader.play_m": 1e-3})
    >>> rig["controls.column.loader.play_m"], list(rig.only("column").controls)
    (0.001, ['column'])
    >>> rig
    Rig(t37: column, wheel, pedals at 120 Hz; T37)
    >>> rig.changed({"controls.column.loader.mass_kg": -1.0})
    Traceback (most recent call last):
    coupled.errors.InputError: t37: controls.column.loader.mass_kg: input should be greater than 0…
    """

    _WANTED: ClassVar[str] = "a Rig (coupled.load_rig returns one)"
    _filed: tuple[Path, str] | None = PrivateAttr(None)  # the file that it came from, and its text

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise faults_of(error, type(self), "coupled.Rig") from None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Rig):
            return NotImplemented
        return all(getattr(self, name) == getattr(other, name) for name in Rig.model_fields)

    def __hash__(self) -> int:
        return hash((self.name, self.frame_rate, self.loader_rate))

    def __repr__(self) -> str:
        aircraft = "no aircraft" if self.flight is None else self.flight.model
        controls = ", ".join(self.controls) or "no control"
        return f"Rig({self.name}: {controls} at {self.frame_rate:g} Hz; {aircraft})"

    def __getitem__(self, key: str) -> Any:
        """Return a value, or a whole section, by its dotted key in a rig file.

        Raises InputError, which is a KeyError too, where the rig has no such key.
        """
        if not isinstance(key, str):
            raise MissingKeyError(
                self.name, "key", f"is {shown_value(key)}; give a key of a rig file"
            )
        found: Any = self
        d, place = "m", ""
        for part in key.split("."):
            held: Mapping[str, Any] = found if isinstance(found, dict) else {}
            if isinstance(found, Section):
                held = {k: getattr(found, f) for k, f in file_keys(type(found), d).items()}
            if part not in held:
                raise MissingKeyError(self.name, key, _no_key(part, place, held))
            d = unit_of(part) if place == "controls" else d
            found, place = held[part], f"{place}.{part}" if place else part
        return found

    @property
    def file(self) -> Path | None:
        """The file that the rig came from, if any."""
        return None if self._filed is None else self._filed[0]

    @property
    def place(self) -> str:
        """The rig in error messages: its file; its name if it is shipped or has no file."""
        shipped = self.file is None or self.file.is_relative_to(aircraft_folder())
        return self.name if shipped else str(self.file)

    @property
    def substeps(self) -> int:
        """The number of loader steps in a frame."""
        return max(1, -int(-self.loader_rate // self.frame_rate))

    def changed(self, changes: Mapping[str, Any]) -> Rig:
        """Return the rig with some values replaced: {dotted key of a rig file: value}.

        A key is that of a rig file, with its unit at its end, such as
        `controls.column.loader.play_m`. A value may also be a whole table, a section of another
        rig, or None to remove the aircraft. Raises InputError as a rig file does, with the name of
        this rig and the key.
        """
        return with_values(self, changes)

    def to_toml(self) -> str:
        """Return the text of a rig file, with the comments of the file that the rig came from."""
        return self._text(None)

    def save(self, file: str | PathLike[str], remark: str = "") -> None:
        """Write the rig as a rig file, with the comments of the file that it came from.

        Read again, the file gives this rig. `remark` goes to its head. A file that is there is
        replaced. Raises InputError where the name does not end in .toml, or it cannot be written.
        """
        path = Path(file)
        if path.suffix.lower() != ".toml":
            raise InputError(path, "", "a rig file ends in .toml")
        check_target(path)
        head = "".join(f"# {line}".rstrip() + "\n" for line in remark.splitlines())
        write_text(path, head + self._text(path.parent))

    def _text(self, folder: Path | None) -> str:
        """Return the rig file's text, to lie in a folder."""
        if self._filed is None:
            return rig_text(self)
        file, text = self._filed
        return updated(text, self, file, folder)

    def only(self, control: str) -> Rig:
        """Return the rig with one control only, no aircraft, no noise and no common structure.

        Raises InputError if the rig has no such control.
        """
        if control not in self.controls:
            problem = f"the rig has no {control}; {nearest(control, self.controls)}"
            raise InputError(self.name, "controls", problem)
        kept = {name: data for name, data in self.controls.items() if name == control}
        alone = {"controls": kept, "flight": None, "noise": {}, "structure": Structure()}
        return of_file(changed(self, alone, self.name), self._filed)


def of_file(rig: Rig, filed: tuple[Path, str] | None) -> Rig:
    """Return the rig with the file that it came from, and its text, whose comments `save` keeps."""
    rig._filed = filed
    return rig


def _no_key(part: str, place: str, held: Mapping[str, Any]) -> str:
    if not held and place:
        return f"{place} has nothing within it"
    return f"no {part!r}; {nearest(part, held)}"


def with_values(rig: Rig, changes: Mapping[str, Any]) -> Rig:
    """Return what `Rig.changed` does, for code that calls it with a mapping of keys."""
    plain = dict(changes)
    controls = {key: plain.pop(key) for key in changes if key.split(".")[0] == "controls"}
    if controls:
        plain["controls"] = _changed_controls(rig, controls)
    return of_file(checked(changed(rig, plain, rig.name), rig.name), rig._filed)


def _changed_controls(rig: Rig, changes: Mapping[str, Any]) -> dict[str, Control]:
    """Return the rig's controls with some of their values replaced, by dotted keys."""
    if "controls" in changes:
        given = known_keys(changes["controls"], dict.fromkeys(CONTROL_NAMES), rig.name, "controls")
        return {name: _control(rig, name, given[name]) for name in CONTROL_NAMES if name in given}
    controls: dict[str, Control] = {str(name): control for name, control in rig.controls.items()}
    inner = {key.partition(".")[2]: value for key, value in changes.items()}
    for name, values in grouped(inner).items():
        if name not in rig.controls:
            problem = f"the rig has no {name}; {nearest(name, rig.controls)}"
            raise InputError(rig.place, f"controls.{name}", problem)
        if "" in values:
            controls[name] = _control(rig, name, values[""])
        else:
            path = f"controls.{name}"
            controls[name] = changed(controls[name], values, rig.name, path, unit_of(name))
    return controls


def _control(rig: Rig, name: str, given: Any) -> Control:
    """Return a control given as a section or as its table."""
    if isinstance(given, Control):
        return given
    return build(Control, given, rig.name, f"controls.{name}", unit_of(name))


def checked(rig: Rig, file: object) -> Rig:
    """Return the rig; raises InputError with `file` for a physically impossible one."""
    if not rig.controls and rig.flight is None:
        raise InputError(file, "controls", "a rig needs a control or an aircraft ([flight])")
    for name, control in rig.controls.items():
        _check_control(rig, name, control, file)
    check_structure(rig.structure, {str(n): c for n, c in rig.controls.items()}, file)
    _check_noise(rig, file)
    return rig


def _check_control(rig: Rig, name: str, control: Control, file: object) -> None:
    path = f"controls.{name}"
    d = unit_of(name)
    if control.surface != SURFACES[name]:
        raise InputError(
            file, f"{path}.surface", f"a {name} moves the {SURFACES[name]}, not {control.surface}"
        )
    for side in ("travel_pull", "travel_push"):
        if getattr(control, side) > control.travel:
            problem = f"is above travel_{d} = {control.travel:g}, which is that of the longer side"
            raise InputError(file, f"{path}.{side}_{d}", problem)
    loader = control.loader
    if 0 < loader.breakaway < loader.friction:
        raise InputError(
            file,
            f"{path}.loader.breakaway_N",
            f"{loader.breakaway} is below friction_N = {loader.friction}; give at least that"
            " (or 0 for plain Coulomb friction)",
        )
    if loader.delay * rig.frame_rate * rig.substeps > DELAY_SLOTS - 2:
        raise InputError(
            file, f"{path}.loader.delay_s", "is too long for this loader_rate_Hz; lower either"
        )
    if loader.servo_delay * rig.frame_rate * rig.substeps > DELAY_SLOTS - 2:
        raise InputError(
            file,
            f"{path}.loader.servo_delay_s",
            "is too long for this loader_rate_Hz; lower either",
        )
    if loader.arc_geometry and d == "rad":
        raise InputError(
            file, f"{path}.loader.arc_geometry", "a wheel's deflection is an angle already"
        )
    if loader.arc_geometry and control.length <= 2.0 * control.travel / math.pi:
        raise InputError(
            file, f"{path}.length_m", "the arc's length must exceed 2/π of the travel on it"
        )
    for part in ("loader", "schedule", "sensing", "rigging"):
        check_curves(getattr(control, part), file, f"{path}.{part}", d)
    _check_loader_curves(rig, control, file, f"{path}.loader", d)
    if loader.gravity > 0.0 and d == "m":
        problem = "acts on an axis that turns; this control moves along a line"
        raise InputError(file, f"{path}.loader.gravity_N", problem)
    _check_regressor(control, name, file, f"{path}.loader")
    _check_servo(control, file, path)
    if loader.servo_frequency == 0.0:
        _check_without_servo(control, file, path, d)
    _check_dynamics(rig, control, file, path)
    _check_inertia(control, file, path, d)
    _check_schedule(control, file, path, d)
    check_bounds(rig, control, file, path, d)
    _check_converters(control, file, path, d)
    _check_tolerance(control, file, path, d)
    check_guesses(control, file, path, d)


def _check_regressor(control: Control, name: str, file: object, path: str) -> None:
    """Refuse a regressor that the loader itself moves, and numbers of one that is not named."""
    loader = control.loader
    if loader.regressor in control_channels(name):
        problem = f"is a channel of the {name} itself; give another, as a temperature"
        raise InputError(file, f"{path}.regressor", problem)
    for key in ("force_N_per_unit", "friction_N_per_unit"):
        field = "regressor_" + key.partition("_")[0]
        if loader.regressor is None and getattr(loader, field) != 0.0:
            problem = "needs the name of a channel; give regressor"
            raise InputError(file, f"{path}.regressor_{key}", problem)


def _check_loader_curves(rig: Rig, control: Control, file: object, path: str, d: str) -> None:
    """Refuse curves by which the grip moves against the force, or which no step can follow."""
    loader, rate_Hz = control.loader, rig.frame_rate * rig.substeps
    least = loader.least_bend
    if (slope := min(loader.bend_curve.slopes, default=0.0)) < -least:
        problem = f"falls by {-slope:.3g} {d}/N, and K is {least:.3g} {d}/N: the grip may not move"
        problem = f"{problem} against the force; of a reading give sensing.grip_load_curve"
        raise InputError(file, f"{path}.bend_curve.bend_{d}", problem)
    if (slope := max(loader.load_curve.slopes, default=0.0)) > 0.9 - loader.friction_by_load:
        problem = f"rises by {slope:.3g} N/N; with friction_by_load it may rise by 0.9 at most"
        raise InputError(file, f"{path}.load_curve.friction_N", problem)
    most = loader.mass * rate_Hz**2  # half of what the implicit step can follow
    if (slope := min(loader.force_curve.slopes, default=0.0)) < -most:
        problem = f"falls by {-slope:.3g} N/{d}; at this mass and loader_rate_Hz give at most"
        raise InputError(file, f"{path}.force_curve.force_N", f"{problem} {most:.3g}")
    most, curve = loader.mass * rate_Hz, loader.friction_curve
    if not curve.nodes:
        return
    other = curve.model_copy(update={"force": curve.force_push})
    for key, one in (("force_N", curve), ("force_push_N", other)):
        if one.values and (slope := min(one.slopes, default=0.0)) < -most:
            problem = f"falls by {-slope:.3g} N·s/{d}; at this mass and loader_rate_Hz give at most"
            raise InputError(file, f"{path}.friction_curve.{key}", f"{problem} {most:.3g}")


def _check_tolerance(control: Control, file: object, path: str, d: str) -> None:
    """Refuse a tolerance whose key is no number of the control."""
    for key, wide in control.tolerance.items():
        section, _, name = key.partition(".")
        holder = getattr(control, section, None)
        known = file_keys(type(holder), d) if isinstance(holder, Section) else {}
        value = getattr(holder, known.get(name, ""), None)
        if not isinstance(value, float):
            problem = 'is no number of the control; give its key, as "loader.mass_kg"'
            raise InputError(file, f"{path}.tolerance.{key}", problem)
        if wide <= 0.0:
            raise InputError(file, f"{path}.tolerance.{key}", "must be above 0")


def _check_dynamics(rig: Rig, control: Control, file: object, path: str) -> None:
    sensing, frame_s = control.sensing, 1.0 / rig.frame_rate
    if sensing.gauge_delay * rig.frame_rate * rig.substeps > GAUGE_SLOTS - 2:
        problem = "is too long for this loader_rate_Hz; lower either"
        raise InputError(file, f"{path}.sensing.gauge_delay_s", problem)
    for key in ("computed_skew", "force_skew", "gradient_skew"):
        if getattr(sensing, key) > frame_s:
            problem = f"must lie within the frame of {frame_s:g} s"
            raise InputError(file, f"{path}.sensing.{key}_s", problem)


def _check_servo(control: Control, file: object, path: str) -> None:
    """Refuse half of a servo: a frequency without a damping ratio, or the reverse."""
    given = control.loader.model_fields_set
    half = "leave out both for a machine without a servo"
    if "servo_frequency" not in given and "servo_damping_ratio" in given:
        problem = f"is missing beside servo_damping_ratio; give it, or {half}"
        raise InputError(file, f"{path}.loader.servo_frequency_Hz", problem)
    if control.loader.servo_frequency > 0.0 and "servo_damping_ratio" not in given:
        problem = f"is missing beside servo_frequency_Hz; give it, or {half}"
        raise InputError(file, f"{path}.loader.servo_damping_ratio", problem)


def _check_without_servo(control: Control, file: object, path: str, d: str) -> None:
    """Refuse parameters of a servo, on a rig without one."""
    loader, names = control.loader, ("servo_rate_share", "servo_acceleration_limit")
    for key, name in file_keys(type(loader), d).items():
        if name in names and getattr(loader, name) > 0.0:
            problem = "needs a servo; give servo_frequency_Hz, or 0 here"
            raise InputError(file, f"{path}.loader.{key}", problem)
    if control.sensing.gauge_mass > 0.0:
        problem = "needs a servo, which moves it (servo_frequency_Hz); without one, what lies"
        problem += " beyond the gauge is part of the loader's mass_kg"
        raise InputError(file, f"{path}.sensing.gauge_mass_kg", problem)


def _check_inertia(control: Control, file: object, path: str, d: str) -> None:
    host, table = control.compensation, control.compensation.inertia_gradient
    key = f"{path}.compensation.inertia_gradient_N_per_{d}"
    if table is None:
        for name in ("mass_factor", "damping_factor", "force_lead"):
            if getattr(host, name) is not None:
                problem = f"needs the gradients that it goes by: inertia_gradient_N_per_{d}"
                raise InputError(file, f"{path}.compensation.{_with_unit(name)}", problem)
        return
    if len(table) > MAX_ROWS:
        raise InputError(file, key, f"has more than {MAX_ROWS} rows")
    if any(b <= a for a, b in pairwise(table)):
        raise InputError(file, key, "must rise from value to value")
    for name in ("mass_factor", "damping_factor", "force_lead"):
        factors: list[float] | None = getattr(host, name)
        if factors is None:
            continue
        if len(factors) != len(table):
            problem = f"has {len(factors)} values, inertia_gradient_N_per_{d} {len(table)}"
            where = f"{path}.compensation.{_with_unit(name)}"
            raise InputError(file, where, f"{problem}; give as many")
        if name == "force_lead" and min(factors) < 0.0:
            raise InputError(file, f"{path}.compensation.force_lead_s", "a lead is not negative")
        if name != "force_lead" and min(factors) <= 0.0:
            raise InputError(file, f"{path}.compensation.{name}", "a factor must be above 0")


def _with_unit(name: str) -> str:
    return f"{name}_s" if name == "force_lead" else name


def _check_schedule(control: Control, file: object, path: str, d: str) -> None:
    schedule, key = control.schedule, f"{path}.schedule"
    pressures = schedule.dynamic_pressure
    if len(pressures) > MAX_ROWS:
        raise InputError(file, f"{key}.dynamic_pressure_Pa", f"has more than {MAX_ROWS} rows")
    if any(b <= a for a, b in pairwise(pressures)):
        raise InputError(file, f"{key}.dynamic_pressure_Pa", "must rise from value to value")
    tables = _segments(schedule, file, key, d)
    if (schedule.second_gradient is None) != (schedule.break_deflection == 0.0):
        raise InputError(
            file,
            f"{key}.break_deflection_{d}",
            f"a second segment needs both break_deflection_{d} and second_gradient_N_per_{d}",
        )
    # K̂ is limited, not K: a real structure may be softer than assumed, or it could not be found.
    bends = {f"{path}.compensation.bend_{d}_per_N": control.compensation.bend}
    if control.compensation.bend == 0.0:
        bends = {
            f"{path}.loader.bend_{d}_per_N": control.loader.bend,
            f"{path}.loader.bend_push_{d}_per_N": control.loader.bend_push or 0.0,
        }
    for (filed_key, between), gradient in zip(tables, schedule.segments, strict=True):
        if len(gradient) != len(pressures):
            raise InputError(
                file,
                f"{key}.{filed_key}",
                f"has {len(gradient)} values, dynamic_pressure_Pa {len(pressures)}; give as many",
            )
        sloped = [gradient[0] + schedule.slope * (g - gradient[0]) for g in gradient]
        table_key, sloped, places = _with_curve(schedule, filed_key, sloped)
        if min(sloped) < 0.0:
            lowest = places[sloped.index(min(sloped))]
            problem = (
                f"falls{between} at {lowest:g} Pa; a force may not fall as the deflection rises"
            )
            problem = problem if between else "a gradient cannot be negative"
            raise InputError(file, f"{key}.{table_key}", problem)
        for bend_key, bend in bends.items():
            if bend * max(sloped) >= 1.0:
                where = places[sloped.index(max(sloped))]
                limit = f"its gradient{between}" if between else table_key
                raise InputError(
                    file,
                    f"{key}.{table_key}" if between else bend_key,
                    f"K·G_T = {bend * max(sloped):.3g} at {where:g} Pa{between}: no gradient"
                    " stiffer than the structure can be given; K must stay below"
                    f" {1.0 / max(sloped):.3g} {d}/N, or {limit} below {1.0 / bend:.4g}"
                    f"{f' N/{d}' if between else ''}",
                )


def _with_curve(
    schedule: Schedule, key: str, sloped: list[float]
) -> tuple[str, list[float], list[float]]:
    """Return the key to blame, a segment's gradients with the curve added, and their pressures."""
    pressures, curve = schedule.dynamic_pressure, schedule.gradient_curve
    if not curve.nodes:
        return key, sloped, pressures
    places = sorted({0.0, *pressures, *curve.nodes})
    table = np.interp(places, pressures, sloped) + curve.at(np.array(places))
    return "gradient_curve", table.tolist(), places


def _segments(schedule: Schedule, file: object, key: str, d: str) -> list[tuple[str, str]]:
    """Return the key of each segment's table, and in words where a curve's segment lies."""
    nodes, forces = schedule.deflection, schedule.force
    if nodes is None and forces is None:
        both = (f"total_gradient_N_per_{d}", ""), (f"second_gradient_N_per_{d}", "")
        return list(both[: len(schedule.segments)])
    if nodes is None or forces is None:
        lacking = "force_N" if forces is None else f"deflection_{d}"
        problem = f"{MISSING}; a curve needs both deflection_{d} and force_N"
        raise InputError(file, f"{key}.{lacking}", problem)
    if schedule.total_gradient or schedule.second_gradient or schedule.break_deflection:
        problem = "is a curve beside gradients; give either force_N, or total_gradient_N_per_"
        raise InputError(file, f"{key}.force_N", f"{problem}{d} and what belongs to it")
    _check_nodes(nodes, file, f"{key}.deflection_{d}")
    if len(forces) != len(schedule.dynamic_pressure):
        rows = len(schedule.dynamic_pressure)
        problem = f"has {len(forces)} rows, dynamic_pressure_Pa {rows} values; give as many"
        raise InputError(file, f"{key}.force_N", problem)
    for pressure, row in zip(schedule.dynamic_pressure, forces, strict=True):
        if len(row) != len(nodes):
            problem = f"has {len(row)} values at {pressure:g} Pa, deflection_{d} {len(nodes)}"
            raise InputError(file, f"{key}.force_N", f"{problem}; give as many")
        if (begun := row[nodes.index(0.0)]) != 0.0:
            problem = f"is {begun:g} N at neutral, at {pressure:g} Pa; give 0 there"
            raise InputError(file, f"{key}.force_N", f"{problem}: breakout_N is the loader's")
    ends = [f" between {low:g} and {high:g} {d}" for low, high in pairwise(nodes)]
    return [("force_N", words) for words in ends]


def _check_nodes(nodes: list[float], file: object, key: str) -> None:
    """Refuse deflections of a curve that do not rise through, or from, zero."""
    if len(nodes) > MAX_NODES:
        raise InputError(file, key, f"has more than {MAX_NODES} values")
    if any(b <= a for a, b in pairwise(nodes)):
        raise InputError(file, key, "must rise from value to value")
    if 0.0 not in nodes or nodes[-1] == 0.0:
        problem = "should rise from 0, for the same curve to both sides, or from below through 0"
        raise InputError(file, key, problem)


def _check_converters(control: Control, file: object, path: str, d: str) -> None:
    sensing, key = control.sensing, f"{path}.sensing"
    if sensing.word_length == 0:
        return
    scales = {f"s1_V_per_{d}": sensing.s1, "s2_V_per_N": sensing.s2, "s3_V_per_N": sensing.s3}
    for name, scale in scales.items():
        if scale <= 0.0:
            raise InputError(file, f"{key}.{name}", "must be given where word_length_bits is")
    ends = sensing.deflection_curve.at(np.array([control.travel, -control.travel]))
    travel = float(np.abs(ends).max()) * sensing.read_scale  # as it is read
    if sensing.s1 * travel > sensing.full_scale:
        factors = {key: getattr(sensing, key) for key in ("computed_scale", "deflection_scale")}
        off = [f"{key} = {factor:g}" for key, factor in factors.items() if factor != 1.0]
        raise InputError(
            file,
            f"{key}.s1_V_per_{d}",
            f"full travel reads {sensing.s1 * travel:.4g} V"
            f"{' at ' + ' and '.join(off) if off else ''}, beyond the converter's"
            f" {sensing.full_scale:g} V; give at most {sensing.full_scale / travel:.4g}",
        )


def _check_noise(rig: Rig, file: object) -> None:
    channels = noisy_channels(list(rig.controls), rig.flight is not None)
    for channel, level in rig.noise.items():
        if channel not in channels:
            hint = nearest(channel, channels)
            raise InputError(file, f"noise.{channel}", f"no such channel; {hint}")
        if level < 0.0:
            raise InputError(file, f"noise.{channel}", "a standard deviation cannot be negative")
