"""A rig file, read and checked: every fault is one line with its key.

Beyond each value's own bounds this refuses what the physics cannot give: a gradient
stiffer than the structure (K·G_T ≥ 1, where eq. (12) is singular), a table that does
not rise, a converter that the signal would overflow.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from coupled.errors import InputError, nearest
from coupled.record.channels import CONTROL_NAMES, SURFACES, noisy_channels, unit_of
from coupled.rig.loader import DELAY_SLOTS
from coupled.rig.parameters import Control, Flight, Rig
from coupled.rig.schedule import MAX_ROWS
from coupled.schema import build, file_keys, known_keys, load_toml


def read_rig(path: Path, changes: Mapping[str, Any] | None = None) -> Rig:
    """Return the rig of a file, with `changes` made to it: {dotted key: value}."""
    table = load_toml(path)
    for key, value in (changes or {}).items():
        if not change(table, key, value):
            raise InputError(path, key, "leads through a value, not a table")
    return rig_from_table(table, path)


def change(table: dict[str, Any], key: str, value: Any) -> bool:
    """Set a dotted key of a table of tables in place; false where it leads through a value."""
    *parents, last = key.split(".")
    for parent in parents:
        table = table.setdefault(parent, {})
        if not isinstance(table, dict):
            return False
    table[last] = copy.deepcopy(value)
    return True


def rig_from_table(table: Mapping[str, Any], file: object) -> Rig:
    """Return a rig from the tables of a rig file; `file` is named in faults."""
    known_keys(table, file_keys(Rig, "m"), file, "")
    controls = table.get("controls")
    if not isinstance(controls, dict) or not controls:
        raise InputError(file, "controls", f"needs at least one of {', '.join(CONTROL_NAMES)}")
    known_keys(controls, dict.fromkeys(CONTROL_NAMES), file, "controls")
    values = dict(table)
    values["controls"] = {
        name: build(Control, controls[name], file, f"controls.{name}", unit_of(name))
        for name in CONTROL_NAMES
        if name in controls
    }
    if "flight" in table:
        values["flight"] = build(Flight, table["flight"], file, "flight")
    rig = build(Rig, values, file, "")
    for name, control in rig.controls.items():
        _check_control(rig, name, control, file)
    _check_noise(rig, file)
    return rig


def _check_control(rig: Rig, name: str, control: Control, file: object) -> None:
    path = f"controls.{name}"
    d = unit_of(name)
    if control.surface != SURFACES[name]:
        raise InputError(
            file, f"{path}.surface", f"a {name} moves the {SURFACES[name]}, not {control.surface}"
        )
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
    if loader.arc_geometry and d == "rad":
        raise InputError(
            file, f"{path}.loader.arc_geometry", "a wheel's deflection is an angle already"
        )
    if loader.arc_geometry and control.length <= 2.0 * control.travel / 3.14159:
        raise InputError(
            file, f"{path}.length_m", "the arc's length must exceed 2/π of the travel on it"
        )
    _check_schedule(control, file, path, d)
    _check_converters(control, file, path, d)


def _check_schedule(control: Control, file: object, path: str, d: str) -> None:
    schedule, key = control.schedule, f"{path}.schedule"
    pressures = schedule.dynamic_pressure
    if len(pressures) > MAX_ROWS:
        raise InputError(file, f"{key}.dynamic_pressure_Pa", f"has more than {MAX_ROWS} rows")
    if any(b <= a for a, b in pairwise(pressures)):
        raise InputError(file, f"{key}.dynamic_pressure_Pa", "must rise from value to value")
    tables = {f"total_gradient_N_per_{d}": schedule.total_gradient}
    if schedule.second_gradient is not None:
        tables[f"second_gradient_N_per_{d}"] = schedule.second_gradient
    if (schedule.second_gradient is None) != (schedule.break_deflection == 0.0):
        raise InputError(
            file,
            f"{key}.break_deflection_{d}",
            f"a second segment needs both break_deflection_{d} and second_gradient_N_per_{d}",
        )
    bends = {
        f"{path}.loader.bend_{d}_per_N": control.loader.bend,
        f"{path}.compensation.bend_{d}_per_N": control.compensation.bend,
    }
    for table_key, gradient in tables.items():
        if len(gradient) != len(pressures):
            raise InputError(
                file,
                f"{key}.{table_key}",
                f"has {len(gradient)} values, dynamic_pressure_Pa {len(pressures)}; give as many",
            )
        sloped = [gradient[0] + schedule.slope * (g - gradient[0]) for g in gradient]
        if min(sloped) < 0.0:
            raise InputError(file, f"{key}.{table_key}", "a gradient cannot be negative")
        for bend_key, bend in bends.items():
            if bend * max(sloped) >= 1.0:
                where = pressures[sloped.index(max(sloped))]
                raise InputError(
                    file,
                    bend_key,
                    f"K·G_T = {bend * max(sloped):.3g} at {where:g} Pa: no gradient stiffer than"
                    f" the structure can be given; K must stay below {1.0 / max(sloped):.3g}"
                    f" {d}/N, or {table_key} below {1.0 / bend:.4g}",
                )


def _check_converters(control: Control, file: object, path: str, d: str) -> None:
    sensing, key = control.sensing, f"{path}.sensing"
    if sensing.word_length == 0:
        return
    scales = {f"s1_V_per_{d}": sensing.s1, "s2_V_per_N": sensing.s2, "s3_V_per_N": sensing.s3}
    for name, scale in scales.items():
        if scale <= 0.0:
            raise InputError(file, f"{key}.{name}", "must be given where word_length_bits is")
    if sensing.s1 * control.travel * sensing.deflection_scale > sensing.full_scale:
        raise InputError(
            file,
            f"{key}.s1_V_per_{d}",
            f"full travel is {sensing.s1 * control.travel:.4g} V, beyond the converter's"
            f" {sensing.full_scale:g} V; give at most {sensing.full_scale / control.travel:.4g}",
        )


def _check_noise(rig: Rig, file: object) -> None:
    channels = noisy_channels(list(rig.controls), rig.flight is not None)
    for channel, level in rig.noise.items():
        if channel not in channels:
            hint = nearest(channel, channels)
            raise InputError(file, f"noise.{channel}", f"no such channel; {hint}")
        if level < 0.0:
            raise InputError(file, f"noise.{channel}", "a standard deviation cannot be negative")
