"""Diagnosis: hold records against their rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath

from coupled.api.records import read_record
from coupled.api.rigs import load_rig
from coupled.arguments import public
from coupled.errors import InputError
from coupled.gap.diagnose import Diagnosis
from coupled.gap.diagnose import diagnose as diagnose_records
from coupled.gap.trimmed import rig_of_manifests
from coupled.record.channels import ControlName
from coupled.record.record import DataFrame, Record
from coupled.rig.rig import Rig

Given = Record | DataFrame | str | PathLike[str]


@public
def diagnose(
    rig: Rig | str | PathLike[str] | None,
    records: Given | Sequence[Given] | Mapping[str, Given],
    control: ControlName = "column",
    progress: Callable[[str, int, int], None] | None = None,
    healthy: Given | Sequence[Given] | Mapping[str, Given] | None = None,
) -> Diagnosis:
    """Diagnose a mismatch between simulation and record: where, which effect, how large.

    `rig` is the rig that the records should be of: a rig, its file, or the name of a shipped
    one; None for that of the manifest beside the records. Its aircraft is trimmed as the records
    begin. `records` is one record or several of that rig, as `Record`, as a DataFrame, as files, or
    by name; each needs `time_s` and what its stages need (force and deflections of the control, q̄).
    `healthy` are records of the machine when it was well; what differs from those is judged.

    `found.verdict` is `no_gap`, `effect`, `mostly`, `ambiguous` or `unexplained`;
    `found.effects` are the effects, each with its parameters, their values and 95 % intervals;
    `found.budget` shares each guilty stage's residual out to them, to what no effect explains,
    and to noise; `found.improved` is the rig with them; `found.as_dict()` the JSON of the command
    line. Raises InputError where records and rig cannot be held against each other.

    >>> import coupled
    >>> rig = coupled.load_rig("t37")
    >>> worn = rig.changed({"controls.column.loader.bend_m_per_N": 4e-4})
    >>> sweep = coupled.FrequencySweep(force_N=40, start_s=0.5, duration_s=8)
    >>> flight = coupled.fly(worn, column=sweep, duration_s=10)
    >>> found = coupled.diagnose(rig, flight.record)
    >>> found.verdict, found.effects[0].name, round(found.effects[0].value, 5)
    ('effect', 'bend', 0.0004)
    >>> round(found.improved.controls["column"].loader.bend, 5)
    0.0004
    """
    named = named_records(records)
    if rig is None:
        nominal = rig_of_manifests(named)
    else:
        nominal = rig if isinstance(rig, Rig) else load_rig(rig)
    well = None if healthy is None else named_records(healthy)
    return diagnose_records(nominal, named, control, progress, well)


def named_records(records: Given | Sequence[Given] | Mapping[str, Given]) -> dict[str, Record]:
    """Return records by the name that a fault is to say: the file's, or a number."""
    if isinstance(records, (Record, DataFrame, str, PathLike)):
        records = [records]
    if not records:
        raise InputError("coupled.diagnose", "records", "needs at least one")
    if isinstance(records, Mapping):
        return {name: _record(given) for name, given in records.items()}
    named: dict[str, Record] = {}
    for i, given in enumerate(records, 1):
        numbered = "record" if len(records) == 1 else f"record {i}"
        name = fspath(given) if isinstance(given, (str, PathLike)) else numbered
        if name in named:
            raise InputError(name, "", "is given twice")
        named[name] = _record(given)
    return named


def _record(given: Given) -> Record:
    """Return a record given as such, as a DataFrame, or as a file."""
    if isinstance(given, Record):
        return given
    return Record.from_frame(given) if isinstance(given, DataFrame) else read_record(given)
