"""A JSBSim model's file, with a part of its aerodynamics scaled.

In each function F of an axis, the part due to one quantity x is F(x) − F(x₀). A factor k scales
that part,

    F ← k·F(x) + (1 − k)·F(x₀),

for any form of F: a product has its coefficient scaled, a table its values less that at x₀.
Functions outside the axis to which F refers are copied with x₀ for x. At k = 1 the model equals the
filed one to the bit. k and x₀ are properties, set after loading.

JSBSim loads files only, so the new text is in a temporary folder during loading, beside links to
the model's other files. The model's own folder is never written to.
"""

from __future__ import annotations

import copy
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from coupled.errors import InputError
from coupled.files import MOST_TEXT_bytes, clear_temporary, read_bytes, temporary_folder

Element = ElementTree.Element


@dataclass(frozen=True)
class Scaled:
    """The part of the aerodynamics due to one quantity.

    `properties` are JSBSim's names of the `quantity`, of which a model may use any; `axes` are
    those in which its part is scaled, by default all.
    """

    name: str
    quantity: str
    properties: tuple[str, ...]
    axes: tuple[str, ...] = ()

    @property
    def factor(self) -> str:
        """The property of k."""
        return f"coupled/{self.name}/factor"

    @property
    def rest(self) -> str:
        """The property of 1 − k."""
        return f"coupled/{self.name}/rest"

    def held(self, name: str) -> str:
        """Return the property of x₀ for one of `properties`."""
        return f"coupled/{self.name}/held-{self.properties.index(name)}"


# A point mass of zero, last in a model's list; `loading` sets its weight and position.
BALLAST = "coupled-ballast"


class NothingToScaleError(Exception):
    """A model has no aerodynamics due to a quantity."""

    def __init__(self, scaled: Scaled) -> None:
        super().__init__(scaled.name)
        self.scaled = scaled


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


def models_in(folder: Path) -> dict[str, Path]:
    """Return the models of a folder: {name: the folder}."""
    return {each.name: folder for each in folder.iterdir() if _is_model(each)}


def _is_model(folder: Path) -> bool:
    return (folder / f"{folder.name}.xml").is_file()


_PART = r"[A-Za-z_][\w.\-]*(?:\[\d+\])?"
_PATH = re.compile(rf"-?(/?{_PART}(?:/{_PART})+)").fullmatch
_READING = frozenset(
    ("property", "p", "input", "test", "condition", "independentVar", "min", "max", "setpoint")
)


def properties_read(main: Path) -> set[str]:
    """Return the names of the properties that a model's files read or declare.

    `main` is its main file. Files that are not XML are left out.
    """
    found, waiting, known = set[str](), [main], set[Path]()
    while waiting:
        file = waiting.pop()
        if file in known or not file.is_file():
            continue
        known.add(file)
        try:
            elements = list(_read(file).iter())
        except (UnreadableModelError, InputError):
            continue
        for element in elements:
            words = (element.text or "").split() if element.tag in _READING else []
            words.append(element.get("value", ""))
            found |= {match[1].replace("[0]", "") for word in words if (match := _PATH(word))}
            if own := element.get("file", "").removesuffix(".xml"):
                folders = ("", "Engines", "Systems")
                waiting += [main.parent / folder / f"{own}.xml" for folder in folders]
    return found


@lru_cache(maxsize=8)
def catalogue(text: str) -> Mapping[str, str]:
    """Return the access of each property in a model's catalogue: R, W or RW."""
    return {name: access for name, _, access in (x.rpartition(" (") for x in text.split("\n"))}


@contextmanager
def loadable(main: Path, scaled: Sequence[Scaled], ballast: bool = False) -> Iterator[Path]:
    """Yield the folder of models from which to load a model, with parts of it scalable.

    `main` is the model's main file. JSBSim gives the folder of a model and its file one name, so
    a file of another name gets that of the folder. With `ballast` the model has one more point
    mass, of zero weight. Raises NothingToScaleError, UnreadableModelError for a file that is not
    XML, or OSError if a temporary folder cannot be written.
    """
    folder = main.parent
    name = folder.name
    if not scaled and not ballast and main.stem == name:
        yield folder.parent
        return
    if scaled or ballast:
        state = main.stat()
        text = _scalable(main, tuple(scaled), ballast, state.st_mtime_ns, state.st_size)
    else:
        text = read_bytes(main, MOST_TEXT_bytes)
    clear_temporary()
    temporary = temporary_folder()
    try:
        made = temporary / name
        made.mkdir()
        for entry in folder.iterdir():
            if entry.name != f"{name}.xml":
                _stand_in(made / entry.name, entry.absolute())
        (made / f"{name}.xml").write_bytes(text)
        yield temporary
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _stand_in(place: Path, entry: Path) -> None:
    """Create a link to a file or folder, or a copy if links are not allowed."""
    try:
        place.symlink_to(entry, target_is_directory=entry.is_dir())
    except OSError:
        if entry.is_dir():
            shutil.copytree(entry, place)
        else:
            shutil.copyfile(entry, place)


@lru_cache(maxsize=16)
def _scalable(
    main: Path, scaled: tuple[Scaled, ...], ballast: bool, changed_ns: int, size: int
) -> bytes:
    """Return a model's text with parts of it scalable; `changed_ns` and `size` key the cache."""
    folder = main.parent
    root = _read(main)
    for one in scaled:
        aerodynamics = _section(root, folder, "aerodynamics")
        if aerodynamics is None:
            raise NothingToScaleError(one)
        _make_scalable(aerodynamics, one)
    balance = _section(root, folder, "mass_balance") if ballast else None
    if balance is not None:
        balance.append(_point_mass())
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _read(file: Path) -> Element:
    return parsed(read_bytes(file, MOST_TEXT_bytes), file.name)


def _section(root: Element, folder: Path, name: str) -> Element | None:
    """Return a section of a model, read from its own file if it has one."""
    section = root.find(name)
    if section is not None and (file := section.attrib.pop("file", None)) is not None:
        own = folder / (file if file.endswith(".xml") else f"{file}.xml")
        section[:] = list(_read(own))
    return section


def _point_mass() -> Element:
    made = Element("pointmass", {"name": BALLAST})
    ElementTree.SubElement(made, "weight", {"unit": "LBS"}).text = "0"
    place = ElementTree.SubElement(made, "location", {"unit": "IN"})
    for axis in "xyz":
        ElementTree.SubElement(place, axis).text = "0"
    return made


def _make_scalable(aerodynamics: Element, scaled: Scaled) -> None:
    named = {
        f.attrib["name"].strip(): f for f in aerodynamics.iter("function") if "name" in f.attrib
    }
    found = {name: scaled.held(name) for name in scaled.properties}
    held = dict(found)
    copies: list[Element] = []
    without = set[str]()  # functions independent of the quantity

    def depends(function: Element) -> bool:
        """Tell whether a function depends on the quantity; copy the functions in between."""
        hit = False
        for part in function.iter():
            name = _property(part)
            if name in named and name not in held and name not in without:
                without.add(name)
                if depends(named[name]):
                    without.discard(name)
                    held[name] = f"{name}-{scaled.name}-held"
                    copies.append(_held_copy(named[name], held, held[name]))
            hit = hit or name in held
        return hit

    touched = [
        function
        for axis in aerodynamics.findall("axis")
        if not scaled.axes or axis.get("name", "").strip() in scaled.axes
        for function in axis.findall("function")
        if depends(function)
    ]
    if not touched:
        raise NothingToScaleError(scaled)
    for function in touched:
        _scale(function, scaled, held)
    values = {scaled.factor: "1", scaled.rest: "0", **dict.fromkeys(found.values(), "0")}
    for place, (name, value) in enumerate(values.items()):
        declared = Element("property", {"value": value})
        declared.text = name
        aerodynamics.insert(place, declared)
    first_axis = list(aerodynamics).index(aerodynamics.findall("axis")[0])
    aerodynamics[first_axis:first_axis] = copies


def _property(element: Element) -> str:
    """Return the property that an element of a function names, or an empty string."""
    return (element.text or "").strip().removeprefix("-")


def _held_copy(function: Element, held: dict[str, str], name: str = "") -> Element:
    """Return a copy of a function with its references held at x₀."""
    made = copy.deepcopy(function)
    for part in made.iter():
        if (old := _property(part)) in held:
            part.text = (part.text or "").replace(old, held[old])
        part.attrib.pop("name", None)  # of a table; names of properties are unique
    if name:
        made.set("name", name)
    return made


def _scale(function: Element, scaled: Scaled, held: dict[str, str]) -> None:
    """Make a function k times its value, plus 1 − k times that at x₀."""
    bodies = [part for part in function if part.tag != "description"]
    total = Element("sum")
    for factor, terms in (
        (scaled.factor, bodies),
        (scaled.rest, [_held_copy(body, held) for body in bodies]),
    ):
        product = ElementTree.SubElement(total, "product")
        ElementTree.SubElement(product, "property").text = factor
        product.extend(terms)
    for body in bodies:
        function.remove(body)
    function.append(total)
