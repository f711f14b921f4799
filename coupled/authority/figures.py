"""The figures of an outcome as text: their labels, units and formats, and remarks on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING

from coupled.authority.heldcontrol import breakaway_force
from coupled.display import Shown, System, drawn, parameter_label, percent, shown
from coupled.errors import listed
from coupled.record.channels import SURFACES, unit_of
from coupled.rig.guesses import guess_note
from coupled.units import DEGREE_rad

if TYPE_CHECKING:
    from coupled.authority.outcome import Flight, Outcome
    from coupled.flight.manoeuvre import Configuration, Manoeuvre

NONE = "–"  # in place of a missing figure
_NOTICED = 0.005  # of the hand's travel: the least further motion that is reported
_ALIKE = 0.05  # of the rigid rig's surface travel, within which two travels are alike
_MOST_DIGITS = 4  # of a travel in mm, ° or in
_LISTED = 3  # cases named in a sentence
_FORCES = ("step", "ramp", "doublet", "3211", "sweep", "table")  # pilots that apply a force
_WORDS = {"column": ("pitch", "pitch"), "wheel": ("roll", "bank"), "pedals": ("yaw", "heading")}


@dataclass(frozen=True)
class Figure:
    """A figure of an outcome: its field, its label with the unit, and its format."""

    field: str
    label: str
    form: Callable[[float], str]

    def written(self, outcome: Outcome, factor: float = 1.0) -> str:
        """Return the figure of an outcome as text; a dash if it has none, no sign before a zero.

        `factor` converts it to the unit of the text.
        """
        value = getattr(outcome, self.field)
        if value is None or not math.isfinite(value):
            return NONE
        text = self.form(factor * value)
        return text.lstrip("-") if float(text) == 0.0 else text


FIGURES: tuple[Figure, ...] = (
    Figure("asked_norm", "surface command, % travel", lambda x: f"{100 * abs(x):.2f}"),
    Figure("reached_norm", "surface reached, %", lambda x: f"{100 * abs(x):.2f}"),
    Figure("hand_travel_norm", "hand's travel, {unit}", lambda x: f"{abs(x):.1f}"),
    Figure("loss", "authority lost, %", lambda x: f"{100 * x:.2f}"),
    Figure("loss_closed_form", "  by closed form, %", lambda x: f"{100 * x:.2f}"),
    Figure("felt_ratio", "felt / specified gradient", lambda x: f"{x:.3f}"),
    Figure("felt_ratio_closed_form", "  by closed form", lambda x: f"{x:.3f}"),
    Figure("force_N", "force needed, {force}", lambda x: f"{x:.1f}"),
    Figure("force_step_N", "force step, {force}", lambda x: f"{x:.2f}"),
    Figure("peak_rate_rad_per_s", "peak {rate} rate, °/s", lambda x: f"{x / DEGREE_rad:.2f}"),
    Figure("peak_load_factor", "peak load factor", lambda x: f"{x:.3f}"),
    Figure("time_to_attitude_s", "time to {change:.1f}° of {angle}, s", lambda x: f"{x:.2f}"),
)


# Of the figures that a sweep keeps, over flights of any control.
_KEPT: dict[str, str] = {
    "asked_norm": "surface command",
    "reached_norm": "surface reached",
    "hand_travel_norm": "hand's travel",
    "loss": "authority lost",
    "loss_closed_form": "loss by closed form",
    "felt_ratio": "felt / specified",
    "felt_ratio_closed_form": "felt by closed form",
    "force_N": "force needed",
    "force_step_N": "force step",
    "peak_rate_rad_per_s": "peak rate",
    "peak_load_factor": "peak load factor",
    "time_to_attitude_s": "time to attitude",
    "surface_stop_norm": "surface at its stop",
}


def kept_figure(name: str, system: System = "si") -> Shown:
    """Return the words, unit and factor of a column of a sweep's table: a figure, or a parameter.

    A parameter stays in its SI unit, which is part of its words.
    """
    if name not in _KEPT:
        return Shown("", words=parameter_label(name))
    unit = shown(name, system)
    written = f"{unit.unit} of travel" if name.endswith("_norm") else unit.unit
    return replace(unit, unit=written, words=_KEPT[name])


def cases_of(flights: Sequence[Flight]) -> list[list[Flight]]:
    """Return the flights of each case, in their order."""
    return [list(group) for _, group in groupby(flights, key=lambda f: f.outcome.case)]


def flown_once(cases: Sequence[Sequence[Flight]]) -> bool:
    """Return whether there are several cases, each flown in one configuration only."""
    return len(cases) > 1 and all(len(case) == 1 for case in cases)


def tabulated(flights: Sequence[Flight]) -> list[list[Flight]]:
    """Return the flights of each table of a comparison: of each case, or all if flown once."""
    cases = cases_of(flights)
    return [list(flights)] if flown_once(cases) else cases


def rows(flights: Sequence[Flight], system: System = "si") -> Iterator[tuple[str, list[str]]]:
    """Yield each figure that any of the flights has: its label, and its text for each flight."""
    manoeuvre = flights[0].manoeuvre
    rate, angle = _WORDS[manoeuvre.control]
    change = manoeuvre.measure.attitude_change / DEGREE_rad
    travel, force = _travel(manoeuvre, system), shown("force_N", system)
    factors = {"hand_travel_norm": travel.factor}
    factors |= {"force_N": force.factor, "force_step_N": force.factor}
    for figure in FIGURES:
        factor = factors.get(figure.field, 1.0)
        written = [figure.written(flight.outcome, factor) for flight in flights]
        if any(text != NONE for text in written):
            yield (
                figure.label.format(
                    rate=rate, angle=angle, change=change, unit=travel.unit, force=force.unit
                ),
                written,
            )
    if any(flight.ended_early for flight in flights):
        yield "flight ended early, s", [_end(flight) for flight in flights]


def _end(flight: Flight) -> str:
    """Return when a flight ended early, in s; a dash if it did not."""
    return f"{flight.record.time_s[-1]:.1f}" if flight.ended_early else NONE


def _travel(manoeuvre: Manoeuvre, system: System) -> Shown:
    """Return the travel of the compared control as a factor, and its unit."""
    unit = drawn(f"travel_{unit_of(manoeuvre.control)}", system, fine=True)
    travel = manoeuvre.rig.controls[manoeuvre.control].travel
    return replace(unit, factor=unit.factor * travel)


def corrects_nothing(flight: Flight) -> bool:
    """Return whether a flight's configuration corrects a bend with K̂ = 0, which has no effect."""
    return _corrects_nothing(flight.manoeuvre)


def _corrects_nothing(manoeuvre: Manoeuvre) -> bool:
    host = manoeuvre.rig.controls[manoeuvre.control].compensation
    return _bends(manoeuvre) and host.bend == 0.0 and (host.deflection or host.gradient)


def _bends(manoeuvre: Manoeuvre) -> bool:
    loader = manoeuvre.rig.controls[manoeuvre.control].loader
    return bool(loader.bend > 0.0 or (loader.bend_push or 0.0) > 0.0 or loader.bend_curve.nodes)


def named(flight: Flight) -> str:
    """Return a flight's configuration as a heading of tables and figures."""
    return f"{flight.configuration} (K̂ = 0)" if corrects_nothing(flight) else flight.configuration


def remarks(flights: Sequence[Flight], system: System = "si") -> list[str]:
    """Return explanations of a comparison's figures, a sentence each; flights of all cases.

    They cover a K̂ of 0, hands at rest, hand forces that move no loader, surfaces at their stops,
    the loss of authority under a force that moves the surface as far as on the rigid rig, and the
    numbers of the rig that are guesses.
    """
    cases = cases_of(flights)
    held = next(filter(None, (explain_loss(case, system) for case in cases)), "")
    said = [_without_correction(flights), *_idle(cases), *_resting(cases, system)]
    said += [*_saturated(cases), held]
    said.append(guessed(flights))
    return list(filter(None, said))


def guessed(flights: Sequence[Flight]) -> str:
    """Return a sentence on the guessed parameters of the compared control, and their effect."""
    manoeuvre = flights[0].manoeuvre
    given = manoeuvre.source.changes if manoeuvre.source is not None else {}
    note = guess_note(manoeuvre.rig.controls, (manoeuvre.control,), given)
    lost = [f.outcome.loss for f in flights if f.configuration != "rigid"]
    most = max(filter(math.isfinite, lost), default=0.0)
    return f"{note} The {100 * most:.0f} % lost depends on them." if note and most > 0.0 else note


def _where(
    cases: Sequence[Sequence[Flight]], case: Sequence[Flight], some: Sequence[Flight]
) -> str:
    """Return the case and configurations of some flights, unless they are all."""
    names = [case[0].outcome.case] if len(cases) > 1 else []
    if len(some) < len(case):
        names += [flight.configuration for flight in some]
    return f" ({listed(names)})" if names else ""


def _some(places: Sequence[str]) -> str:
    """Return places as a list in prose, shortened if there are many."""
    more = len(places) - _LISTED
    return "; ".join(places[:_LISTED]) + (f"; and {more} more" if more > 0 else "")


def _without_correction(flights: Sequence[Flight]) -> str:
    some = [flight for flight in flights if corrects_nothing(flight)]
    if not some:
        return ""
    names = list(dict.fromkeys(flight.configuration for flight in some))
    return _says_no_correction(some[0].manoeuvre, names)


def _says_no_correction(manoeuvre: Manoeuvre, names: Sequence[str]) -> str:
    control, d = manoeuvre.control, unit_of(manoeuvre.control)
    loader = manoeuvre.rig.controls[control].loader
    bend = loader.bend or loader.bend_push or 0.0  # under a pull, or a push if only that bends
    return (
        f"In {listed(names)} nothing is corrected, since the host's K̂ is 0 while the structure's K"
        f" is {bend:.4g} {d}/N. Give controls.{control}.compensation.bend_{d}_per_N, which"
        " `coupled calibrate` finds."
    )


def _idle(cases: Sequence[Sequence[Flight]]) -> Iterator[str]:
    """Yield a sentence on each case without a force or motion of the hand, if any."""
    for case in cases:
        some = [f for f in case if math.isnan(f.outcome.force_N) and not f.outcome.ended_early]
        if some:
            control = some[0].manoeuvre.control
            where = _where(cases, case, some)
            yield f"No hand moves or loads the {control}{where}, so nothing is measured."


def _resting(cases: Sequence[Sequence[Flight]], system: System) -> Iterator[str]:
    """Yield a sentence on hand forces below breakout and friction, if any."""
    unit = shown("force_N", system)
    found: dict[tuple[str, str], list[str]] = {}
    for case in cases:
        some = [flight for flight in case if flight.outcome.loader_rests]
        if not some:
            continue
        loader = some[0].manoeuvre.rig.controls[some[0].manoeuvre.control].loader
        rubs = breakaway_force(loader)
        pull = max(flight.outcome.force_N for flight in some)
        force, breakout, friction = (
            f"{unit.factor * each:.3g} {unit.unit}" for each in (pull, loader.breakout, rubs)
        )
        place = f"{force}{_where(cases, case, some)}"
        if pull > loader.breakout + rubs and any(_raises_breakout(flight) for flight in some):
            place += ", where the correction of the gradient raises the breakout"
        found.setdefault((breakout, friction), []).append(place)
    control = cases[0][0].manoeuvre.control
    for (breakout, friction), places in found.items():
        yield (
            f"The force on the {control} stays within breakout ({breakout}) and friction"
            f" ({friction}): {_some(places)}. The loader does not move, so there is no share lost"
            " or felt."
        )


def _raises_breakout(flight: Flight) -> bool:
    """Return whether a host adds K̂·G·F_BO to its assumed breakout, eq. (11)."""
    control = flight.manoeuvre.rig.controls[flight.manoeuvre.control]
    host = control.compensation
    return host.gradient and host.bend > 0.0 and control.assumed_breakout > 0.0


def _saturated(cases: Sequence[Sequence[Flight]]) -> Iterator[str]:
    """Yield a sentence on surfaces at their stops, if the hand commands more."""
    manoeuvre, places = cases[0][0].manoeuvre, []
    surface = SURFACES[manoeuvre.control]
    for case in cases:
        some = [flight for flight in case if flight.outcome.surface_stop_norm is not None]
        if some:
            stop = some[0].outcome.surface_stop_norm or 0.0
            stops = some[0].record.manifest["surface_stops"][surface]
            rad = stops["positive" if stop > 0.0 else "negative"]["position_rad"]
            at = f"{100.0 * abs(stop):.1f} % of the {manoeuvre.control}'s travel"
            places.append(f"{at}, at {rad / DEGREE_rad:.1f}°{_where(cases, case, some)}")
    if places:
        yield (
            f"The {surface} is at its stop from here on, counted from trim: {_some(places)}. The"
            " hand commands more; the excess is not counted as lost."
        )


def explain_loss(case: Sequence[Flight], system: System = "si") -> str:
    """Return why authority is lost under a force that moves the surface as on the rigid rig.

    Empty if the hand does not hold a force, or moves no further for it.
    """
    manoeuvre = case[0].manoeuvre
    rigid = next((f.outcome for f in case if f.configuration == "rigid"), None)
    if not holds_force(manoeuvre) or rigid is None:
        return ""
    moved = [
        flight.outcome
        for flight in case
        if _is_uncorrected(flight.manoeuvre)
        and abs(flight.outcome.hand_travel_norm) - abs(rigid.hand_travel_norm) > _NOTICED
        and flight.outcome.loss > 0.0
    ]
    if not moved:
        return ""
    bent, alike = moved[0], moves_surface_alike(moved[0], rigid)
    full = _travel(manoeuvre, system)
    where = f" ({bent.case})" if manoeuvre.label != manoeuvre.name else ""
    travels = [full.factor * abs(each.hand_travel_norm) for each in (*moved, rigid)]
    digits = _digits_between(travels[:-1], travels[-1], 1 if full.unit == "in" else 0)
    written = [f"{travel:.{digits}f} {full.unit}" for travel in travels]
    places = (written[0], written[-1])
    others = [
        f"{each.configuration} {written[number]} and {percent(each.loss, 0)}"
        for number, each in enumerate(moved[1:], start=1)
        if moves_surface_alike(each, rigid) is alike
    ]
    surface = "the surface moves about as far, but" if alike else "and"
    more = f" Likewise {listed(others)}." if others else ""
    return (
        f"The pilot holds a force. {bent.configuration.capitalize()}, the hand moves {places[0]}"
        f" instead of {places[1]}{where}, since the structure bends; {surface}"
        f" {percent(bent.loss, 0)} of the hand's command is lost.{more}"
    )


def _digits_between(values: Sequence[float], other: float, least: int) -> int:
    """Return the decimals, at least `least`, with which no value has the other one's text."""
    digits = least
    while digits < _MOST_DIGITS and any(f"{x:.{digits}f}" == f"{other:.{digits}f}" for x in values):
        digits += 1
    return digits


def sweep_remarks(manoeuvre: Manoeuvre, configurations: Sequence[Configuration]) -> list[str]:
    """Return explanations of the losses in a table of flights, a sentence each.

    `manoeuvre` is one of the flights, its rig as filed, flown in `configurations`, or as filed if
    there are none.
    """
    said = []
    flown = {str(each): manoeuvre.configured(each) for each in configurations}
    flown = flown or {"the rig as filed": manoeuvre}
    useless = [name for name, each in flown.items() if _corrects_nothing(each)]
    if useless:
        said.append(_says_no_correction(manoeuvre, useless))
    if holds_force(manoeuvre) and any(_is_uncorrected(each) for each in flown.values()):
        said.append(
            "The pilot holds a force: on a structure that bends, the hand moves further, and"
            " without correction the surface moves about as far as on a rigid one. The loss is a"
            " share of the hand's command."
        )
    return said


def _is_uncorrected(manoeuvre: Manoeuvre) -> bool:
    """Return whether a control bends and its host corrects neither gradient nor deflection."""
    host = manoeuvre.rig.controls[manoeuvre.control].compensation
    return _bends(manoeuvre) and (host.bend == 0.0 or not (host.gradient or host.deflection))


def holds_force(manoeuvre: Manoeuvre) -> bool:
    """Return whether the pilot of the compared control holds a force, not a deflection."""
    pilot = manoeuvre.pilots.get(manoeuvre.control)
    return pilot is not None and pilot.kind in _FORCES


def moves_surface_alike(bent: Outcome, rigid: Outcome) -> bool:
    """Return whether a surface moves about as far as on the rigid rig."""
    return abs(bent.reached_norm - rigid.reached_norm) <= _ALIKE * abs(rigid.reached_norm)
