"""The machine code that a wheel brings along, so that its first start compiles little."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from coupled.rig.compiled import load, shippable
from coupled.rig.placed import step_frame_at
from coupled.rig.statics import static_at


def write_machine_code(folder: Path) -> None:
    """Compile the frame step and the statics for this platform, a file each in a folder.

    Each is loaded, which ends the process if the platform lacks a function that the code calls.
    """
    kernels: tuple[Any, ...] = (step_frame_at, static_at)
    for kernel in kernels:
        name, code = shippable(kernel)
        (folder / name).write_bytes(code)
        load(folder / name, kernel.py_func.__name__)
