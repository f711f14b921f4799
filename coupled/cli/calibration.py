"""The commands of the bench: bench, calibrate, document."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.channels import CONTROL_NAMES, ControlName
from coupled.cli.app import JsonOption, app
from coupled.errors import InputError, nearest
from coupled.files import check_target, write_text
from coupled.resources import find, shipped_rigs
from coupled.terminal import check_json, give_json, out, progress, say

if TYPE_CHECKING:
    from coupled.calibration.bench import Bench
    from coupled.calibration.calibrate import Result
    from coupled.calibration.estimate import Instruments
    from coupled.rig.parameters import Rig

DEFAULT_RIG = "report-column"
RigOption = Annotated[str, typer.Option(help="A rig file, or the name of a shipped one.")]
ControlOption = Annotated[str, typer.Option(help="column, wheel or pedals.")]
RulerOption = Annotated[
    float | None,
    typer.Option(
        "--ruler",
        help="Error of ruler or protractor, standard deviation in mm or °.  [default: 0.3, 0.2]",
        min=0,
    ),
]
ScaleOption = Annotated[
    float | None, typer.Option("--scale-N", help="Of the spring scale.  [default: 0.3]", min=0)
]
MeterOption = Annotated[
    float | None, typer.Option("--meter-V", help="Of the voltmeter.  [default: 0.01]", min=0)
]
HandOption = Annotated[
    float | None,
    typer.Option(help="Wander of the held force, % of it.  [default: 0.3]", min=0, max=50),
]
StrongestOption = Annotated[
    float, typer.Option("--strongest-N", help="The greatest force to hold, N.", min=1, max=2000)
]


def _rig(name: str, control: str) -> tuple[Path, Rig, ControlName]:
    """Return a rig's file, the rig, and the control that is meant."""
    from coupled.rig.rigfile import read_rig

    file = find(name, shipped_rigs(), "rig")
    rig = read_rig(file)
    for known in CONTROL_NAMES:
        if known == control and known in rig.controls:
            return file, rig, known
    raise InputError(file, "--control", f"no {control!r}; {nearest(control, rig.controls)}")


def _instruments(
    control: str,
    ruler: float | None,
    scale: float | None,
    meter: float | None,
    hand: float | None,
) -> Instruments:
    from coupled.calibration.estimate import usual_instruments
    from coupled.units import DEGREE_rad

    given = {
        "ruler": None if ruler is None else ruler * (DEGREE_rad if control == "wheel" else 1e-3),
        "scale": scale,
        "meter": meter,
        "hand": None if hand is None else hand / 100.0,
    }
    for name, value in given.items():
        if value is not None and not value < 1e6:
            raise InputError(f"--{name}", "", "is no error of an instrument")
    return replace(
        usual_instruments(control), **{k: v for k, v in given.items() if v is not None}
    )


@app.command(
    epilog="[dim]Examples: coupled bench · coupled bench --rig 737 --control wheel -o out/w.csv"
    " · coupled bench --repeat 1000[/]"
)
def bench(
    rig: RigOption = DEFAULT_RIG,
    control: ControlOption = "column",
    gradients: Annotated[int, typer.Option(help="Gradient sets.", min=1, max=30)] = 5,
    deflections: Annotated[int, typer.Option(help="Readings in each.", min=1, max=60)] = 5,
    nulls: Annotated[int, typer.Option(help="Nulls for S2.", min=0, max=50)] = 5,
    strongest: StrongestOption = 150.0,
    seed: Annotated[int, typer.Option(help="Of hand and eyes.", min=0, max=2**62)] = 1,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Readings, CSV.  [default: out/RIG-readings.csv]"),
    ] = None,
    inches: Annotated[bool, typer.Option("--inches", help="In inches and pounds.")] = False,
    perfect: Annotated[bool, typer.Option("--perfect", help="Without any error.")] = False,
    repeat: Annotated[
        int,
        typer.Option(
            help="Fit so many benches and count how often they are right.", min=0, max=100_000
        ),
    ] = 0,
    ruler: RulerOption = None,
    scale: ScaleOption = None,
    meter: MeterOption = None,
    hand: HandOption = None,
    json_file: JsonOption = "",
) -> None:
    """Take readings at a simulated rig, as a person with ruler, scale and voltmeter does."""
    from coupled.calibration.bench import Bench, take_readings
    from coupled.calibration.estimate import perfect_instruments
    from coupled.calibration.plan import stations
    from coupled.calibration.readings import write_readings

    file, data, name = _rig(rig, control)
    path = output or Path("out") / f"{data.name}-readings.csv"
    if path.suffix.lower() != ".csv":
        raise InputError(path, "--output", "readings are written as .csv")
    if not repeat:
        check_target(path, [file])
    check_json(json_file, [file, path])
    tools = _instruments(name, ruler, scale, meter, hand)
    tools = perfect_instruments() if perfect else tools
    grid = stations(data, name, gradients, deflections, strongest)
    made = Bench(data, name, grid, tools, nulls)
    if repeat:
        _repeat(made, repeat, seed, json_file)
        return
    readings = take_readings(made, seed)
    write_readings(path, readings, name, inches)
    if json_file != "-":
        say(f"readings: {path}  ({len(readings.row)} readings, {len(readings.null_row)} nulls)")
    give_json({"readings": str(path), "rows": len(readings.row) + len(readings.null_row)}, json_file)


def _repeat(made: Bench, repeat: int, seed: int, json_file: str) -> None:
    from coupled.calibration.coverage import measure_coverage
    from coupled.tables.calibration import print_coverage

    with progress() as advance:
        workers = min(os.cpu_count() or 1, 8, -(-repeat // 50))
        coverage = measure_coverage(made, repeat, seed, workers, advance)
    if json_file != "-":
        print_coverage(out, coverage)
    give_json(coverage.as_dict(), json_file)


@app.command(
    epilog="[dim]Examples: coupled calibrate out/report-column-readings.csv"
    " · coupled calibrate my.csv --rig my.toml --write new.toml --date 1974-02-04"
    " · coupled calibrate --plan --precision 5[/]"
)
def calibrate(
    readings: Annotated[Path | None, typer.Argument(help="Readings, CSV.")] = None,
    rig: RigOption = DEFAULT_RIG,
    control: ControlOption = "column",
    write: Annotated[
        Path | None,
        typer.Option(metavar="NEW", help="Write the calibrated rig, .toml; a plan's form, .csv."),
    ] = None,
    hardware: Annotated[
        bool,
        typer.Option("--hardware", help="Take what is found for the rig's own hardware, too."),
    ] = False,
    date: Annotated[str, typer.Option(help="Noted in the rig file as given.")] = "",
    plan: Annotated[bool, typer.Option("--plan", help="Choose readings to take.")] = False,
    precision: Annotated[
        float, typer.Option(help="Wanted of K by a plan, ± % (95 %).", min=0.1, max=100)
    ] = 5.0,
    strongest: StrongestOption = 150.0,
    figure: Annotated[
        Path | None, typer.Option(help="Draw readings and fit (figure 4): PNG, PDF or SVG.")
    ] = None,
    ruler: RulerOption = None,
    scale: ScaleOption = None,
    meter: MeterOption = None,
    hand: HandOption = None,
    json_file: JsonOption = "",
) -> None:
    """Find S1, S2, S3 and K from readings, with their errors; or plan the readings."""
    file, data, name = _rig(rig, control)
    tools = _instruments(name, ruler, scale, meter, hand)
    if plan:
        if readings is not None or figure is not None:
            raise InputError("--plan", "", "plans readings to come; give no readings and no figure")
        _plan(data, name, tools, (precision / 100.0, strongest), (write, json_file))
        return
    if readings is None:
        raise InputError("calibrate", "", "give a file of readings, or --plan for which to take")
    inputs = [readings, file]
    for target, suffix in ((write, ".toml"), (figure, "")):
        if target is not None:
            if suffix and target.suffix.lower() != suffix:
                raise InputError(target, "--write", "a rig file ends in .toml")
            check_target(target, inputs)
    if figure is not None:
        from coupled.plots.saving import check_format

        check_format(figure)
    check_json(json_file, [*inputs, *(path for path in (write, figure) if path)])
    _calibrate(readings, (file, data, name), tools, (write, figure, json_file), (date, hardware))


def _calibrate(
    path: Path,
    rig: tuple[Path, Rig, ControlName],
    tools: Instruments,
    targets: tuple[Path | None, Path | None, str],
    noted: tuple[str, bool],
) -> None:
    from coupled.calibration.belief import with_calibration
    from coupled.calibration.calibrate import calibrate as fit
    from coupled.calibration.readings import read_readings
    from coupled.rig.rigfile import rig_from_table
    from coupled.rig.rigwrite import rig_text
    from coupled.schema import loads_toml
    from coupled.tables.calibration import print_calibration

    (file, data, name), (write, figure, json_file), (date, hardware) = rig, targets, noted
    found = fit(read_readings(path, name), data.controls[name], name, tools, path)
    text = ""
    if write is not None:
        new = with_calibration(data, name, found, date, hardware)
        text = rig_text(new, f"{file.name}, its {name} calibrated from {path.name}")
        rig_from_table(loads_toml(text, write), write)  # a rig that cannot be flown is refused
    if json_file != "-":
        print_calibration(out, found)
    if write is not None:
        write_text(write, text)
        if json_file != "-":
            say(f"calibrated rig: {write}")
    if figure is not None:
        from coupled.plots.documentation import draw_readings
        from coupled.plots.saving import save

        save(draw_readings(found, path.name), figure)
        if json_file != "-":
            say(f"figure: {figure}")
    give_json(found.as_dict(), json_file)


def _plan(
    rig: Rig,
    control: ControlName,
    tools: Instruments,
    wanted: tuple[float, float],
    targets: tuple[Path | None, str],
) -> None:
    from coupled.calibration.plan import fewest, form, precision, stations
    from coupled.tables.calibration import print_plan

    (share, strongest), (write, json_file) = wanted, targets
    if write is not None:
        if write.suffix.lower() != ".csv":
            raise InputError(write, "--write", "a form for readings ends in .csv")
        check_target(write)
    check_json(json_file, [write] if write else [])
    sizes = [(few, many) for few in range(2, 7) for many in range(2, 7)]
    grids = {
        size: precision(rig, control, stations(rig, control, *size, strongest), tools)
        for size in sizes
    }
    chosen = fewest(rig, control, tools, share, strongest)
    reached = precision(rig, control, [s for s, count in chosen for _ in range(count)], tools)
    if json_file != "-":
        print_plan(out, control, grids, chosen, reached)
    if write is not None:
        write_text(write, form(chosen, control))
        if json_file != "-":
            say(f"form: {write}")
    table = {
        "half_width": reached.half_width,
        "bend": reached.bend,
        "readings": [{**s.__dict__, "count": count} for s, count in chosen],
        "grids": [
            {"gradients": few, "deflections": many, "half_width": grid.half_width}
            for (few, many), grid in grids.items()
        ],
    }
    give_json(table, json_file)


@app.command(
    epilog="[dim]Examples: coupled document · coupled document 737 --control column"
    " · coupled document new.toml --readings my.csv --output doc[/]"
)
def document(
    rig: Annotated[str, typer.Argument(help="A rig file, or a shipped one.")] = DEFAULT_RIG,
    control: Annotated[str, typer.Option(help="One control only.  [default: all]")] = "",
    readings: Annotated[
        Path | None, typer.Option(help="Readings to draw.  [default: a virtual bench's]")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder.  [default: out/RIG-document]"),
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Print every check.")] = False,
    json_file: JsonOption = "",
) -> None:
    """Document a rig's forces: X-Y plots, figure 4, and 14 CFR Part 60 control checks."""
    from coupled.calibration.belief import stale
    from coupled.calibration.documentation import controls_of, surface_travels
    from coupled.calibration.documentation import document as gather
    from coupled.rig.rigfile import read_rig
    from coupled.tables.calibration import print_checks

    file = find(rig, shipped_rigs(), "rig")
    data = read_rig(file)
    chosen = [_rig(rig, control)[2]] if control else controls_of(data)
    folder = output or Path("out") / f"{data.name}-document"
    pdf = folder / f"{data.name}.pdf"
    inputs = [file, *([readings] if readings else [])]
    if folder.is_file():
        raise InputError(folder, "--output", "is a file; give a folder")
    check_target(pdf, inputs)
    check_json(json_file, [*inputs, pdf])
    fits = {name: _fit_for(readings, data, name, chosen) for name in chosen}
    travels = surface_travels(data, file)
    documents = []
    with progress() as advance:
        for name in chosen:
            documents.append(gather(data, name, travels.get(name), advance))
    from coupled.plots.documentation import draw_pages

    written = draw_pages(documents, fits, folder, pdf)
    if json_file != "-":
        for found in documents:
            print_checks(out, found.control, found.checks, every)
        if not travels:
            out.print("no aircraft: the surface's position is not judged\n")
        for name in chosen:
            for change in stale(data.controls[name]):
                say(f"stale calibration of the {name}: {change}")
        say(f"{len(written)} figures and {pdf.name} in {folder}")
    table = {found.control: [check.as_dict() for check in found.checks] for found in documents}
    give_json(table, json_file)


def _fit_for(
    readings: Path | None, rig: Rig, control: ControlName, chosen: list[ControlName]
) -> tuple[Result, str] | None:
    """Return the fit to draw of a control, and where its readings are from; none for one gradient.

    A user's readings are those of the first control chosen.
    """
    from coupled.calibration.bench import Bench, take_readings
    from coupled.calibration.calibrate import calibrate as fit
    from coupled.calibration.plan import stations
    from coupled.calibration.readings import read_readings

    data, tools = rig.controls[control], _instruments(control, None, None, None, None)
    if readings is not None:
        if control != chosen[0]:
            return None
        return fit(read_readings(readings, control), data, control, tools, readings), readings.name
    try:
        grid = stations(rig, control, 5, 5)
    except InputError:
        return None
    made = take_readings(Bench(rig, control, grid, tools), 1)
    return fit(made, data, control, tools, rig.name), "a virtual bench's readings"
