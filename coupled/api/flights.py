"""Runs and flights: load, fly, compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike, fspath
from typing import Any, TypedDict, Unpack

from coupled.api.rigs import load_rig
from coupled.arguments import public
from coupled.authority.compare import AS_THE_RIG, Comparison, Flight, fly_and_judge
from coupled.authority.compare import compare as compare_manoeuvres
from coupled.errors import InputError
from coupled.flight.conditions import Conditions, build_conditions
from coupled.flight.manoeuvre import Configuration, Manoeuvre, PressureProfile
from coupled.flight.pilot import Pilot
from coupled.flight.pilot.own import Law, as_pilot
from coupled.flight.runfile import read_run
from coupled.record.channels import CONTROL_NAMES, ControlName
from coupled.rig.rig import Rig
from coupled.schema import known_keys, plain_value

Path = str | PathLike[str]
Gradients = Law | Mapping[ControlName, Law]


class FlightKeywords(TypedDict, total=False):
    """Further keywords of a flight; tables have the keys of a run file."""

    seed: int
    dynamic_pressure_Pa: float | PressureProfile
    wind: Mapping[str, Any]
    gust: Mapping[str, Any]
    turbulence: Mapping[str, Any]
    event: Mapping[str, Mapping[str, Any]]
    record_properties: Sequence[str]
    name: str


@public
def load_run(run: Path) -> list[Manoeuvre]:
    """Return the manoeuvres of a run file, or of a shipped run by name, one per case.

    Raises InputError with file and key for a run that cannot be flown.

    >>> import coupled
    >>> cases = coupled.load_run("pull-up-t37")
    >>> [case.label for case in cases]
    ['110 kt, 2.0 kPa', '200 kt, 6.5 kPa', '300 kt, 14.5 kPa']
    >>> cases[0].rig.name, list(cases[0].pilots)
    ('t37', ['column'])
    """
    return read_run(fspath(run))


@public
def fly(
    what: Manoeuvre | Rig | Path,
    *,
    column: Pilot | Law | None = None,
    wheel: Pilot | Law | None = None,
    pedals: Pilot | Law | None = None,
    gradient: Gradients | None = None,
    duration_s: float | None = None,
    configuration: Configuration | None = None,
    progress: Callable[[int, int], None] | None = None,
    **terms: Unpack[FlightKeywords],
) -> Flight:
    """Fly a rig with a pilot on each given control, and return the flight.

    `what` is a rig, its file, the name of a shipped one, or a manoeuvre, which has all other
    arguments itself. A pilot is `Step`, `Ramp`, `Doublet`, `ThreeTwoOneOne`, `FrequencySweep`,
    `ForceTable`, `Clamp`, `Attitude` or `Track`. A pull, right wheel and right pedal are positive.
    `configuration` is `rigid`, `uncompensated`, `deflection only`, `gradient only`, `compensated`
    or `calibrated low`; without it the rig flies as it is. `progress` is called with frames done
    and frames in all.

    A pilot may also be a function of the `State` at t_k, called once per frame; it returns the
    force over the frame, N. `gradient` is a function of the state that returns G_T, N per m (rad
    for a wheel), and replaces the schedule of the rig; for several controls, give a table by
    control. If a function has an attribute `reset`, it is called at the start of each flight.

    Further keywords: `seed` (0); `dynamic_pressure_Pa`, a number or a `PressureProfile`, for a rig
    without aircraft; `wind`, `gust`, `turbulence` and `event`, tables as in a run file;
    `record_properties`, of JSBSim; `name`.

    The `Flight` has `.record` (SI, one row per frame), `.outcome` (loss, felt ratio, greatest force
    and rate) and `.ended_early`. Raises InputError as for a run file.

    >>> import coupled
    >>> flight = coupled.fly("t37", column=coupled.Step(force_N=50), duration_s=3)
    >>> flight.record["column_force_N"].max()
    np.float64(50.0)
    >>> len(flight.record), flight.ended_early
    (360, '')
    >>> def hold_level(state):
    ...     return -400.0 * state.pitch_rate_rad_per_s
    >>> coupled.fly("t37", column=hold_level, duration_s=1).record["column_force_N"].size
    120
    """
    pilots = pilots_of(column, wheel, pedals)
    manoeuvre = manoeuvre_of(what, pilots, duration_s, gradient, terms)
    if configuration is None:
        return fly_and_judge(manoeuvre, AS_THE_RIG, progress)
    return fly_and_judge(manoeuvre.configured(configuration), configuration, progress)


@public
def compare(
    what: Manoeuvre | Sequence[Manoeuvre] | Rig | Path,
    *,
    column: Pilot | Law | None = None,
    wheel: Pilot | Law | None = None,
    pedals: Pilot | Law | None = None,
    gradient: Gradients | None = None,
    duration_s: float | None = None,
    configurations: Sequence[Configuration] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    **terms: Unpack[FlightKeywords],
) -> Comparison:
    """Fly a rig rigid, uncompensated, with each correction and with both; return the flights.

    Takes the arguments of `fly`, and the cases of a run (`load_run`). `configurations` are some of
    those of `fly` (default: the first five). `progress` is called with a label and with the flown
    and the total number of frames.

    The `Comparison` is a sequence of `Flight`; `.loss("uncompensated")` is the share of the surface
    command lost, `.felt_ratio(…)` force felt over force specified, `.flight(…)` the flight; with
    several cases each also takes the label of a case. `.to_polars()` and `.to_pandas()` have a row
    for each flight. Raises InputError as a run file would.

    >>> import coupled
    >>> pull = coupled.Clamp(deflection_m=0.03)
    >>> table = coupled.compare(
    ...     "t37", column=pull, duration_s=3, configurations=["rigid", "uncompensated"]
    ... )
    >>> round(table.loss("uncompensated"), 2)
    0.09
    >>> table.to_polars()["configuration"].to_list()
    ['rigid', 'uncompensated']
    """
    pilots = pilots_of(column, wheel, pedals)
    if isinstance(what, Sequence) and not isinstance(what, str):
        for manoeuvre in what:
            _refuse_keywords(manoeuvre, pilots, duration_s, gradient, terms)
        cases = list(what)
        if not cases:
            raise InputError("coupled.compare", "what", "needs at least one manoeuvre")
    else:
        cases = [manoeuvre_of(what, pilots, duration_s, gradient, terms)]
    if configurations is not None:
        cases = [replace(case, configurations=tuple(configurations)) for case in cases]
    return compare_manoeuvres(cases, progress)


def pilots_of(
    column: Pilot | Law | None, wheel: Pilot | Law | None, pedals: Pilot | Law | None
) -> dict[ControlName, Pilot]:
    """Return the given pilots by control."""
    given = zip(CONTROL_NAMES, (column, wheel, pedals), strict=True)
    return {control: as_pilot(pilot) for control, pilot in given if pilot is not None}


def manoeuvre_of(
    what: Manoeuvre | Rig | Path,
    pilots: Mapping[ControlName, Pilot],
    duration_s: float | None,
    gradient: Gradients | None,
    terms: FlightKeywords,
) -> Manoeuvre:
    """Return the manoeuvre of these arguments."""
    if isinstance(what, Manoeuvre):
        _refuse_keywords(what, pilots, duration_s, gradient, terms)
        return what
    name = terms.get("name", "manoeuvre")
    words = (*CONTROL_NAMES, "gradient", "duration_s", *FlightKeywords.__annotations__)
    known_keys(dict(terms), dict.fromkeys(words), name, "")
    rig = what if isinstance(what, Rig) else load_rig(what)
    if duration_s is None:
        raise InputError(name, "duration_s", "is missing; give the length of the flight")
    given: Mapping[str, object] = terms
    tables = {key: plain_value(given[key]) for key in Conditions.model_fields if key in given}
    build_conditions(tables, name)
    pressure = plain_value(terms.get("dynamic_pressure_Pa"))
    if pressure is None and rig.flight is None:
        raise InputError(name, "dynamic_pressure_Pa", f"is missing: {rig.name} has no aircraft")
    if isinstance(pressure, (int, float)):
        pressure = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[float(pressure)])
    return Manoeuvre(
        rig,
        pilots,
        duration_s,
        seed=terms.get("seed", 0),
        conditions=Conditions(**tables),
        bench=pressure,
        record_properties=tuple(terms.get("record_properties", ())),
        name=name,
        gradient=_laws(gradient, rig, name),
    ).begun()


def _laws(given: Gradients | None, rig: Rig, name: str) -> Mapping[ControlName, Law]:
    """Return the scheduling law of each control; a single function is for the only control."""
    if given is None or isinstance(given, Mapping):
        return dict(given or {})
    first, *others = rig.controls
    if others:
        problem = f"is one law for {len(others) + 1} controls; give a table, as {{{first!r}: law}}"
        raise InputError(name, "gradient", problem)
    return {first: given}


def _refuse_keywords(
    manoeuvre: Manoeuvre,
    pilots: Mapping[ControlName, Pilot],
    duration_s: float | None,
    gradient: Gradients | None,
    terms: FlightKeywords,
) -> None:
    """Refuse keywords with a manoeuvre, which has all values itself."""
    alone = {"duration_s": duration_s, "gradient": gradient}
    given = [*pilots, *(key for key, value in alone.items() if value is not None), *terms]
    if given:
        problem = "is given by the manoeuvre itself; change it by dataclasses.replace"
        raise InputError(manoeuvre.file, given[0], problem)
