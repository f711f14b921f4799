"""The provenance of a report: the command, software versions, and input files."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

from coupled.files import read_text, sha256
from coupled.flight.manifest import versions
from coupled.reports.page import InputFile, Provenance

_READ_BY_PEOPLE = ".toml"


def provenance_of(command: str, inputs: Iterable[Path]) -> Provenance:
    """Return the provenance of a report: the command line, versions, and the files read.

    A file is named once, without its folder. The text of TOML files is included, since rig, run and
    sweep files contain all settings with their units.
    """
    files = {path.resolve(): path for path in inputs if path.is_file()}
    ran = {**versions(), "matplotlib": version("matplotlib")}
    return Provenance(command, tuple(ran.items()), tuple(_input(path) for path in files.values()))


def _input(path: Path) -> InputFile:
    text = ""
    if path.suffix == _READ_BY_PEOPLE:
        text = read_text(path, "as a TOML file is").rstrip()
    return InputFile(path.name, sha256(path), text)
