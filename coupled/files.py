"""Safe reading of regular files, and atomic writing.

A path to read may be a folder, a pipe, a device or a file of any size: every reader opens it here.
A file is written under a temporary name in the same folder, which contains the process number, and
renamed. Temporary files of killed processes are removed by the next process that writes into the
folder.
"""

from __future__ import annotations

import contextlib
import difflib
import hashlib
import json
import math
import os
import platform
import re
import secrets
import shutil
import stat
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterable
from functools import lru_cache
from io import BufferedReader
from pathlib import Path
from typing import Any

from coupled.errors import InputError

MOST_TEXT_bytes = 64 * 2**20  # a text written by a person or this program
MOST_TABLE_bytes = 4 * 2**30  # a table of numbers: hours of a record
_AT_ONCE = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_STARTED_s = time.time()
_HOST = re.sub(r"[^A-Za-z0-9]", "_", platform.node())[:40]
_UNFINISHED = re.compile(r"\.coupled-([A-Za-z0-9_]*)-(\d{1,9})-[0-9a-f]{12}(\.[^/]*)?", re.DOTALL)


def named(path: Path) -> Path:
    """Return a path with a file name. Raises InputError for `.` or `/`."""
    if not path.name:
        raise InputError(path, "", "names no file and no new folder; give one by its name")
    return path


def open_file(path: Path, most_bytes: int = MOST_TABLE_bytes) -> BufferedReader:
    """Return an open regular file of at most `most_bytes`.

    Raises InputError for a folder, a pipe, a socket or a device, without waiting.
    """
    try:
        # Opening a pipe without a writer would wait.
        handle = os.open(path, os.O_RDONLY | _AT_ONCE)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    found = os.fstat(handle)
    if stat.S_ISREG(found.st_mode) and found.st_size <= most_bytes:
        return os.fdopen(handle, "rb")
    os.close(handle)
    if stat.S_ISDIR(found.st_mode):
        raise InputError(path, "", "cannot be read: is a folder; give a file")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(path, "", "is a pipe or a device; give a file")
    raise _too_large(path, most_bytes)


def read_bytes(path: Path, most_bytes: int = MOST_TABLE_bytes) -> bytes:
    """Return the content of a file. Raises InputError if it cannot be read or is too large."""
    with open_file(path, most_bytes) as file:
        try:
            content = file.read(most_bytes + 1)
        except OSError as error:
            raise _unreadable(path, error) from None
    if len(content) > most_bytes:
        raise _too_large(path, most_bytes)
    return content


def read_text(path: Path, wanted: str, most_bytes: int = MOST_TEXT_bytes) -> str:
    """Return a UTF-8 text, with or without byte order mark; `wanted` is for the error message."""
    try:
        text = read_bytes(path, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(path, "", f"is not text in UTF-8; {wanted}") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_json(path: Path, wanted: str) -> Any:
    """Return the content of a JSON file; `wanted` is for the error message."""
    text = read_text(path, wanted)
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise InputError(path, "", f"is not JSON; {wanted}") from None


@lru_cache(maxsize=16)
def toml_tables(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text, cached: do not change them.

    Raises ValueError or RecursionError if it is not TOML.
    """
    return tomllib.loads(text)


def sha256(path: Path) -> str:
    """Return the SHA-256 hash of a file."""
    with open_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_format(found: object, known: int, file: object, what: str) -> int:
    """Return the version of a file's format; 0 for a file without a format.

    `found` is the file's own `format` or None; `known` the newest that this release reads; `what`
    the kind of file. Raises InputError for a newer one.
    """
    if found is None:
        return 0
    if not isinstance(found, int) or isinstance(found, bool) or found < 1:
        raise InputError(file, "format", f"should be a whole number from 1 to {known}")
    if found > known:
        problem = f"this {what} is of format {found}, written by a newer release of coupled; this"
        problem += f" one reads up to {known}: install the newer, or make the {what} anew with this"
        raise InputError(file, "format", problem)
    return found


def _unreadable(path: Path, error: OSError | ValueError) -> InputError:
    why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return InputError(path, "", f"cannot be read: {why}")


def _too_large(path: Path, most_bytes: int) -> InputError:
    size = f"{most_bytes / 2**20:g} MiB" if most_bytes < 2**30 else f"{most_bytes / 2**30:g} GiB"
    return InputError(path, "", f"is larger than {size}, the most that is read here")


_READ = "is a file that this command reads; give another to write"


def check_target(
    path: Path, inputs: Iterable[Path] = (), why: str = _READ, made: Path | None = None
) -> None:
    """Refuse a file that cannot be written, before its content is computed.

    Nothing is created or changed. `inputs` are files that must not be overwritten, under any name
    or link; `why` is the message for them. The file's folder must exist, unless it is `made`, a
    folder that the command creates, or `out`.
    """
    check_targets([path], inputs, why, made)


def check_targets(
    paths: Iterable[Path],
    inputs: Iterable[Path] = (),
    why: str = _READ,
    made: Path | None = None,
) -> None:
    """Refuse files of which one cannot be written, is an input, or occurs twice."""
    if made is not None and made.resolve() == made.resolve().parent:
        raise InputError(made, "", "is the root of the file system; give a folder of its own")
    read = {identity for path in inputs for identity in _identities(path)}
    written: set[object] = set()
    for path in paths:
        try:
            _check_place(path)
            _refuse_mistyped(path, made)
        except InputError:
            raise
        except (OSError, ValueError):
            raise InputError(path, "", "cannot be written there") from None
        identities = _identities(path)
        if not read.isdisjoint(identities):
            raise InputError(path, "", why)
        if not written.isdisjoint(identities):
            raise InputError(path, "", "would be written twice; give each output its own file")
        written |= identities


def _check_place(path: Path) -> None:
    if path.is_dir():
        raise InputError(path, "", "is a folder; give a file")
    if path.exists() and not path.is_file():
        raise InputError(path, "", "is a pipe or a device; give a file to write")
    parent = path.absolute().parent
    while not parent.exists():
        parent = parent.parent
    if not parent.is_dir() or not os.access(parent, os.W_OK) or len(os.fsencode(path.name)) > 200:
        raise InputError(path, "", "cannot be written there")


OWN_FOLDER = "out"  # default folder of output files, created if needed


def _refuse_mistyped(path: Path, made: Path | None) -> None:
    """Refuse a file in a folder that does not exist, since its name may be mistyped."""
    own, folder = Path(OWN_FOLDER).absolute(), path.absolute().parent
    if made is not None and made.absolute() in (folder, *folder.parents):
        folder = made.absolute().parent
    if folder.exists() or folder == own or own in folder.parents:
        return
    found: list[str] = []
    with contextlib.suppress(OSError):
        found = [entry.name for entry in os.scandir(folder.parent) if entry.is_dir()]
    hint = difflib.get_close_matches(folder.name, found, n=1)
    meant = f"did you mean {hint[0]}?" if hint else "make it first"
    raise InputError(path, "", f"there is no folder {folder.name}; {meant}")


def _identities(path: Path) -> set[object]:
    """Return the identities of a file under all its names: its resolved path and its inode."""
    found: set[object] = {os.path.realpath(path)}
    try:
        there = path.stat()
    except (OSError, ValueError):
        return found
    return found | {(there.st_dev, there.st_ino)}


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file atomically: `write` receives a temporary path in the same folder."""
    part = path.parent / unfinished_name(path.suffix)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        clear(path.parent)
        part.touch(exist_ok=False)
        write(part)
        part.replace(path)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text atomically; file names that are not valid text are written with `?`."""
    write_whole(path, lambda part: part.write_bytes(text.encode("utf-8", "replace")))


def json_text(table: Any, indent: int = 2, sort_keys: bool = False) -> str:
    """Return a table as JSON with non-ASCII letters; escaped if a file name is not valid text."""
    plain = finite(table)
    text = json.dumps(
        plain, indent=indent, sort_keys=sort_keys, ensure_ascii=False, allow_nan=False
    )
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        text = json.dumps(plain, indent=indent, sort_keys=sort_keys, allow_nan=False)
    return text + "\n"


def finite(table: Any) -> Any:
    """Return nested tables and lists with None for each number that is not finite.

    JSON has neither infinity nor NaN, and strict readers refuse such a file.
    """
    if isinstance(table, dict):
        return {key: finite(value) for key, value in table.items()}
    if isinstance(table, (list, tuple)):
        return [finite(value) for value in table]
    return None if isinstance(table, float) and not math.isfinite(table) else table


def unwritable(path: Path, error: OSError) -> InputError:
    """Return the error of a file that the system cannot write."""
    return InputError(path, "", f"cannot be written: {error.strerror or error}")


def unfinished_name(suffix: str) -> str:
    """Return a new name for a temporary file, with the names of computer and process."""
    return f".coupled-{_HOST}-{os.getpid()}-{secrets.token_hex(6)}{suffix}"


def clear(folder: Path) -> None:
    """Remove temporary files of killed processes on this computer from a folder, once."""
    _clear(folder.absolute())


def temporary_folder() -> Path:
    """Create a temporary folder and return it; the caller removes it.

    Its name contains the process number, so that another process removes it if this one is killed.
    """
    made = Path(tempfile.gettempdir()) / unfinished_name("")
    made.mkdir(mode=0o700)
    return made


def clear_temporary(again: bool = False) -> None:
    """Remove temporary folders of killed processes, once per process unless `again`."""
    with contextlib.suppress(OSError):
        (_clear.__wrapped__ if again else _clear)(Path(tempfile.gettempdir()))


@lru_cache(maxsize=1000)
def _clear(folder: Path) -> None:
    with os.scandir(folder) as entries:
        left = [entry.path for entry in entries if _UNFINISHED.fullmatch(entry.name)]
    for name in left:
        path = Path(name)
        try:
            if not _is_stale(path):
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()
        except OSError:
            continue  # another process removes it, or this one may not


def _is_stale(path: Path) -> bool:
    """Return whether no living process of this computer writes a temporary file."""
    match = _UNFINISHED.fullmatch(path.name)
    if match is None or match[1] != _HOST or os.name != "posix":
        return False
    process = int(match[2])
    if process == os.getpid():  # in containers every run may have the same number
        return path.stat().st_mtime < _STARTED_s - 1.0
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False


def path_from(folder: Path, path: Path) -> str:
    """Return a path relative to a folder, with slashes; an absolute path on another drive."""
    try:
        return Path(os.path.relpath(path, folder.resolve())).as_posix()
    except ValueError:  # on Windows
        return path.resolve().as_posix()
