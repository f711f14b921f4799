"""A program that simulates FMUs by FMPy, without this package: python simulate_fmus.py FOLDER.

For each FOLDER/NAME.fmu with FOLDER/NAME.npz, its inputs and start values by name, it writes
FOLDER/NAME.out.npz, the outputs by name, and in `problems` what FMPy's validation says.
"""

from __future__ import annotations

import sys
from pathlib import Path

import fmpy
import numpy as np
from fmpy.validation import validate_fmu


def simulate(fmu: Path) -> None:
    """Simulate an FMU with its inputs."""
    with np.load(fmu.with_suffix(".npz")) as given:
        columns = {name: given[name] for name in given.files}
    starts = {name: float(value) for name, value in columns.items() if value.ndim == 0}
    columns = {name: value for name, value in columns.items() if value.ndim}
    signals = np.zeros(len(columns["time"]), [(name, float) for name in columns])
    for name, column in columns.items():
        signals[name] = column
    found = fmpy.simulate_fmu(
        str(fmu),
        start_values=starts,
        stop_time=columns["time"][-1],
        output_interval=columns["time"][1],
        input=signals,
    )
    outputs = {name: found[name] for name in found.dtype.names}
    np.savez(fmu.with_suffix(".out.npz"), problems=np.array(validate_fmu(str(fmu))), **outputs)


if __name__ == "__main__":
    for path in sorted(Path(sys.argv[1]).glob("*.fmu")):
        simulate(path)
    assert "coupled" not in sys.modules
