"""Several files that are written together or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from coupled.errors import InputError
from coupled.files import clear, unfinished_name, unwritable

# Errors of writing to a full disk, without the name of the file.
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)


class Outputs:
    """Several files that are put in place together: all of them, or none.

    Within `with Outputs() as outputs:` each file is written to `outputs.at(path)`, in a temporary
    folder beside its place, with its own file name. All files are moved at the end of the block.
    After an exception, or if a move fails, everything is restored, including new folders.
    """

    def __init__(self) -> None:
        self._staged: dict[Path, Path] = {}  # {folder: temporary folder}
        self._made: list[Path] = []  # new folders

    def at(self, path: Path) -> Path:
        """Return the temporary path for a file that belongs at `path`."""
        return self.folder(path.parent) / path.name

    def folder(self, folder: Path) -> Path:
        """Return the temporary folder for files that belong in `folder`."""
        if folder not in self._staged:
            staged = folder / unfinished_name("")
            try:
                self._make(folder)
                clear(folder)
                staged.mkdir()
            except OSError as error:
                raise unwritable(folder, error) from None
            self._staged[folder] = staged
        return self._staged[folder]

    def __enter__(self) -> Outputs:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        done = False
        try:
            if kind is None:
                self._put_in_place()
                done = True
        finally:
            for staged in self._staged.values():
                shutil.rmtree(staged, ignore_errors=True)
            for folder in [] if done else reversed(self._made):
                _remove_empty(folder)
        if isinstance(error, InputError):
            raise self._renamed(error) from None
        if isinstance(error, OSError) and error.errno in FULL and self._staged:
            raise unwritable(next(iter(self._staged)), error) from None

    def _make(self, folder: Path) -> None:
        missing = [place for place in (folder, *folder.parents) if not place.exists()]
        for place in reversed(missing):
            place.mkdir(exist_ok=True)
            self._made.append(place)

    def _put_in_place(self) -> None:
        undo: list[tuple[Path, Path | None]] = []
        try:
            for part, path in self._moves():
                before = None
                if path.is_file():
                    before = part.with_name(unfinished_name(""))
                    _keep(path, before)
                undo.append((path, before))
                part.replace(path)
        except BaseException as error:
            for path, before in reversed(undo):
                _restore(path, before)
            if isinstance(error, OSError):
                raise unwritable(undo[-1][0] if undo else Path(), error) from None
            raise

    def _moves(self) -> Iterator[tuple[Path, Path]]:
        for folder, staged in self._staged.items():
            for part in sorted(staged.iterdir()):
                yield part, folder / part.name

    def _renamed(self, error: InputError) -> InputError:
        """Return the error of a temporary file with the file name that the user knows."""
        file, problem = error.file, error.problem
        for staged in self._staged.values():
            file, problem = (text.replace(staged.name + os.sep, "") for text in (file, problem))
        return InputError(file, error.key, problem)


def _keep(path: Path, kept: Path) -> None:
    try:
        os.link(path, kept, follow_symlinks=False)
    except (OSError, NotImplementedError):  # a file system without hard links
        path.replace(kept)


def _restore(path: Path, before: Path | None) -> None:
    try:
        if before is None:
            path.unlink(missing_ok=True)
        elif before.exists():
            before.replace(path)
    except OSError:
        return  # the disk is gone


def _remove_empty(folder: Path) -> None:
    try:
        folder.rmdir()
    except OSError:
        return  # another process has written there in the meantime
