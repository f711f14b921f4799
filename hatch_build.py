"""Puts the physics' machine code for this platform into a wheel, so that its first start is quick.

It is no part of an editable install, and a wheel is whole without it: what it lacks is compiled at
the first start.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_NEEDED = {"numba", "numpy", "pydantic", "scipy", "tomlkit"}  # by coupled.rig
_WRITE = """
import sys
from pathlib import Path
from coupled.rig.shipped import write_machine_code
write_machine_code(Path(sys.argv[1]))
"""


def _environment(root: str, cache: str) -> dict[str, str]:
    """Return the environment of the compiling process, which finds what the build has installed.

    pip has it in a folder that only this process's path names. Numba's cache would be written into
    the sources.
    """
    path = os.pathsep.join([root, *filter(None, sys.path)])
    return {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": cache}


class MachineCode(BuildHookInterface[Any]):
    """Compiles the kernels that every flight needs, and includes them as data."""

    def dependencies(self) -> list[str]:
        """Return what compiling needs, as the project requires it."""
        required = self.metadata.core.dependencies
        return [each for each in required if re.split(r"[<>=!~ ]", each)[0] in _NEEDED]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and include the files in the wheel."""
        if version == "editable":
            return
        self._folder = tempfile.TemporaryDirectory()
        place = self._folder.name
        self.app.display_info("compiling the physics…")
        words = [sys.executable, "-c", _WRITE, place]
        done = subprocess.run(
            words, env=_environment(self.root, place), capture_output=True, text=True, check=False
        )
        if done.returncode:
            last = done.stderr.strip().splitlines()[-1:]
            self.app.display_warning(f"without machine code, compiled at first start: {last}")
            return
        for file in Path(place).glob("*.o"):
            build_data["force_include"][str(file)] = f"coupled/shipped/machine/{file.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the files."""
        if version != "editable":
            self._folder.cleanup()
