"""The named functions of the model's aerodynamics as effects.

A function is freed if its share of its axis in a record is at least `TERM_LEAST`. The shares are
those of the filed model, flown with the record's surfaces. The functions replace the effects of the
library that scale the aerodynamics, since each such effect is a part of some functions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from coupled.errors import InputError
from coupled.flight.airframe import main_file
from coupled.flight.altered import ALTERATIONS
from coupled.flight.modelparts import Thrust
from coupled.flight.modeltext import functions_of
from coupled.gap.effects.airframe import term
from coupled.gap.effects.effect import Effect
from coupled.gap.stages.airframe import RATE, needs
from coupled.gap.stages.openloop import flown_in, fly_open_loop
from coupled.gap.stages.surfaces import flown_by, moved
from coupled.gap.thresholds import TERM_LEAST
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.rig import Rig
from coupled.surveying.terms import shares

OPTION = "--terms"
_AERODYNAMIC = {f"flight.{a.part.name}" for a in ALTERATIONS if not isinstance(a.part, Thrust)}


def with_terms(library: Sequence[Effect], rig: Rig, records: Mapping[str, Record]) -> list[Effect]:
    """Return a library with the model's functions in place of effects of the aerodynamics.

    Raises InputError for a model without named functions, and for a record without channels that
    the airframe needs.
    """
    assert rig.flight is not None
    axes = functions_of(main_file(rig.flight, [aircraft_folder()], rig.name))
    if not axes:
        raise InputError(
            rig.name, OPTION, f"{rig.flight.model} has no named aerodynamic functions; leave it out"
        )
    large = set[str]()
    for file, record in records.items():
        lacking = [name for name in needs(rig, record) if name not in record]
        if lacking:
            problem = f"the record lacks {', '.join(lacking)}, which the airframe needs"
            raise InputError(file, OPTION, problem)
        large |= large_terms(rig, record, axes)
    kept = [one for one in library if not _AERODYNAMIC & {p.key for p in one.parameters}]
    return [*kept, *(term(name, axis) for name, axis in axes.items() if name in large)]


def large_terms(rig: Rig, record: Record, axes: Mapping[str, str]) -> set[str]:
    """Return the functions whose share of their axis in a record is at least `TERM_LEAST`."""
    assert rig.flight is not None
    controls = flown_by(rig)
    surfaces, _ = moved(rig, record, {}, np.random.default_rng(43))
    given = (rig.flight, rig.frame_rate, controls, surfaces, (RATE, *axes))
    flown = fly_open_loop(*given, flown_in(record, controls, rig.frame_rate))
    values = dict(zip(axes, flown.motion[:, 1:].T, strict=True))
    return {one.term for one in shares(axes, values) if (one.share or 0.0) >= TERM_LEAST}
