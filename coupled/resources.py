"""The folders of the shipped aircraft and runs: in the repository, or in the installed package."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from coupled.errors import InputError, nearest

DEFAULT_RUN = "worst-case"


def _shipped(kind: str) -> Path:
    package = Path(__file__).parent
    installed = package / "shipped" / kind
    return installed if installed.is_dir() else package.parent / kind


@lru_cache(maxsize=8)
def _files(folder: Path, pattern: str) -> dict[str, Path]:
    """Return shipped files by name, cached."""
    return {path.stem: path for path in sorted(folder.glob(pattern))}


def aircraft_folder() -> Path:
    """Return the folder of shipped aircraft, one folder each, with its rig file."""
    return _shipped("aircraft")


def runs_folder() -> Path:
    """Return the folder of shipped run files."""
    return _shipped("runs")


def shipped_rigs() -> dict[str, Path]:
    """Return the shipped rig files by name."""
    return _files(aircraft_folder(), "*/*.toml").copy()


def shipped_runs() -> dict[str, Path]:
    """Return the shipped run files by name."""
    return _files(runs_folder(), "*.toml").copy()


def shipped_sweeps() -> dict[str, Path]:
    """Return the shipped sweep files by name."""
    return _files(runs_folder(), "sweeps/*.toml").copy()


def starter(name: str) -> Path:
    """Return the path of a commented template."""
    return Path(__file__).parent / "starters" / name


def find(name: str, shipped: dict[str, Path], kind: str, beside: Path | None = None) -> Path:
    """Return the file of a user's word: a path, or the name of a shipped one.

    A relative path is searched beside the file that names it, then in the working folder.
    """
    if "/" not in name and not name.endswith(".toml"):
        if name in shipped:
            return shipped[name]
        kinds = {"rig": shipped_rigs(), "run": shipped_runs(), "sweep": shipped_sweeps()}
        others = [f"it is a shipped {other}" for other, files in kinds.items() if name in files]
        raise InputError(name, "", f"is no shipped {kind}; {(*others, nearest(name, shipped))[0]}")
    for folder in ([beside] if beside else []) + [Path()]:
        try:
            if (folder / name).is_file():
                return folder / name
        except (OSError, ValueError):  # an impossible file name
            break
    raise InputError(name, "", f"there is no such {kind} file")


def find_named(file: Path, key: str, name: str, shipped: dict[str, Path], kind: str) -> Path:
    """Return the file named by a key of another file; an error names that file and key."""
    try:
        return find(name, shipped, kind, beside=file.parent)
    except InputError as error:
        raise InputError(file, key, f"{error.file}: {error.problem}") from None
