"""Export of the loader of a rig to JSBSim, or as an FMU."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Literal

from coupled.api.rigs import rig_given
from coupled.arguments import public
from coupled.errors import InputError, nearest
from coupled.exporting.fmu.write import Fmu, check_file, make_fmu, write_fmu
from coupled.exporting.folder import check_folder, exportable, runs_of, write_export
from coupled.exporting.write import Export, RATE_Hz
from coupled.exporting.write import export as make
from coupled.flight.runfile import read_run
from coupled.rig.rig import Rig


@public
def export(
    rig: Rig | str | PathLike[str],
    folder: str | PathLike[str],
    runs: Sequence[str | PathLike[str]] | None = None,
    case: str = "",
    loader_rate_Hz: float = RATE_Hz,
    check: bool = True,
    progress: Callable[[str, int, int], None] | None = None,
) -> Export:
    """Write the loader of a rig as JSBSim systems, with the aircraft and scripts for JSBSim.

    `folder` is new, or an earlier export. `runs` get a script each (the shipped runs of the rig's
    name unless given); with `case` the rig is exported as that case of them has it.
    `loader_rate_Hz` is the minimum rate of the loader. With `check` each script is flown in JSBSim
    alone: `.beside` has the differences from the flights of `coupled`, `.within` whether all are
    within tolerance. Raises InputError, with the key, for what cannot be exported.

    >>> import coupled, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = coupled.export("t37", f"{folder}/t37", runs=[])
    >>> made.substeps
    8
    """
    place, data = Path(folder), rig_given(rig)
    check_folder(place)
    named = runs_of(data.name) if runs is None else [fspath(run) for run in runs]
    cases = [each for name in named for each in read_run(name)]
    if case:
        chosen = {each.label: each for each in cases}
        if case not in chosen:
            problem = f"no case {case!r}; {nearest(case, chosen)}"
            raise InputError(", ".join(named), "case", problem)
        data, cases = chosen[case].rig, [chosen[case]]
    flown, _ = exportable(data, cases)
    made = make(data, flown, data.place, loader_rate_Hz, check, progress)
    write_export(made, place)
    return made


@public
def export_fmu(
    rig: Rig | str | PathLike[str],
    file: str | PathLike[str],
    control: str = "",
    fmi: Literal[2, 3] = 3,
) -> Fmu:
    """Write the loader, linkage, sensing and compensation of a control as an FMU.

    `file` ends in .fmu; the FMU is for co-simulation on this platform, by FMI 3.0 or 2.0. `control`
    is required if the rig has several controls. Needs a C compiler. Raises InputError without one,
    for a file that cannot be written, and for an unknown control.

    >>> import coupled
    >>> coupled.export_fmu("t37", "t37.fmu")
    Traceback (most recent call last):
    coupled.errors.InputError: …t37.toml: control: an FMU has one control; give one of column, …
    """
    place = Path(file)
    check_file(place)
    made = make_fmu(rig_given(rig), control, fmi)
    write_fmu(made, place)
    return made
