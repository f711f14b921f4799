"""The command `bench`: a simulated calibration bench."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, app
from coupled.cli.progress import progress
from coupled.cli.rigs import (
    DEFAULT_RIG,
    ControlOption,
    CrossedOption,
    ErrorOption,
    OnceOption,
    RigOption,
    StrongestOption,
    instruments,
    rig_and_control,
    say_doubts,
)
from coupled.cli.terminal import (
    check_json,
    give_json,
    keep_json,
    out,
    print_json,
    refuse_needless,
    say,
    say_note,
)
from coupled.errors import InputError
from coupled.files import check_target
from coupled.outputs import Outputs

if TYPE_CHECKING:
    from coupled.calibration.bench import CalibrationBench

_GRID = 5  # gradient sets, and readings in each


@app.command(
    epilog="[dim]Examples: coupled bench · coupled bench --rig c172p --control wheel -o out/w.csv"
    " · coupled bench --repeat 1000[/]"
)
def bench(
    rig: RigOption = DEFAULT_RIG,
    control: ControlOption = "column",
    gradients: Annotated[int, typer.Option(help="Number of gradient sets.", min=1, max=30)] = _GRID,
    deflections: Annotated[
        int, typer.Option(help="Number of readings in each gradient set.", min=1, max=60)
    ] = _GRID,
    nulls: Annotated[
        int, typer.Option(help="Number of nulls, the readings for S2.", min=0, max=50)
    ] = 6,
    once: OnceOption = False,
    crossed: CrossedOption = 0.0,
    precision: Annotated[
        float | None,
        typer.Option(
            help="Take the readings of a plan that determines K to ± this many % (95 % interval)."
            " (default: the grid of --gradients and --deflections)",
            min=0.1,
            max=100,
        ),
    ] = None,
    strongest: StrongestOption = 150.0,
    seed: Annotated[int, typer.Option(help="Seed of the random errors.", min=0)] = 0,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File of the readings, CSV. (default: out/RIG-readings.csv)"
        ),
    ] = None,
    inches: Annotated[
        bool,
        typer.Option("--inches", help="Write in (on a wheel °) and lb. (default: m or °, and N)"),
    ] = False,
    perfect: Annotated[bool, typer.Option("--perfect", help="Simulate no errors.")] = False,
    repeat: Annotated[
        int,
        typer.Option(
            help="Simulate and fit this many benches, and print how often the 95 % intervals"
            " contain the true values; 0: write the readings of one bench.",
            min=0,
            max=100_000,
        ),
    ] = 0,
    error: ErrorOption = None,
    json_file: JsonOption = "",
) -> None:
    """Simulate calibration readings of a rig by ruler, spring scale and voltmeter."""
    from coupled.calibration.bench import CalibrationBench, take_readings
    from coupled.calibration.crossforces import crossed_forces
    from coupled.calibration.estimate import perfect_instruments
    from coupled.calibration.plan import fewest, stations
    from coupled.calibration.readingsfile import write_readings

    if repeat:
        written = {"--output": output, "--inches": inches}
        refuse_needless("coupled bench", written, "leave it out with --repeat")
    if precision is not None:
        given = {"--gradients": gradients != _GRID, "--deflections": deflections != _GRID}
        refuse_needless("coupled bench", given, "leave it out with --precision")
    if perfect:
        refuse_needless("coupled bench", {"--error": error}, "leave it out with --perfect")
    file, data, name = rig_and_control(rig, control)
    path = output or Path("out") / f"{data.name}-readings.csv"
    if path.suffix.lower() != ".csv":
        raise InputError(path, "--output", "readings are written as .csv")
    if not repeat:
        check_target(path, [file])
    check_json(json_file, [file, path])
    say_doubts(data)
    tools = instruments(name, error)
    grid = stations(data, name, gradients, deflections, strongest)
    if precision is not None:
        planned = fewest(data, name, tools, precision / 100.0, strongest, 1 if once else 2)
        grid = [station for station, count in planned for _ in range(count)]
    tools = perfect_instruments() if perfect else tools
    others = crossed_forces(data, name, len(grid), crossed)
    made = CalibrationBench(data, name, grid, tools, nulls, not once, others)
    if repeat:
        _repeat(made, repeat, seed, json_file)
        return
    readings = take_readings(made, seed)
    table = {"readings": str(path), "rows": len(readings.row) + len(readings.null_row)}
    with Outputs() as outputs:
        write_readings(outputs.at(path), readings, name, inches)
        keep_json(table, json_file, outputs)
    if json_file != "-":
        say(f"readings: {path}  ({len(readings.row)} readings, {len(readings.null_row)} nulls)")
    if len(readings.null_row) < nulls:
        lost = nulls - len(readings.null_row)
        say_note(
            f"{lost} of {nulls} nulls show 0 V and are left out: the loader has no basic gradient,"
            " or its friction or breakout holds it against the force"
        )
    print_json(table, json_file)


def _repeat(made: CalibrationBench, repeat: int, seed: int, json_file: str) -> None:
    from coupled.calibration.coverage import measure_coverage
    from coupled.cli.tables import print_table
    from coupled.parallel import cores
    from coupled.tables.calibration import coverage_table

    with progress() as advance:
        workers = min(cores(0), 8, -(-repeat // 50))
        coverage = measure_coverage(made, repeat, seed, workers, advance)
    if json_file != "-":
        print_table(out, coverage_table(coverage))
    give_json(coverage.as_dict(), json_file)
