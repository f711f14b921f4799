"""An FMU: one control's loader, linkage, sensing and compensation, as a file."""

from __future__ import annotations

import hashlib
import io
import re
import uuid
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from coupled.errors import InputError, listed, nearest
from coupled.exporting.fmu.build import c_compiler, shared_library, this_platform
from coupled.exporting.fmu.description import Model, model_description
from coupled.exporting.fmu.numbers import words
from coupled.exporting.fmu.source import model_header
from coupled.exporting.fmu.variables import variables
from coupled.files import check_target, write_whole
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig
from coupled.rig.serving import has_services

Fmi = Literal[2, 3]


@dataclass(frozen=True)
class Fmu:
    """An FMU: its content, its control, FMI version, platform and step, and its variables' names.

    `left` are the parts of the rig left out, and why.
    """

    rig: Rig
    control: str
    fmi: Fmi
    platform: str
    frame_s: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    left: tuple[str, ...]
    content: bytes

    def __repr__(self) -> str:
        numbers = f"{len(self.parameters)} parameters"
        return f"Fmu({self.rig.name} {self.control}: FMI {self.fmi}.0, {self.platform}, {numbers})"

    def as_dict(self) -> dict[str, object]:
        """Return the properties of the FMU, without its content, as JSON data."""
        names = {"inputs": self.inputs, "outputs": self.outputs, "parameters": self.parameters}
        return {
            "rig": self.rig.name,
            "control": self.control,
            "fmi": self.fmi,
            "platform": self.platform,
            "frame_s": self.frame_s,
            **{key: list(value) for key, value in names.items()},
            "left_out": list(self.left),
        }


def check_file(file: Path) -> None:
    """Raise InputError for a path that does not end in .fmu or cannot be written."""
    if file.suffix.lower() != ".fmu":
        raise InputError(file, "", "an FMU ends in .fmu")
    check_target(file)


def chosen_control(rig: Rig, control: str, file: object) -> ControlName:
    """Return the control to export: the named one, or the rig's only one."""
    rig.check_controlled(file)
    names = list(rig.controls)
    if control and control not in names:
        raise InputError(file, "control", f"the rig has no {control!r}; {nearest(control, names)}")
    if not control and len(names) > 1:
        raise InputError(file, "control", f"an FMU has one control; give one of {listed(names)}")
    return control or names[0]


def make_fmu(rig: Rig, control: str = "", fmi: Fmi = 3) -> Fmu:
    """Return the FMU of a rig's control, for this platform.

    Raises InputError for an unknown control, and without a C compiler.
    """
    file = rig.place
    name = chosen_control(rig, control, file)
    made_for = this_platform()
    c_compiler()
    data, frame_s = rig.controls[name], 1.0 / rig.frame_rate
    found, memory = variables(rig, name), words(rig, name, data)
    seed = hashlib.sha256(repr((fmi, rig.name, found)).encode() + memory.tobytes())
    token = f"{{{uuid.UUID(seed.hexdigest()[:32])}}}"
    header = model_header(token, frame_s, rig.substeps, memory, data, found)
    identifier = re.sub(r"\W", "_", f"{rig.name}_{name}", flags=re.ASCII)
    identifier = identifier if identifier[0].isalpha() else f"rig_{identifier}"
    text = (
        f"Control loader, linkage, sensing and compensation of the {name} of {rig.name}."
        f" Its binary is for {made_for} only."
    )
    model = Model(f"{rig.name} {name}", identifier, token, text, frame_s)
    library = shared_library(header, fmi, made_for)
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", model_description(model, found, fmi))
        place = f"binaries/{made_for.folder(fmi)}/{identifier}{made_for.suffix}"
        archive.writestr(place, library)
    by_role = {
        role: tuple(one.name for one in found if one.role == role)
        for role in ("input", "output", "parameter")
    }
    return Fmu(
        *(rig, name, fmi, str(made_for), frame_s),
        *(by_role["input"], by_role["output"], by_role["parameter"]),
        *(left_out(rig, name), held.getvalue()),
    )


def write_fmu(made: Fmu, file: Path) -> None:
    """Write an FMU atomically."""
    write_whole(file, lambda part: part.write_bytes(made.content))


def left_out(rig: Rig, control: ControlName) -> tuple[str, ...]:
    """Return the parts of a rig that the FMU of a control does not have, a line each."""
    found, data = [], rig.controls[control]
    if rig.noise:
        found.append("noise: readings of the FMU have none")
    if not rig.structure.stands_apart:
        found.append("structure: forces on other controls do not bend this one")
    if data.loader.crosstalk != 0.0:
        found.append(f"controls.{control}.loader.crosstalk: the FMU has no other control")
    if data.sensing.force_stamp != 0.0:
        found.append(f"controls.{control}.sensing.force_stamp_s: it acts in a record only")
    if has_services(data):
        found.append(
            f"controls.{control}.services: commands by events; forces without a command stay"
        )
    return tuple(found)
