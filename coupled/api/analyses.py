"""Analyses of a rig: authority maps and stability."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike

from coupled.api.records import Given, named_records
from coupled.api.rigs import rig_given
from coupled.arguments import public
from coupled.authority.authoritymap import AuthorityMap, map_rig
from coupled.authority.stability.stabilitymap import Stability, compliant_controls, map_stability
from coupled.errors import InputError
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Path = str | PathLike[str]
Progress = Callable[[str, int, int], None]
_PRESSURE = "dynamic_pressure_Pa"


@public
def map_authority(
    rig: Rig | Path,
    records: Given | Sequence[Given] | Mapping[str, Given] | None = None,
    progress: Progress | None = None,
) -> AuthorityMap:
    """Map a rig's lost authority over q̄ and deflection, and its stick force per g and per knot.

    `records`, as in `diagnose`, determine the envelope that is drawn; by default the rig's shipped
    runs are flown for it. Raises InputError for a record without q̄.

    >>> import coupled
    >>> found = coupled.map_authority("bench")
    >>> found.to_polars().columns[:3]
    ['control', 'configuration', 'dynamic_pressure_Pa']
    """
    flown = None if records is None else named_records(records)
    for name, record in (flown or {}).items():
        if _PRESSURE not in record:
            raise InputError(name, _PRESSURE, "no such channel")
    given = None if flown is None else list(flown.values())
    return map_rig(rig_given(rig), given, progress)


@public
def stability(
    rig: Rig | Path, control: ControlName | None = None, progress: Progress | None = None
) -> Stability:
    """Map where a rig is stable over K·G_T, by simulation and by linear theory.

    `control` selects one control (default: each with a bend). Some thousand motions of each are
    simulated, which takes about a minute. Raises InputError if no control has a bend.

    >>> import coupled
    >>> found = coupled.stability("bench")
    >>> found.limits[0].control, found.to_polars().columns[:2]
    ('column', ['control', 'quantity'])
    """
    data = rig_given(rig)
    return map_stability(data, compliant_controls(data, control), progress)
