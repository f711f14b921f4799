"""The file from which JSBSim loads a model: its own, or one with scalable parts (`modelparts`).

JSBSim loads files only, so the new text is in a temporary folder during loading, beside links to
the model's other files. The model's own folder is never written to.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from coupled.files import clear_temporary, temporary_folder
from coupled.flight.modelparts import Part
from coupled.flight.modeltext import ModelText

Element = ElementTree.Element
# Point masses of zero, last in a model's list; `loading` sets their weights and positions.
BALLAST = "coupled-ballast"


def models_in(folder: Path) -> dict[str, Path]:
    """Return the models of a folder: {name: the folder}."""
    return {each.name: folder for each in folder.iterdir() if _is_model(each)}


def _is_model(folder: Path) -> bool:
    return (folder / f"{folder.name}.xml").is_file()


@lru_cache(maxsize=8)
def catalogue(text: str) -> Mapping[str, str]:
    """Return the access of each property in a model's catalogue: R, W or RW."""
    return {name: access for name, _, access in (x.rpartition(" (") for x in text.split("\n"))}


@contextmanager
def loadable(models: Path, name: str, scaled: Sequence[Part], ballasts: int = 0) -> Iterator[Path]:
    """Yield the folder of models from which to load a model, with parts of it scalable.

    It has `ballasts` more point masses, of zero weight. Raises NothingToScaleError,
    UnreadableModelError for a file that is not XML, or OSError if a temporary folder cannot be
    written.
    """
    if not scaled and not ballasts:
        yield models
        return
    folder = models / name
    state = (folder / f"{name}.xml").stat()
    text = _scalable(folder, tuple(scaled), ballasts, state.st_mtime_ns, state.st_size)
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
    folder: Path, scaled: tuple[Part, ...], ballasts: int, changed_ns: int, size: int
) -> bytes:
    """Return a model's text with parts of it scalable; `changed_ns` and `size` key the cache."""
    model = ModelText.of(folder.parent, folder.name)
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
