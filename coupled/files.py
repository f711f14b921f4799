"""Files are written whole or not at all."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from coupled.errors import InputError


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` make a file beside `path`, then put it in its place in one step."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
    except OSError as error:
        raise InputError(path, "", f"cannot be written: {error.strerror}") from None
    os.close(handle)
    part = Path(name)
    try:
        write(part)
        part.chmod(0o666 & ~_umask())
        part.replace(path)
    except OSError as error:
        raise InputError(path, "", f"cannot be written: {error.strerror or error}") from None
    finally:
        part.unlink(missing_ok=True)


def check_target(path: Path, inputs: Iterable[Path] = ()) -> None:
    """Refuse a file that could not be written, before the work that it is to hold.

    Nothing is made or changed. `inputs` are files that must not be overwritten.
    """
    try:
        if path.is_dir():
            raise InputError(path, "", "is a folder; give a file")
        if any(other.is_file() and path.exists() and path.samefile(other) for other in inputs):
            raise InputError(path, "", "is a file that this reads; give another to write")
        parent = path.absolute().parent
        while not parent.exists():
            parent = parent.parent
        if not parent.is_dir() or not os.access(parent, os.W_OK) or len(path.name) > 200:
            raise InputError(path, "", "cannot be written there")
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(path, "", "cannot be written there") from None


def read_text(path: Path, wanted: str) -> str:
    """Return a text file in UTF-8, with a mark at its start or without; `wanted` is said if not."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise InputError(path, "", f"is not text in UTF-8; {wanted}") from None


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, whole."""
    write_whole(path, lambda part: part.write_text(text, encoding="utf-8"))


def sha256(path: Path) -> str:
    """Return a file's hash."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
