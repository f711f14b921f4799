"""Flights of exported rigs by JSBSim alone."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from coupled.exporting.write import Flown, export, fly_exported, put, script_name
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Configuration, Manoeuvre, PressureProfile
from coupled.flight.pilot import ForceTable, Pilot
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig

COMPENSATED: Configuration = "compensated"


def bench(changes: dict[str, Any] | None = None) -> Rig:
    """Return the shipped bench, plain: one segment, no breakout, no friction, then `changes`."""
    column = "controls.column"
    plain: dict[str, Any] = {
        f"{column}.loader.breakout_N": 0.0,
        f"{column}.schedule.second_gradient_N_per_m": None,
        f"{column}.schedule.break_deflection_m": 0.0,
    }
    return read_rig(shipped_rigs()["bench"]).changed(plain | (changes or {}))


def on_bench(rig: Rig, pilot: Pilot, seconds: float, pressure_Pa: float = 3000.0) -> Manoeuvre:
    """Return a manoeuvre of the column on a bench at a constant dynamic pressure."""
    profile = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[pressure_Pa])
    return Manoeuvre(rig, {"column": pilot}, seconds, bench=profile)


def forces(times_s: list[float], forces_N: list[float]) -> ForceTable:
    """Return a pilot's force, linear between the times."""
    return ForceTable(time_s=times_s, force_N=forces_N)


def both(
    manoeuvre: Manoeuvre, configuration: Configuration = COMPENSATED, rate_Hz: float = 960.0
) -> tuple[Record, Record, str]:
    """Return coupled's flight, that of JSBSim alone, and JSBSim's output."""
    flown = [Flown(manoeuvre, (configuration,))]
    made = export(manoeuvre.rig, flown, rate_Hz=rate_Hz, check=False)
    configured = manoeuvre.configured(configuration)
    ours, name = fly(configured), script_name(manoeuvre, configuration, flown)
    with TemporaryDirectory() as folder:
        put(made.files, Path(folder))
        alone, said = fly_exported(Path(folder), name, configured, ours)
    return ours, alone, said
