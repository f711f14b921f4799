"""The force document of a rig."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from coupled.api.rigs import rig_given
from coupled.arguments import public
from coupled.calibration.forcedocument import ForceDocument, document_rig
from coupled.errors import InputError
from coupled.files import check_target
from coupled.outputs import Outputs
from coupled.plots.documentation import draw_pages
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Progress = Callable[[str, int, int], None]


@public
def document(
    rig: Rig | str | PathLike[str],
    control: ControlName | None = None,
    readings: str | PathLike[str] | None = None,
    specified: Rig | str | PathLike[str] | None = None,
    aircraft: str | PathLike[str] | None = None,
    date: str = "",
    revision: str = "",
    folder: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> ForceDocument:
    """Document a rig's forces, and compare them with the control checks of 14 CFR Part 60.

    `control` selects one control (default: all). `readings` is a file of readings of the first
    control (simulated ones by default); `specified` is a rig with the specified values, `aircraft`
    a CSV of forces measured on the aircraft. `date` and `revision` are printed as given. The pages,
    PNG and PDF, are written into `folder` if given. Raises InputError for a file that cannot be
    used.

    >>> import coupled
    >>> coupled.document("bench")
    ForceDocument(bench: 36 of 40 checks within tolerance)
    """
    data = rig_given(rig)
    target = None if folder is None else Path(folder)
    if target is not None:
        if target.is_file():
            raise InputError(target, "folder", "is a file; give a folder")
        check_target(target / f"{data.name}.pdf", made=target)
    own = None if specified is None else rig_given(specified)
    files = (None if path is None else Path(path) for path in (readings, aircraft))
    read, known = files
    found = document_rig(data, control, read, own, known, date, revision, progress)
    if target is not None:
        with Outputs() as outputs:
            pdf = outputs.at(target / f"{data.name}.pdf")
            draw_pages(found.controls, found.fits, found.issue, outputs.folder(target), pdf)
    return found
