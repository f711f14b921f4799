"""What made a report: the command, the versions of what ran, and the files that went in."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

from coupled.files import read_text, sha256
from coupled.flight.manifest import versions
from coupled.reports.page import InputFile, Made

_READ_BY_PEOPLE = ".toml"


def made_by(command: str, inputs: Iterable[Path]) -> Made:
    """Return what made a report, of the command's words and the files that it read.

    A file is named without its folder, and once. Of a TOML file the text is kept: rig, run and
    sweep files say with their units all that was set.
    """
    files = {path.resolve(): path for path in inputs if path.is_file()}
    ran = {**versions(), "matplotlib": version("matplotlib")}
    return Made(command, tuple(ran.items()), tuple(_input(path) for path in files.values()))


def _input(path: Path) -> InputFile:
    text = ""
    if path.suffix == _READ_BY_PEOPLE:
        text = read_text(path, "as a TOML file is").rstrip()
    return InputFile(path.name, sha256(path), text)
