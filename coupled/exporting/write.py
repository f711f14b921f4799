"""A rig's export: the files of the folder, and the errors of their flights against our own."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from coupled.errors import InputError
from coupled.exporting.alone import PROGRAM, fly_alone
from coupled.exporting.comparison import FlightErrors, alone_record, compare, properties
from coupled.exporting.conditions import add_conditions
from coupled.exporting.control import control_system
from coupled.exporting.keys import check_keys, is_scripted
from coupled.exporting.load import check_load, set_load
from coupled.exporting.model import Files, model_files, model_name
from coupled.exporting.readme import readme_text
from coupled.exporting.script import Script, lead_pilots
from coupled.exporting.start import add_start, initial_conditions
from coupled.exporting.system import System
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Configuration, Manoeuvre
from coupled.record.record import Record
from coupled.results import Displayed, Tabular, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

RATE_Hz = 960.0  # default of the loader: docs/export.md has the errors
MOST_SUBSTEPS = 64
DEFLECTION, FORCE, LOSS = 0.01, 0.02, 0.005  # tolerances of an exported flight
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Flown:
    """A run to export: a manoeuvre, and the configurations with a script each."""

    manoeuvre: Manoeuvre
    configurations: tuple[Configuration, ...]


@dataclass(frozen=True)
class Export(Displayed, Tabular):
    """The result of an export: its files by path, its loader's steps in a run, its errors.

    `beside` are the flights compared with our own, `left` the parts of the rig left out and why,
    `scripted` those set by the scripts only, `said` JSBSim's messages from loading and flying.
    """

    rig: Rig
    files: Files
    substeps: int
    beside: tuple[FlightErrors, ...] = ()
    left: tuple[str, ...] = ()
    scripted: tuple[str, ...] = ()
    said: str = ""

    def __repr__(self) -> str:
        flights = (
            f"{len(self.beside)} flights {'within' if self.within else 'NOT within'} tolerance"
        )
        return f"Export({self.rig.name}: {len(self.files)} files, {flights})"

    def as_dict(self) -> list[dict[str, object]]:
        """Return the differences of each flight from our own as JSON data."""
        return [one.as_dict() for one in self.beside]

    def to_polars(self) -> pl.DataFrame:
        """Return the differences of each flight from our own, one row per flight."""
        return frame_of(self.as_dict(), [field.name for field in fields(FlightErrors)])

    @property
    def within(self) -> bool:
        """Whether every flight is within the tolerances of an export."""
        return all(
            one.deflection <= DEFLECTION
            and max(one.force, one.modifying_force) <= FORCE
            and abs(one.loss or 0.0) <= LOSS
            for one in self.beside
        )


def step_rate(rig: Rig) -> float:
    """Return JSBSim's step rate of an exported rig, Hz."""
    return rig.frame_rate * (rig.flight.steps_per_frame if rig.flight is not None else 1)


def export(
    rig: Rig,
    runs: Sequence[Flown] = (),
    file: object = "rig",
    rate_Hz: float = RATE_Hz,
    check: bool = True,
    progress: Progress | None = None,
) -> Export:
    """Return a rig as JSBSim systems with its aircraft, and a script for each run.

    `file` names the rig in faults; `rate_Hz` is the least rate of the loader; with `check` every
    script is flown by JSBSim alone and compared with our own flight. Raises InputError with the key
    for parts that cannot be exported.
    """
    rig.check_controlled(file)
    left = check_keys(rig, file)
    scripted = is_scripted(rig)
    substeps = math.ceil(rate_Hz / step_rate(rig) - 1e-9)
    if not 1 <= substeps <= MOST_SUBSTEPS:
        problem = f"asks for {substeps} loader steps in a step of JSBSim at {step_rate(rig):g} Hz"
        raise InputError(file, "--loader-rate-Hz", f"{problem}; 1 to {MOST_SUBSTEPS} can be had")
    systems = {str(name): control_system(rig, name, substeps) for name in rig.controls}
    files = rig_files(rig, systems, file)
    with tempfile.TemporaryDirectory(prefix="coupled-") as temporary:
        put(files, Path(temporary))
        check_load(Path(temporary), rig, file)
    flown: list[tuple[Manoeuvre, Configuration, str, Record]] = []
    jobs = [(run.manoeuvre, each) for run in runs for each in run.configurations]
    for done, (manoeuvre, configuration) in enumerate(jobs):
        if configuration == "calibrated low":
            problem = "calibrated low has another S₁: it is no switch of an exported rig"
            raise InputError(manoeuvre.file, "configurations", problem)
        if progress is not None:
            progress(f"{manoeuvre.label}, {configuration}", done, 2 * len(jobs))
        name = script_name(manoeuvre, configuration, runs)
        configured = manoeuvre.configured(configuration)
        record = fly(configured)
        files |= run_files(rig, configured, configuration, name, files, record)
        flown.append((configured, configuration, name, record))
    files[PurePosixPath("fly.py")] = PROGRAM.encode()
    found, said = list[FlightErrors](), ""
    if check and flown:
        with tempfile.TemporaryDirectory(prefix="coupled-") as temporary:
            put(files, Path(temporary))
            for done, (manoeuvre, configuration, name, record) in enumerate(flown):
                if progress is not None:
                    label = f"{manoeuvre.label}, {configuration}, JSBSim alone"
                    progress(label, len(jobs) + done, 2 * len(jobs))
                alone, now = fly_exported(Path(temporary), name, manoeuvre, record)
                said = said or now
                found.append(compare(manoeuvre, configuration, record, alone))
    made = Export(rig, files, substeps, tuple(found), tuple(left), tuple(scripted), said)
    scripts = [f"scripts/{name}.xml" for _, _, name, _ in flown]
    flights = (made.beside, made.left, made.scripted)
    text = readme_text(rig, systems, substeps, step_rate(rig), scripts, *flights)
    files[PurePosixPath("README.md")] = text.encode()
    return made


def fly_exported(
    folder: Path, name: str, manoeuvre: Manoeuvre, record: Record
) -> tuple[Record, str]:
    """Return the record of an exported script, flown by JSBSim alone, and JSBSim's messages.

    `name` is the script's in the exported `folder`, `record` our own flight of the manoeuvre.
    """
    table, said = fly_alone(folder, f"scripts/{name}.xml", properties(manoeuvre))
    return alone_record(manoeuvre, record, table), said


def rig_files(rig: Rig, systems: dict[str, System], file: object = "rig") -> Files:
    """Return the aircraft with a rig's systems and its loading, by path in the exported folder."""
    names = [f"coupled-{name}" for name in systems]
    files = set_load(model_files(rig.flight, names, file), rig.flight, file)
    folder = PurePosixPath("aircraft", model_name(rig.flight), "Systems")
    for name, system in systems.items():
        head = [
            f"The {name} of the rig {rig.name}: a control loader, as coupled flies it.",
            "Made by `coupled export`; made anew, it is overwritten. Units are SI, in each name.",
        ]
        files[folder / f"coupled-{name}.xml"] = system.text(head).encode()
    return files


def script_name(manoeuvre: Manoeuvre, configuration: str, runs: Sequence[Flown]) -> str:
    """Return the name of a script: run, number of the case if there are several, configuration."""
    cases = [run.manoeuvre for run in runs if run.manoeuvre.name == manoeuvre.name]
    labels = [case.label for case in cases]
    number = f"-{labels.index(manoeuvre.label) + 1}" if len(cases) > 1 else ""
    return f"{manoeuvre.name}{number}-{configuration.replace(' ', '-')}"


def run_files(
    rig: Rig,
    manoeuvre: Manoeuvre,
    configuration: Configuration,
    name: str,
    files: Files,
    record: Record,
) -> Files:
    """Return the script of a manoeuvre in a configuration, and its initial conditions.

    `rig` is the one exported, `record` our own flight, `files` the aircraft's.
    """
    script = Script()
    script.notes += [f"{manoeuvre.label}, {configuration}", "", *manoeuvre.card.strip().split("\n")]
    alpha_rad = add_start(script, manoeuvre, rig.flight, files)
    script.started |= switches(rig, configuration)
    lead_pilots(script, manoeuvre, record)
    add_conditions(script, manoeuvre)
    case = name.removesuffix("-" + configuration.replace(" ", "-"))
    aircraft, start = model_name(rig.flight), f"coupled-{case}"
    text = script.text(name, aircraft, start, 1.0 / step_rate(rig), manoeuvre.duration_s)
    return {
        PurePosixPath("scripts", f"{name}.xml"): text.encode(),
        PurePosixPath("aircraft", aircraft, f"{start}.xml"): initial_conditions(
            manoeuvre, alpha_rad
        ).encode(),
    }


def switches(rig: Rig, configuration: Configuration) -> dict[str, float | str]:
    """Return the properties that select one of a comparison's configurations."""
    on = {
        "bend": configuration != "rigid",
        "deflection-correction": configuration in ("deflection only", "compensated"),
        "gradient-correction": configuration in ("gradient only", "compensated"),
    }
    return {
        f"coupled/{name}/{switch}": float(value)
        for name in rig.controls
        for switch, value in on.items()
    }


def put(files: Files, folder: Path) -> None:
    """Write files to their paths in a folder of an export."""
    for place, text in files.items():
        path = folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text)
