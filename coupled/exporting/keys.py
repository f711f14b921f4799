"""The keys of a rig in an export: every key of its file is listed here, or refused by name.

All sections are walked by their declared parameters. A key at its default leaves out an effect and
needs nothing in the export; any other must be listed below. So a new key of a rig is refused until
the export supports it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from coupled.errors import InputError
from coupled.flight.altered import ALTERATIONS, alterations
from coupled.flight.loading import INERTIAS
from coupled.record.channels import unit_of
from coupled.rig.curves import Curve
from coupled.rig.parameters import (
    Calibration,
    Compensation,
    Control,
    Flight,
    Gains,
    Loader,
    Rigging,
    Schedule,
    Sensing,
)
from coupled.rig.rig import Rig
from coupled.rig.structure import Compliance, Structure
from coupled.schema import Section, file_keys

# Listed explicitly, not taken from the sections, so that new keys are not included.
EXPORTED: Mapping[type[Section], frozenset[str]] = {
    Rig: frozenset(("name", "frame_rate", "controls")),
    Control: frozenset(
        (
            *("surface", "travel", "travel_pull", "travel_push", "length"),
            *("command_property", "surface_property"),
        )
    ),
    Loader: frozenset(
        (
            *("mass", "damping", "basic_gradient", "breakout", "friction", "breakaway"),
            *("stribeck_rate", "bob_weight", "offset", "cubic", "delay", "multiplier"),
            *("multiplier_offset", "multiplier_drift", "modifying_lag", "servo_frequency"),
            *("servo_damping_ratio", "servo_rate_limit", "bend", "bend_push", "bend_limit"),
            *("bend_hysteresis_share", "bend_hysteresis_width", "play", "arc_geometry"),
            *("stop_aft", "stop_forward"),
        )
    ),
    Schedule: frozenset(
        (
            *("dynamic_pressure", "total_gradient", "second_gradient", "break_deflection"),
            *("deflection", "force", "pressure_scale", "pressure_lag", "slope"),
        )
    ),
    Compensation: frozenset(
        (
            *("deflection", "gradient", "bend", "basic_gradient", "breakout", "breakout_term"),
            *("inertia_gradient", "mass_factor", "damping_factor", "force_lead", "force_lead_lag"),
        )
    ),
    Sensing: frozenset(
        (
            *("computed_scale", "deflection_scale", "modifying_scale", "force_scale"),
            *("word_length", "full_scale", "s1", "s2", "s3"),
        )
    ),
    Rigging: frozenset(("stretch_loss", "lag", "rate_limit", "play", "offset")),
    Structure: frozenset(
        (
            *("column_by_wheel", "column_by_pedals", "wheel_by_column", "wheel_by_pedals"),
            *("pedals_by_column", "pedals_by_wheel"),
        )
    ),
    Compliance: frozenset(
        (
            *("column_by_wheel", "column_by_pedals", "wheel_by_column", "wheel_by_pedals"),
            *("pedals_by_column", "pedals_by_wheel"),
        )
    ),
    Flight: frozenset(
        (
            *("model", "folder", "model_file", "altitude", "calibrated_airspeed", "flight_path"),
            *("trim", "properties", "direct_controls", "steps_per_frame", "cg_aft", "fuel"),
            *("terms", *(alteration.part.name for alteration in ALTERATIONS)),
        )
    ),
}

# Keys without an effect in flight, or in JSBSim.
WITHOUT_EFFECT: Mapping[type[Section], Mapping[str, str]] = {
    Rig: {
        "loader_rate": "the export chooses the loader's rate itself",
        "noise": "noise of the record; the export's channels have none",
    },
    Control: dict.fromkeys(
        ("tolerance", "guesses"), "how well the numbers are known; nothing in flight depends on it"
    ),
    Gains: dict.fromkeys(
        ("mechanical_advantage", "s1_over_s2", "s3_over_s2", "low_gradient"),
        "a note of the bench; nothing in flight depends on it",
    ),
    Calibration: dict.fromkeys(
        (
            *("readings", "date", "s1", "s1_error", "s2", "s2_error", "s3", "s3_error"),
            *("bend", "bend_error", "length", "mechanical_advantage", "s1_over_s2", "s3_over_s2"),
        ),
        "a note of the bench; nothing in flight depends on it",
    ),
    Structure: {"reciprocal": "a check of the file"},
    Flight: {"landing": "JSBSim alone goes on after it meets the ground"},
    Sensing: dict.fromkeys(
        ("gauge_order", "gauge_damping_ratio"), "without effect if there is no gauge"
    ),
}

# Keys that are not exported, with the reason.
REFUSED: Mapping[type[Section], Mapping[str, str]] = {
    Loader: {"friction_stiffness": "friction that yields before it slips is not exported"},
    Sensing: {
        **dict.fromkeys(
            ("gauge_mass", "gauge_frequency", "gauge_delay", "gauge_sampling"),
            "a gauge between grip and loader is not exported",
        ),
        **dict.fromkeys(
            ("computed_skew", "force_skew", "gradient_skew"),
            "a skew within the host's frame is not exported",
        ),
    },
    Flight: {
        **dict.fromkeys(
            ("gust_rms", "lateral_gust_rms", "gust_length"),
            "gusts drawn from a seed are not exported; use [turbulence]",
        ),
        "mass": "a ballast is not exported; put its weight into the model's file",
        **dict.fromkeys(INERTIAS, "is not exported; put the inertia into the model's file"),
    },
}

# Keys that are approximated if not neutral, with the error.
APPROXIMATED: Mapping[str, str] = {
    "loader.delay": "the delayed force is taken as straight between the ends of JSBSim's runs",
    "structure": "of a control that comes later in the order column, wheel, pedals, the force of"
    " the run before bends at an earlier one",
}


def check_keys(rig: Rig, file: object) -> list[str]:
    """Return the keys left out, with the reason; raises InputError for a key not exported."""
    left = list[str]()
    for name, control in rig.controls.items():
        for key in ("command_property", "surface_property"):
            _check_property(getattr(control, key), file, f"controls.{name}.{key}")
    for section, path, d in _sections(rig):
        left += _check_section(section, path, d, file)
    return left


def _check_property(given: str | list[str], file: object, key: str) -> None:
    """Refuse what is not one property of JSBSim's sign, in rad where it is a position."""
    names = [given] if isinstance(given, str) else given
    if len(names) > 1 or any(name.startswith("-") or name.endswith("deg") for name in names):
        problem = "several properties, or one with - or in deg, are not exported; name one"
        raise InputError(file, key, problem)


def _sections(rig: Rig) -> Iterator[tuple[Section, str, str]]:
    """Yield all sections of a rig with their dotted paths, and their unit of deflection."""
    waiting: list[tuple[Section, str, str]] = [(rig, "", "m")]
    while waiting:
        section, path, d = waiting.pop()
        yield section, path, d
        for name in file_keys(type(section), d).values():
            value = getattr(section, name)
            at = f"{path}.{name}" if path else name
            inner = value.items() if isinstance(value, dict) else [("", value)]
            for key, one in inner:
                if isinstance(one, Section):
                    unit = unit_of(key) if name == "controls" else d
                    waiting.append((one, f"{at}.{key}" if key else at, unit))


def _check_section(section: Section, path: str, d: str, file: object) -> list[str]:
    kind = type(section)
    if isinstance(section, Curve):
        if section.nodes:
            problem = "a curve is not exported to JSBSim; remove the table, or export an FMU"
            raise InputError(file, path, problem)
        return []
    exported = EXPORTED.get(kind, frozenset())
    without, refused = WITHOUT_EFFECT.get(kind, {}), REFUSED.get(kind, {})
    left = list[str]()
    for key, name in file_keys(kind, d).items():
        field, value = kind.model_fields[name], getattr(section, name)
        dotted = f"{path}.{key}" if path else key
        if isinstance(value, Section):  # its own keys are checked
            continue
        if name in exported or value == field.get_default(call_default_factory=True):
            continue
        if name in without:
            left.append(f"{dotted}: {without[name]}")
        elif name in refused:
            default = field.get_default(call_default_factory=True)
            raise InputError(file, dotted, f"{refused[name]}; leave it at {default!r}")
        else:
            default = field.get_default(call_default_factory=True)
            problem = f"is not exported, nor left out in silence: leave it at {default!r}"
            raise InputError(file, dotted, problem)
    return left


def is_scripted(rig: Rig) -> list[str]:
    """Return the settings of a rig's aircraft made by scripts only, a line each with key and why.

    Without a script, as in FlightGear, the exported aircraft does not have them.
    """
    flight = rig.flight
    if flight is None:
        return []
    found = [
        f"flight.properties: {name} = {value:g}, set before the trim"
        for name, value in flight.properties.items()
    ]
    for part, factor, about_trim in alterations(flight):
        if about_trim is not None:
            found.append(f"flight.{part.name} = {factor:g}: it counts about the place in trim")
    return found


def approximated(rig: Rig) -> list[str]:
    """Return the approximated parts of a rig, with the approximation."""
    found = list[str]()
    for name, control in rig.controls.items():
        if control.loader.delay > 0.0:
            found.append(f"controls.{name}.loader.delay_s: {APPROXIMATED['loader.delay']}")
    if not rig.structure.stands_apart:
        found.append(f"structure: {APPROXIMATED['structure']}")
    return found
