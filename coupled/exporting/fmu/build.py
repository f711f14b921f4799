"""The shared library of an FMU, linked by the machine's C compiler."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from coupled.errors import InputError
from coupled.exporting.fmu.kernel import object_codes
from coupled.files import temporary_folder

COMPILERS = ("cc", "gcc", "clang")
_SOURCES = Path(__file__).parent / "c"
_FLAGS = ("-std=c11", "-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")
# All symbols are found at the link, and the stack is not executable.
_OF_SYSTEM = {"linux": ("-Wl,-z,defs", "-Wl,-z,noexecstack", "-Wl,--gc-sections", "-s")}
_SUFFIX = {"linux": ".so", "darwin": ".dylib", "windows": ".dll"}
_MACHINE = {"amd64": "x86_64", "arm64": "aarch64"}
_FMI2 = {"x86_64-linux": "linux64", "x86_64-windows": "win64", "x86_64-darwin": "darwin64"}


class Platform(NamedTuple):
    """The system and processor that a shared library is for."""

    system: str  # linux, darwin or windows
    machine: str  # x86_64 or aarch64

    def __str__(self) -> str:
        return f"{self.system} on {self.machine}"

    @property
    def suffix(self) -> str:
        """The ending of a shared library."""
        return _SUFFIX[self.system]

    def folder(self, fmi: int) -> str:
        """Return FMI's name of the platform."""
        name = f"{self.machine}-{self.system}"
        return _FMI2.get(name, name) if fmi == 2 else name


def this_platform() -> Platform:
    """Return the platform of this machine. Raises InputError for one that FMI has no name for."""
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    machine = platform.machine().lower()
    machine = _MACHINE.get(machine, machine)
    if system not in _SUFFIX or machine not in _MACHINE.values():
        problem = f"is not possible for {system} on {machine}; x86_64 and aarch64 of {_named()} are"
        raise InputError("FMU", "", problem)
    return Platform(system, machine)


def _named() -> str:
    return ", ".join(_SUFFIX)


def c_compiler() -> list[str]:
    """Return the command of the C compiler: that of CC, or the first of `COMPILERS`.

    Raises InputError without one.
    """
    named = os.environ.get("CC", "")
    for words in [shlex.split(named)] if named else [[name] for name in COMPILERS]:
        if words and shutil.which(words[0]):
            return words
    missing = named or ", ".join(COMPILERS)
    problem = f"needs a C compiler to link it, and there is none ({missing}): install gcc or clang"
    raise InputError("FMU", "", f"{problem}, or name one in the variable CC")


def shared_library(header: str, fmi: int, made_for: Platform) -> bytes:
    """Return the shared library of an FMU, with `header` as its `model.h`."""
    command = c_compiler()
    folder = temporary_folder()
    try:
        sources = ("instance.h", "instance.c", f"fmi{fmi}.c")
        _fill(folder, {name: (_SOURCES / name).read_bytes() for name in sources})
        _fill(folder, {"model.h": header.encode(), **object_codes()})
        names = sorted(each.name for each in folder.iterdir() if each.suffix != ".h")
        made = f"model{made_for.suffix}"
        flags = [*_FLAGS, *_OF_SYSTEM.get(made_for.system, ())]
        done = subprocess.run(
            [*command, *flags, *names, "-lm", "-o", made],
            cwd=folder,
            check=False,
            capture_output=True,
            text=True,
            errors="replace",
        )
        if done.returncode != 0:
            said = done.stderr.strip() or f"exit code {done.returncode}"
            raise InputError("FMU", "", f"{shlex.join(command)} cannot link it: {said}")
        return (folder / made).read_bytes()
    except OSError as error:
        raise InputError("FMU", "", f"cannot be linked: {error}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _fill(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        (folder / name).write_bytes(content)
