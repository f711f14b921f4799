"""The file from which JSBSim loads a model: its own, or one with scalable parts (`modelparts`).

JSBSim loads files only, so the new text is in a temporary folder during loading, beside links to
the model's other files. The model's own folder is never written to.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from coupled.errors import InputError
from coupled.files import MOST_TEXT_bytes, clear_temporary, read_bytes, temporary_folder
from coupled.flight.modelparts import Part
from coupled.flight.modeltext import ModelText, UnreadableModelError, read_xml

Element = ElementTree.Element
# Point masses of zero, last in a model's list; `loading` sets their weights and positions.
BALLAST = "coupled-ballast"


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
            elements = list(read_xml(file).iter())
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
def loadable(main: Path, scaled: Sequence[Part], ballasts: int = 0) -> Iterator[Path]:
    """Yield the folder of models from which to load a model, with parts of it scalable.

    `main` is the model's main file. JSBSim gives the folder of a model and its file one name, so
    a file of another name gets that of the folder. The model has `ballasts` more point masses, of
    zero weight. Raises NothingToScaleError, UnreadableModelError for a file that is not XML, or
    OSError if a temporary folder cannot be written.
    """
    folder = main.parent
    name = folder.name
    if not scaled and not ballasts and main.stem == name:
        yield folder.parent
        return
    if scaled or ballasts:
        state = main.stat()
        text = _scalable(main, tuple(scaled), ballasts, state.st_mtime_ns, state.st_size)
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
    main: Path, scaled: tuple[Part, ...], ballasts: int, changed_ns: int, size: int
) -> bytes:
    """Return a model's text with parts of it scalable; `changed_ns` and `size` key the cache."""
    model = ModelText.of(main)
    for part in scaled:
        part.make_scalable(model)
    balance = model.section("mass_balance") if ballasts else None
    if balance is not None:
        balance.extend(_point_mass(number) for number in range(ballasts))
    text: bytes = ElementTree.tostring(model.root, encoding="utf-8", xml_declaration=True)
    return text


def _point_mass(number: int) -> Element:
    made = Element("pointmass", {"name": f"{BALLAST}-{number}"})
    ElementTree.SubElement(made, "weight", {"unit": "LBS"}).text = "0"
    place = ElementTree.SubElement(made, "location", {"unit": "IN"})
    for axis in "xyz":
        ElementTree.SubElement(place, axis).text = "0"
    return made
