"""The model description of an FMU, of FMI 2.0 or 3.0."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple
from xml.etree import ElementTree as ET

from coupled.exporting.fmu.variables import Variable
from coupled.schema import LARGEST
from coupled.version import __version__

# Exponents of the SI's base units.
_BASE: dict[str, dict[str, int]] = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
}
_PLAIN = ("g", "norm", "bits")  # dimensionless units


class Unit(NamedTuple):
    """A unit as FMI names it, N/m, with the exponents of its base units."""

    name: str
    exponents: dict[str, int]


def unit(key: str) -> Unit:
    """Return the unit of a key's ending, `N_s_per_m3`; its name is empty without a dimension."""
    over, _, under = key.partition("per_") if key.startswith("per_") else key.partition("_per_")
    sides, exponents = [], Counter[str]()
    for side, sign in ((over, 1), (under, -1)):
        named = [part for part in side.split("_") if part and part not in _PLAIN]
        sides.append(".".join(named))
        for part in named:
            plain = part.rstrip("0123456789")
            power = int(part[len(plain) :] or 1)
            for base, exponent in _BASE[plain].items():
                exponents[base] += sign * power * exponent
    found = {base: power for base, power in exponents.items() if power != 0}
    name, below = sides
    if below:
        name = f"{name or 1}/({below})" if "." in below else f"{name or 1}/{below}"
    return Unit(name, found)


class Model(NamedTuple):
    """The attributes of a model description, without its variables."""

    name: str
    identifier: str
    token: str
    text: str
    frame_s: float


def model_description(model: Model, variables: Sequence[Variable], fmi: int) -> bytes:
    """Return modelDescription.xml."""
    token = "guid" if fmi == 2 else "instantiationToken"
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{fmi}.0",
            "modelName": model.name,
            token: model.token,
            "description": model.text,
            "generationTool": f"coupled {__version__}",
            "generationDateAndTime": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "variableNamingConvention": "structured",
        },
    )
    state = "FMUstate" if fmi == 2 else "FMUState"
    able = {
        "modelIdentifier": model.identifier,
        "canHandleVariableCommunicationStepSize": "false",
        f"canGetAndSet{state}": "true",
        f"canSerialize{state}": "true",
    }
    able |= (
        {"canInterpolateInputs": "true", "canNotUseMemoryManagementFunctions": "true"}
        if fmi == 2
        else {"fixedInternalStepSize": repr(model.frame_s)}
    )
    ET.SubElement(root, "CoSimulation", able)
    _add_units(root, variables)
    ET.SubElement(ET.SubElement(root, "LogCategories"), "Category", {"name": "logStatusError"})
    ET.SubElement(root, "DefaultExperiment", {"startTime": "0", "stepSize": repr(model.frame_s)})
    listed = ET.SubElement(root, "ModelVariables")
    for reference, one in enumerate(variables):
        (_add_scalar if fmi == 2 else _add_float)(listed, reference, one)
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [r for r, one in enumerate(variables) if one.role == "output"]
    _add_structure(structure, outputs, fmi)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _add_structure(structure: ET.Element, outputs: Sequence[int], fmi: int) -> None:
    if fmi == 3:
        for name in ("Output", "InitialUnknown"):
            for reference in outputs:
                ET.SubElement(structure, name, {"valueReference": str(reference)})
        return
    for name in ("Outputs", "InitialUnknowns"):
        listed = ET.SubElement(structure, name)
        for reference in outputs:
            ET.SubElement(listed, "Unknown", {"index": str(reference + 1)})


def _add_units(root: ET.Element, variables: Sequence[Variable]) -> None:
    defined = ET.SubElement(root, "UnitDefinitions")
    found = {made.name: made for made in (unit(one.unit) for one in variables) if made.name}
    for name, made in sorted(found.items()):
        exponents = {base: str(power) for base, power in made.exponents.items()}
        ET.SubElement(ET.SubElement(defined, "Unit", {"name": name}), "BaseUnit", exponents)


_VARIABILITY = {"parameter": "tunable"}


def _head(reference: int, one: Variable) -> dict[str, str]:
    return {
        "name": one.name,
        "valueReference": str(reference),
        "causality": one.role,
        "variability": _VARIABILITY.get(one.role, "continuous"),
        "description": one.description,
    }


def _value(one: Variable) -> dict[str, str]:
    """Return the attributes of a variable's unit, range and start value."""
    found = {}
    if name := unit(one.unit).name:
        found["unit"] = name
    for key, bound in (("min", one.bounds.least), ("max", one.bounds.most)):
        if abs(bound) < LARGEST:
            found[key] = repr(bound)
    if one.role in ("input", "parameter"):
        found["start"] = repr(one.start)
    return found


def _add_scalar(listed: ET.Element, reference: int, one: Variable) -> None:
    """Add a variable of FMI 2.0."""
    scalar = ET.SubElement(listed, "ScalarVariable", _head(reference, one))
    if one.role in ("output", "parameter"):
        scalar.set("initial", "calculated" if one.role == "output" else "exact")
    ET.SubElement(scalar, "Real", _value(one))


def _add_float(listed: ET.Element, reference: int, one: Variable) -> None:
    """Add a variable of FMI 3.0."""
    ET.SubElement(listed, "Float64", _head(reference, one) | _value(one))
