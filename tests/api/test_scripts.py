"""A plain script that sweeps, without the guard that new processes need."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CALL = """
found = coupled.sweep(
    {
        "name": "bends",
        "run": "appendix-c",
        "configurations": ["uncompensated"],
        "vary": [
            {"key": "rig.controls.column.loader.bend_m_per_N", "values": [1e-5, 5e-5, 9e-5]}
        ],
    },
    workers=2,
)
print("loss", found.to_polars()["loss"].round(3).to_list())
"""


@pytest.mark.slow
@pytest.mark.parametrize("guard", [False, True])
def test_a_script_with_and_without_the_guard_sweeps(guard: bool, tmp_path: Path) -> None:
    body = CALL
    if guard:
        body = 'if __name__ == "__main__":\n' + "\n".join(
            f"    {line}" for line in CALL.split("\n")
        )
    script = tmp_path / "mine.py"
    script.write_text("import coupled\n" + body + "\n")
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "loss [0.018, 0.084, 0.142]\n"
    lines = [line for line in done.stderr.splitlines() if line]
    if guard:
        assert lines == []
    else:
        [line] = lines
        assert line.startswith("note: works in one process, not in 2: this script")
