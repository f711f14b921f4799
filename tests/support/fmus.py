"""FMUs of rigs for tests, loaded by FMPy."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

import coupled
from coupled.exporting.fmu.write import Fmu, make_fmu, write_fmu
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
SIMULATE = Path(__file__).parent / "simulate_fmus.py"
AT_END = ("_computed_m", "_deflection_m", "_computed_rad", "_deflection_rad")


@dataclass
class Loaded:
    """An FMU in this process, with its description and the messages of its instances."""

    made: Fmu
    file: Path
    folder: Path
    said: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.described: Any = fmpy.read_model_description(str(self.file))
        self.at = {v.name: v.valueReference for v in self.described.modelVariables}

    @property
    def library(self) -> Path:
        """The shared library."""
        return next((self.folder / "binaries").rglob("*.*"))

    def instance(self, initialized: bool = True, **starts: float) -> Any:
        """Return a new instance, initialized with start values by name."""
        kind = FMU2Slave if self.made.fmi == 2 else FMU3Slave
        one = kind(
            guid=self.described.guid,
            unzipDirectory=str(self.folder),
            modelIdentifier=self.described.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self._instantiate(one)
        if not initialized:
            return one
        if self.made.fmi == 2:
            one.setupExperiment(startTime=0.0)
        one.enterInitializationMode()
        self.set(one, **starts)
        one.exitInitializationMode()
        return one

    def _instantiate(self, one: Any) -> None:
        def log(message: bytes) -> None:
            self.said.append(message.decode())

        if self.made.fmi == 3:
            one.instantiate(logMessage=lambda _, status, category, message: log(message))
            return
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(lambda a, b, c, d, message: log(message))
        one.instantiate(callbacks=callbacks)

    def set(self, one: Any, **values: float) -> None:
        """Set variables of an instance by name."""
        references = [self.at[name] for name in values]
        (one.setReal if self.made.fmi == 2 else one.setFloat64)(references, list(values.values()))

    def get(self, one: Any, *names: str) -> list[float]:
        """Return variables of an instance by name; without names all outputs."""
        references = [self.at[name] for name in names or self.made.outputs]
        found = (one.getReal if self.made.fmi == 2 else one.getFloat64)(references)
        return list(map(float, found))

    def run(self, one: Any, first: int, forces: Floats) -> list[list[float]]:
        """Step an instance from a frame on with held forces; return its outputs after each step."""
        found = []
        for k, force in enumerate(forces.tolist(), first):
            self.set(one, **{f"{self.made.control}_force_N": force})
            one.doStep(k * self.made.frame_s, self.made.frame_s)
            found.append(self.get(one))
        return found

    def saved(self, one: Any) -> Any:
        """Return a saved state of an instance."""
        return one.getFMUstate() if self.made.fmi == 2 else one.getFMUState()

    def restore(self, one: Any, state: Any) -> None:
        """Set a saved state of an instance."""
        (one.setFMUstate if self.made.fmi == 2 else one.setFMUState)(state)


def loaded(rig: Rig, folder: Path, control: str = "", fmi: Any = 3) -> Loaded:
    """Return the FMU of a control, made and unpacked in a folder."""
    made = make_fmu(rig, control, fmi)
    file = folder / f"{rig.name}-{made.control}-{fmi}.fmu"
    write_fmu(made, file)
    return Loaded(made, file, Path(fmpy.extract(str(file), unzipdir=str(file.with_suffix("")))))


def flown(rig: Rig, control: str, seconds: float, seed: int) -> Record:
    """Return a flight with a random force on a control, linear between frames, without noise."""
    rate, rng = rig.frame_rate, np.random.default_rng(seed)
    times = np.arange(round(seconds * rate) + 1) / rate
    corners = np.arange(0.0, seconds + 0.3, 0.3)
    loader = rig[f"controls.{control}.loader"]
    most = 40.0 + 3.0 * (loader.breakout + loader.friction)
    forces = np.interp(times, corners, most * rng.standard_normal(len(corners)))
    pilot: Any = coupled.ForceTable(time_s=times.tolist(), force_N=(forces - forces[0]).tolist())
    more: dict[str, Any] = {}
    if rig.flight is None:
        pressures = 1500.0 + 900.0 * np.sin(2.0 * times)
        profile = coupled.PressureProfile(
            time_s=times.tolist(), dynamic_pressure_Pa=pressures.tolist()
        )
        more = {"dynamic_pressure_Pa": profile}
    quiet = rig.changed({"noise": {}})
    flight = coupled.fly(quiet, **{control: pilot}, duration_s=seconds, **more)
    assert flight.record is not None
    return flight.record


def inputs_of(record: Record, made: Fmu) -> dict[str, Any]:
    """Return an FMU's inputs from a record."""
    force = record[f"{made.control}_hand_force_N"]
    found = {"time": record.time_s, f"{made.control}_force_N": force}
    slopes = np.append(np.diff(force), 0.0) / made.frame_s
    found[f"{made.control}_force_rate_N_per_s"] = slopes
    for name in ("dynamic_pressure_Pa", "load_factor", "alpha_rad"):
        if name in made.inputs and name in record:
            found[name] = record[name]
    return found


def give(one: Loaded, columns: Mapping[str, Any]) -> None:
    """Write an FMU's inputs and start values for `simulated`."""
    np.savez(one.file.with_suffix(".npz"), **dict(columns))


def simulated(folder: Path) -> dict[str, dict[str, Any]]:
    """Simulate all FMUs of a folder in another process; return their outputs by name of file."""
    words = [sys.executable, "-I", str(SIMULATE), str(folder)]
    done = subprocess.run(words, check=False, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    found = {}
    for file in folder.glob("*.out.npz"):
        with np.load(file) as outputs:
            found[file.name.removesuffix(".out.npz")] = {n: outputs[n] for n in outputs.files}
    return found


def assert_follows(found: Mapping[str, Any], record: Record, made: Fmu) -> None:
    """Assert that an FMU's outputs are the record's, within 1e-9 of each one's largest.

    After a step, deflections are those of the next row; what the host sets is that of the last.
    """
    assert len(found["time"]) == len(record)
    for name in made.outputs:
        wanted = record[name]
        after = wanted[1:] if name.endswith(AT_END) else wanted[:-1]
        scale = float(np.abs(wanted).max())
        np.testing.assert_allclose(found[name][0], wanted[0], rtol=0, atol=1e-9 * scale)
        np.testing.assert_allclose(found[name][1:], after, rtol=0, atol=1e-9 * scale, err_msg=name)
        assert np.ptp(wanted) > 0.0 or "_gradient_" in name, name
