"""Diagnosis of records, and fit of a rig to records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike

import numpy as np

from coupled.api.records import Given, named_records
from coupled.api.rigs import rig_given
from coupled.arguments import public
from coupled.errors import InputError
from coupled.gap.checks import rig_of_manifests
from coupled.gap.diagnose import Diagnosis
from coupled.gap.diagnose import diagnose as diagnose_records
from coupled.gap.nominal import NominalFit, fit_nominal
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.rig.rig import Rig


@public
def diagnose(
    rig: Rig | str | PathLike[str] | None,
    records: Given | Sequence[Given] | Mapping[str, Given],
    control: ControlName | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    healthy: Given | Sequence[Given] | Mapping[str, Given] | None = None,
    terms: bool = False,
) -> Diagnosis:
    """Diagnose the difference between simulation and record: which stage and effect, what size.

    `rig` is the records' rig: a rig, its file, or the name of a shipped rig; None for that of the
    manifest beside the records. Its aircraft is trimmed at the records' initial condition.
    `records` is one record or several of that rig, as `Record`, as a DataFrame, as files, or by
    name; each needs `time_s` and what its stages need (force and deflections of the control, q̄).
    `control` selects one control; None judges every control that rig and records have and that
    moves. `healthy` are records of the healthy machine, the reference if given. With `terms`,
    factors on the named functions of the model's aerodynamics are fitted in place of the effects
    that scale its aerodynamics: the effect `term NAME` is a factor on the function NAME.

    `found.verdict` is `no_gap`, `effect`, `mostly`, `ambiguous` or `unexplained`;
    `found.effects` are the effects, each with its parameters, their values and 95 % intervals;
    `found.budget` divides the residual of each faulty stage among them, an unexplained part and
    noise; `found.improved` is the rig with them; `found.as_dict()` the JSON of the command line.
    `found.controls` are the judged controls; with several, an effect has its `control`, and
    `found.parts` are the diagnoses of each control and of the airframe. Raises InputError if
    records and rig cannot be compared.

    >>> import coupled
    >>> rig = coupled.load_rig("t37")
    >>> worn = rig.changed({"controls.column.loader.bend_m_per_N": 4e-4})
    >>> sweep = coupled.FrequencySweep(force_N=40, start_s=0.5, duration_s=8)
    >>> flight = coupled.fly(worn, column=sweep, duration_s=10)
    >>> found = coupled.diagnose(rig, flight.record)
    >>> found.verdict, found.effects[0].name, round(found.effects[0].value, 5)
    ('effect', 'bend', 0.0004)
    >>> round(found.improved["controls.column.loader.bend_m_per_N"], 5)
    0.0004
    """
    named = named_records(records)
    nominal = rig_of_manifests(named) if rig is None else rig_given(rig)
    well = None if healthy is None else named_records(healthy)
    _check_twice([*named.items(), *(well or {}).items()])
    return diagnose_records(nominal, named, control, progress, well, terms=terms)


def _check_twice(records: Sequence[tuple[str, Record]]) -> None:
    """Raise InputError if two records have the same data."""
    for k, (name, record) in enumerate(records):
        for _, other in records[:k]:
            if record.channels == other.channels and np.array_equal(record.data, other.data):
                raise InputError("coupled.diagnose", name, "is a duplicate: give each record once")


@public
def fit(
    rig: Rig | str | PathLike[str],
    records: Given | Sequence[Given] | Mapping[str, Given],
    free: Sequence[str] = (),
    control: ControlName = "column",
    progress: Callable[[str, int, int], None] | None = None,
) -> NominalFit:
    """Fit a rig to records of the healthy machine, and list the undetermined parameters.

    `rig` is the rig to start from, `records` are as in `diagnose`. `free` are keys of the control,
    as `loader.mass_kg`; by default those that the channels of the records allow. `found.rig` is the
    fitted rig, whose `tolerance` holds half of each 95 % interval; `found.to_polars()` has the
    numbers. Raises InputError if records and rig cannot be compared.

    >>> import coupled
    >>> heavy = coupled.load_rig("t37").changed({"controls.column.loader.mass_kg": 7.0})
    >>> sweep = coupled.FrequencySweep(force_N=40, start_s=0.5, duration_s=8)
    >>> flight = coupled.fly(heavy, column=sweep, duration_s=10)
    >>> found = coupled.fit("t37", flight.record, ["loader.mass_kg"])
    >>> round(found.rig["controls.column.loader.mass_kg"], 2)
    7.0
    """
    return fit_nominal(rig_given(rig), named_records(records), free, control, progress)
