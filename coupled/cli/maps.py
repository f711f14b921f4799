"""The command `map`: authority maps and stick forces."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import UnitsOption, app
from coupled.cli.progress import progress
from coupled.cli.rigs import DEFAULT_RIG, say_doubts
from coupled.cli.terminal import say
from coupled.errors import InputError
from coupled.files import check_targets
from coupled.outputs import Outputs
from coupled.resources import find, shipped_rigs


@app.command(
    name="map", epilog="[dim]Examples: coupled map 737 · coupled map t37 --record out/a.csv[/]"
)
def draw_map(
    rig: Annotated[
        str, typer.Argument(help="A rig file, or the name of a shipped rig.")
    ] = DEFAULT_RIG,
    record: Annotated[
        list[Path] | None,
        typer.Option(
            help="Record whose envelope is drawn; may be repeated. (default: flights of the rig's"
            " shipped runs)"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="File of the figure: PNG, PDF or SVG; CSV tables are written beside it. (default:"
            " out/RIG-map.png)",
        ),
    ] = None,
    units: UnitsOption = "si",
) -> None:
    """Map a rig's lost authority over q̄ and deflection, and stick force per g and per knot."""
    from coupled.authority.authoritymap import map_rig
    from coupled.plots.maps import draw_feel, draw_losses
    from coupled.plots.saving import check_format, save
    from coupled.record.csvfile import write_table
    from coupled.record.record import check_suffix, read_record
    from coupled.rig.rigfile import read_rig

    file = find(rig, shipped_rigs(), "rig")
    data = read_rig(file)
    path = output or Path("out") / f"{data.name}-map.png"
    check_format(path)
    other = path.with_name(f"{path.stem}-feel{path.suffix}")
    written = [path, path.with_suffix(".csv"), other, other.with_suffix(".csv")]
    check_targets(written, [file, *(record or [])])
    for given in record or []:
        check_suffix(given)
    records = [read_record(given) for given in record or []]
    for given, flight in zip(record or [], records, strict=True):
        if "dynamic_pressure_Pa" not in flight:
            raise InputError(given, "dynamic_pressure_Pa", "no such column")
    note = say_doubts(data)
    with progress() as advance:
        found = map_rig(data, records if record else None, advance)
    felt = found.feel
    with progress("drawing the maps"), Outputs() as outputs:
        drawn = draw_losses(data.name, found.losses, found.flown, units)
        save(drawn, outputs.at(written[0]), note)
        write_table(found.to_polars(), outputs.at(written[1]))
        if felt is not None:
            save(draw_feel(data.name, felt, units), outputs.at(written[2]), note)
            write_table(felt.to_polars(), outputs.at(written[3]))
    if felt is None:
        say("no level trim of a column: no stick force per g or per knot")
        written = written[:2]
    for target in written:
        say(f"written: {target}")
