"""The named functions of a JSBSim model's aerodynamics, and their shares of the axes in a flight.

JSBSim sums the functions of an axis to its force or moment. The share of a function is its RMS over
the flight, the trim included, over the sum of the RMS of all named functions of the axis. The
flight is that of a run, or a doublet and a 3-2-1-1 on each surface, one after the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.loop import fly, make_airframe
from coupled.flight.modeltext import UnreadableModelError, functions_of
from coupled.flight.runfile import read_run
from coupled.record.channels import CONTROL_NAMES
from coupled.results import Displayed, Tabular, frame_of
from coupled.rig.parameters import Flight
from coupled.surveying.survey import FRAME_s, ModelFile, chosen_model, model_file, survey

if TYPE_CHECKING:
    import polars as pl

Progress = Callable[[str, int, int], None]
_SIZE_norm = 0.1  # of the surface's travel
_PULSES_s = ((1.0, 1), (1.0, -1), (4.0, 0), (2.1, 1), (1.4, -1), (0.7, 1), (0.7, -1), (6.0, 0))
_FRAMES_SHOWN = 500  # between two reports of progress
_AXES = ("DRAG", "SIDE", "LIFT", "X", "Y", "Z", "AXIAL", "NORMAL", "ROLL", "PITCH", "YAW")
Values = Mapping[str, NDArray[np.float64]]  # of each term over the flight


@dataclass(frozen=True)
class AeroTerm:
    """A named function: its axis, and its share of the axis in a flight.

    For a function that others refer to, the axis is empty and the share None.
    """

    term: str
    axis: str
    share: float | None


@dataclass(frozen=True, repr=False)
class ModelTerms(Sequence[AeroTerm], Displayed, Tabular):
    """The named functions of a model's aerodynamics, by axis, the largest share first.

    `flown` describes the flight of the shares, `flight` its trim.
    """

    model: str
    flight: Flight
    flown: str
    terms: tuple[AeroTerm, ...]

    @overload
    def __getitem__(self, index: int) -> AeroTerm: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[AeroTerm, ...]: ...

    def __getitem__(self, index: int | slice) -> AeroTerm | tuple[AeroTerm, ...]:
        return self.terms[index]

    def __len__(self) -> int:
        return len(self.terms)

    def __repr__(self) -> str:
        return f"ModelTerms({self.model}: {len(self)} terms; {self.flown})"

    def as_dict(self) -> dict[str, Any]:
        """Return the model, the flight and the terms as JSON data."""
        return {
            "model": self.model,
            "altitude_m": self.flight.altitude,
            "calibrated_airspeed_m_per_s": self.flight.calibrated_airspeed,
            "flown": self.flown,
            "terms": [asdict(one) for one in self.terms],
        }

    def to_polars(self) -> pl.DataFrame:
        """Return one row per term."""
        return frame_of([asdict(one) for one in self.terms])


def list_terms(
    model: str | PathLike[str],
    run: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> ModelTerms:
    """Return a model's terms with their shares in the first case of a run, or by default.

    Raises InputError for a model that is unknown, does not trim or has no named functions, and for
    a run of another model.
    """
    chosen = chosen_model(fspath(model))
    try:
        axes = functions_of(chosen.path)
    except UnreadableModelError as error:
        raise InputError(fspath(model), "", f"does not load: {error}") from None
    if not axes:
        raise InputError(fspath(model), "", "has no named aerodynamic functions")
    if run is None:
        flight, values = _flown_by_default(chosen, axes, progress or _silent)
        flown = "a doublet and a 3-2-1-1 on each surface"
    else:
        flight, values = _flown_by_run(chosen, fspath(run), axes)
        flown = f"the run {fspath(run)}"
    return ModelTerms(chosen.label, flight, flown, tuple(shares(axes, values)))


def _silent(said: str, done: int, whole: int) -> None:
    """Report no progress."""


def _flown_by_default(
    model: ModelFile, terms: Iterable[str], report: Progress
) -> tuple[Flight, Values]:
    """Return the trim found for a model, and each term's values over the default flight."""
    report(f"where {model.label} trims", 0, 1)
    flight = survey(model).flight
    if flight is None:
        raise InputError(model.label, "", "does not trim wherever it was tried; give a run (--run)")
    aircraft = make_aircraft(flight, FRAME_s, CONTROL_NAMES, [model.home], "model")
    reads = {term: read for term in terms if (read := aircraft.reader(term)) is not None}
    commands = list(_commands())
    rows = []
    for done, command in enumerate(commands):
        if done % _FRAMES_SHOWN == 0:
            report(f"flying {model.label}", done, len(commands))
        rows.append([read() for read in reads.values()])
        aircraft.step(command)
        if aircraft.trouble():
            break
    return flight, dict(zip(reads, np.array(rows).T, strict=True))


def _commands() -> Iterator[tuple[float, float, float]]:
    """Yield the commands of the default flight, about trim, frame by frame."""
    for moved in range(len(CONTROL_NAMES)):
        for length_s, sign in _PULSES_s:
            size = [_SIZE_norm * sign * (i == moved) for i in range(len(CONTROL_NAMES))]
            yield from itertools.repeat((size[0], size[1], size[2]), round(length_s / FRAME_s))


def _flown_by_run(model: ModelFile, run: str, terms: Iterable[str]) -> tuple[Flight, Values]:
    """Return the trim of a run's first case, and each term's values over its flight."""
    manoeuvre = read_run(run)[0]
    flight = manoeuvre.rig.flight
    flown = None if flight is None else model_file(model.home / flight.main_file)
    if flight is None or flown != model:
        flies = "has no aircraft" if flown is None else f"flies {flown.label}"
        raise InputError(run, "rig", f"{flies}; give a run of {model.label}")
    aircraft = make_airframe(manoeuvre)
    assert isinstance(aircraft, JSBSimAirframe)
    known = tuple(term for term in terms if aircraft.has(term))
    record = fly(replace(manoeuvre, record_properties=known))
    return flight, {term: record[term] for term in known}


def shares(axes: Mapping[str, str], values: Values) -> Iterator[AeroTerm]:
    """Yield the terms by axis, the largest share first; those of no axis are last."""
    sizes = {term: float(np.sqrt(np.mean(np.square(each)))) for term, each in values.items()}
    whole = dict.fromkeys(axes.values(), 0.0)
    for term, axis in axes.items():
        whole[axis] += sizes.get(term, 0.0)
    for axis in sorted(whole, key=lambda axis: (not axis, _AXES.index(axis) if axis else 0)):
        inside = [term for term in axes if axes[term] == axis]
        for term in sorted(inside, key=lambda term: -sizes.get(term, 0.0) if axis else 0.0):
            known = axis and term in sizes
            share = sizes[term] / whole[axis] if known and whole[axis] > 0.0 else 0.0
            yield AeroTerm(term, axis, share if known else None)
