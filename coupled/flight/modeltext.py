"""The XML of a JSBSim model, its sections read from their own files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from coupled.files import MOST_TEXT_bytes, read_bytes

Element = ElementTree.Element


class UnreadableModelError(Exception):
    """A file of a model cannot be read as XML."""


def parsed(text: bytes, name: str) -> Element:
    """Return the root of a model's XML. Raises UnreadableModelError with the file's name.

    Python's parser raises ParseError for invalid XML, and LookupError or ValueError for an unknown
    encoding.
    """
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise UnreadableModelError(f"{name} is no XML that can be read: {error}") from None


@dataclass(frozen=True)
class ModelText:
    """The XML of a model in a folder."""

    root: Element
    folder: Path

    @classmethod
    def of(cls, main: Path) -> ModelText:
        """Read a model, given its main file."""
        return cls(read_xml(main), main.parent)

    def section(self, name: str) -> Element | None:
        """Return a section, read from its own file if it has one, or None."""
        section = self.root.find(name)
        if section is not None and (file := section.attrib.pop("file", None)) is not None:
            own = self.folder / (file if file.endswith(".xml") else f"{file}.xml")
            section[:] = list(read_xml(own))
        return section


def named_functions(aerodynamics: Element) -> dict[str, Element]:
    """Return the functions of the aerodynamics by their names."""
    functions = aerodynamics.iter("function")
    return {f.attrib["name"].strip(): f for f in functions if f.get("name", "").strip()}


def axis_of(axis: Element) -> str:
    """Return the name of an axis."""
    return axis.get("name", "").strip()


def functions_of(main: Path) -> dict[str, str]:
    """Return the axis of each named aerodynamic function of a model, given its main file.

    It is empty for a function outside the axes, to which others refer. Raises UnreadableModelError
    for a file that is not XML.
    """
    aerodynamics = ModelText.of(main).section("aerodynamics")
    if aerodynamics is None:
        return {}
    axes = {
        id(function): axis_of(axis)
        for axis in aerodynamics.findall("axis")
        for function in axis.iter("function")
    }
    return {n: axes.get(id(f), "") for n, f in named_functions(aerodynamics).items()}


def read_xml(file: Path) -> Element:
    """Return the root of a model's file. Raises UnreadableModelError, or InputError."""
    return parsed(read_bytes(file, MOST_TEXT_bytes), file.name)
