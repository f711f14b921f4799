"""A draft rig for a model: a commented rig file in which all guesses are listed.

Computed from the model are its trim, the controls that a rig can move, and its speed range. The
rest are guesses of three classes by empty mass, from the shipped rigs of a light aircraft, a
trainer and a jet transport. The column's gradient increases with q̄, as for a reversible control,
up to a greatest force at full travel; K is that of Cleveland's report.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from coupled.record.channels import SURFACES, ControlName, unit_of
from coupled.rig.bounds import pressure_at
from coupled.rig.rigwrite import toml_string
from coupled.surveying.survey import Surveyed

BEND_m_per_N = 9.136e-5  # 0.016 in/lb, the report's column
RIM_m = 0.15  # a wheel's radius
_MOST_BENT = 0.3  # of the travel, at the stiffest gradient: K·G_T


HOW_TO_SETTLE = (
    "# Put your own numbers in their place, and take their keys out of `guesses`: tables and",
    "# figures name what is still in it.",
)


@dataclass(frozen=True)
class Hardware:
    """Guessed values of one control: SI, at the grip; for a wheel at the rim, by the angle."""

    travel: float
    mass: float
    damping: float
    breakout_N: float
    friction_N: float
    full_force_N: float  # at full travel and the highest q̄


@dataclass(frozen=True)
class Kind:
    """A class of aircraft, up to an empty mass."""

    name: str
    most_kg: float
    controls: dict[str, Hardware]


_KINDS = (
    Kind(
        "a light aircraft, as the shipped c172p",
        2500.0,
        {
            "column": Hardware(0.10, 4.0, 120.0, 2.0, 2.0, 330.0),
            "wheel": Hardware(1.40, 0.15, 3.3, 2.0, 2.0, 100.0),
            "pedals": Hardware(0.07, 4.0, 120.0, 15.0, 5.0, 300.0),
        },
    ),
    Kind(
        "a trainer or fighter, as the shipped t37",
        20000.0,
        {
            "column": Hardware(0.14, 4.0, 75.0, 2.0, 2.0, 300.0),
            "wheel": Hardware(0.24, 1.0, 16.0, 2.0, 2.0, 100.0),
            "pedals": Hardware(0.08, 5.0, 140.0, 10.0, 5.0, 500.0),
        },
    ),
    Kind(
        "a transport, as the shipped b747",
        1e9,
        {
            "column": Hardware(0.16, 6.0, 100.0, 38.0, 12.0, 500.0),
            "wheel": Hardware(1.53, 0.25, 4.0, 13.0, 9.0, 80.0),
            "pedals": Hardware(0.10, 5.0, 140.0, 85.0, 15.0, 350.0),
        },
    ),
)


def kind_of(mass_kg: float) -> Kind:
    """Return the class of an empty mass; 0 stands for an unknown mass."""
    return next(kind for kind in _KINDS if mass_kg <= kind.most_kg)


def draft(found: Surveyed, name: str, folder: str = "", airframe_only: bool = False) -> str:
    """Return the text of a draft rig file for a surveyed model that trims.

    `folder` is the folder of models of a user's own model, relative to the rig file.
    `airframe_only` omits the controls.
    """
    if airframe_only:
        head = [f"# {found.model}: an aircraft without controls, written by `coupled new rig`."]
        head += ["", f"name = {toml_string(name)}", "frame_rate_Hz = 120.0"]
        return "\n".join([*head, *_flight(found, folder), ""])
    kind = kind_of(found.mass_kg)
    said = f"its empty mass of {found.mass_kg:,.0f} kg" if found.mass_kg else "no mass in its file"
    lines = [
        f"# {found.model}: a first rig, written by `coupled new rig`.",
        "#",
        "# Found: where it trims, which controls move it. Guessed: all that `guesses` lists, as",
        f"# for {kind.name} (by {said}).",
        *HOW_TO_SETTLE,
    ]
    lines += ["", f"name = {toml_string(name)}", "frame_rate_Hz = 120.0", *_flight(found, folder)]
    for control in found.controls:
        lines += _control(control, kind.controls[control], found)
    for lack in found.lacking:
        lines += ["", f"# {lack}"]
    return "\n".join([*lines, ""])


def _flight(found: Surveyed, folder: str) -> list[str]:
    flight = found.flight
    assert flight is not None
    holds = "holds it hands off" if found.holds else "does not hold it hands off: fly short runs"
    lines = ["", "[flight]", f"model = {toml_string(flight.model)}"]
    if folder:
        lines.append(f"model_folder = {toml_string(folder)}  # where {flight.model}/ lies")
    if flight.model_file:
        lines.append(f"model_file = {toml_string(flight.model_file)}")
    lines.append(f"altitude_m = {flight.altitude:g}               # it trims here, and {holds}")
    speed = f"calibrated_airspeed_m_per_s = {flight.calibrated_airspeed:g}"
    if found.slowest < found.fastest:
        speed += (
            f"  # it trims and answers from {found.slowest:g} to {found.fastest:g} m/s, as tried"
        )
    lines.append(speed)
    if not flight.direct_controls:
        lines.append("direct_controls = false         # a law or lag of the model's own is between")
    if flight.properties:
        lines += ["", "[flight.properties]"]
        lines += [f'"{key}" = {value!r}  # gear up' for key, value in flight.properties.items()]
    return lines


def _control(control: ControlName, guess: Hardware, found: Surveyed) -> list[str]:
    low, high = pressure_at(found.slowest), pressure_at(found.fastest)
    bend, origin = {
        "column": (BEND_m_per_N, "K of Cleveland's column"),
        "wheel": (BEND_m_per_N / RIM_m, "K of Cleveland's column over the rim's radius"),
        "pedals": (0.5 * BEND_m_per_N, "half of K of Cleveland's column"),
    }[control]
    stiffest = min(guess.full_force_N / guess.travel, _MOST_BENT / bend)
    softest = max(stiffest * low / high, 0.05 * stiffest)
    rows = (low, high) if high > 1.05 * low else (0.0, high)
    gradients = (softest, stiffest) if high > 1.05 * low else (stiffest, stiffest)
    flight = found.flight
    surface = flight.surfaces.get(control) if flight else None
    return control_lines(
        control,
        guess,
        position=surface.position if surface else (),
        gradients=gradients,
        pressures=rows,
        bend=bend,
        remarks={
            "loader.basic_gradient": "the softest of the schedule",
            "loader.bend": origin,
            "schedule": "q̄ at the slowest and the fastest trim; gradients in proportion to it",
        },
    )


def control_lines(
    control: ControlName,
    hardware: Hardware,
    *,
    gradients: Sequence[float],
    pressures: Sequence[float],
    bend: float,
    position: Sequence[str] = (),
    servo: bool = True,
    known: Collection[str] = (),
    remarks: Mapping[str, str] | None = None,
) -> list[str]:
    """Return the lines of a control of a rig file: SI, at the grip.

    `known` are the fields, as `loader.mass`, that were measured: all others are listed as
    guesses. `position` are the model's own properties of the surface. `remarks` are comments by
    field, and "schedule" for one above its table.
    """
    d, at, said = unit_of(control), f"controls.{control}", remarks or {}
    length = RIM_m if d == "rad" else 0.6
    loader: list[tuple[str, str, float]] = [
        ("loader.mass", "mass_kg", hardware.mass),
        ("loader.damping", f"damping_N_s_per_{d}", hardware.damping),
        ("loader.basic_gradient", f"basic_gradient_N_per_{d}", gradients[0]),
        ("loader.breakout", "breakout_N", hardware.breakout_N),
        ("loader.friction", "friction_N", hardware.friction_N),
    ]
    if servo:
        loader += [
            ("loader.servo_frequency", "servo_frequency_Hz", 18.0),
            ("loader.servo_damping_ratio", "servo_damping_ratio", 0.7),
        ]
    loader.append(("loader.bend", f"bend_{d}_per_N", bend))
    own = [("travel", f"travel_{d}", hardware.travel), ("length", "length_m", length)]
    schedule = ("schedule.total_gradient", f"total_gradient_N_per_{d}")
    keys = {field: key for field, key, _ in own}
    keys |= {field: f"loader.{key}" for field, key, _ in loader}
    keys[schedule[0]] = f"schedule.{schedule[1]}"
    keys["compensation.bend"] = f"compensation.bend_{d}_per_N"
    guesses = [f'    "{key}",' for field, key in keys.items() if field not in known]

    def row(field: str, key: str, value: float) -> str:
        remark = f"  # {said[field]}" if field in said else ""
        return f"{key} = {value:.5g}{remark}"

    def numbers(values: Sequence[float]) -> str:
        return "[" + ", ".join(f"{value:.5g}" for value in values) + "]"

    return [
        "",
        f"[{at}]",
        f'surface = "{SURFACES[control]}"',
        *([f"surface_property = [{', '.join(map(toml_string, position))}]"] if position else []),
        *(row(*each) for each in own),
        *(["guesses = [", *guesses, "]"] if guesses else []),
        "",
        f"[{at}.loader]",
        'multiplier = "hybrid"',
        *(row(*each) for each in loader),
        "",
        f"[{at}.schedule]",
        *([f"# {said['schedule']}"] if "schedule" in said else []),
        f"dynamic_pressure_Pa = [{', '.join(f'{pressure:.0f}.0' for pressure in pressures)}]",
        f"{schedule[1]} = {numbers(gradients)}",
        "",
        f"[{at}.compensation]",
        "deflection = true",
        "gradient = true",
        f"bend_{d}_per_N = {bend:.4g}  # K as the host assumes it",
    ]
