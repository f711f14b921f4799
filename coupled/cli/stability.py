"""The command `stability`: maps and limits of a rig's stability."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import JsonOption, UnitsOption, app
from coupled.cli.progress import progress
from coupled.cli.rigs import DEFAULT_RIG, say_doubts
from coupled.cli.terminal import check_json, err, keep_json, out, print_json, say
from coupled.files import check_target, named
from coupled.outputs import Outputs
from coupled.resources import find, shipped_rigs


@app.command(
    epilog="[dim]Examples: coupled stability 737"
    " · coupled stability my.toml --control wheel -o wheel.png[/]"
)
def stability(
    rig: Annotated[
        str, typer.Argument(help="A rig file, or the name of a shipped rig.")
    ] = DEFAULT_RIG,
    control: Annotated[
        str, typer.Option(help="column, wheel or pedals. (default: each control with a bend)")
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="File of the figure: PNG, PDF or SVG; its CSV is written beside it. (default:"
            " out/RIG-stability.png)",
        ),
    ] = None,
    json_file: JsonOption = "",
    units: UnitsOption = "si",
) -> None:
    """Map where a rig is stable, simulated and by linear theory.

    One map each of K·G_T against K̂/K, the frame time of a digital product, the stiffness of the
    hand, the servo frequency, and the bandwidth and mass of the gauge.
    """
    from coupled.authority.stability.planes import kinds_of
    from coupled.authority.stability.stabilitymap import compliant_controls, map_stability
    from coupled.cli.tables import print_table
    from coupled.plots.saving import check_format, save
    from coupled.plots.stability import draw_stability
    from coupled.record.csvfile import write_table
    from coupled.rig.rigfile import read_rig
    from coupled.tables.stability import limits_table

    file = find(rig, shipped_rigs(), "rig")
    data = read_rig(file)
    bent = compliant_controls(data, control or None, "--control")
    path = output or Path("out") / f"{data.name}-stability.png"
    table = named(path).with_suffix(".csv")
    check_format(path)
    for target in (path, table):
        check_target(target, [file])
    check_json(json_file, [file, path, table])
    note = say_doubts(data)
    count = sum(len(kinds_of(data.controls[name])) for name in bent)
    err.print(f"simulating {count} maps, some thousand motions of a control each", soft_wrap=True)
    with progress() as advance:
        found = map_stability(data, bent, advance)
    listed = found.as_dict()
    with progress("drawing the maps"), Outputs() as outputs:
        save(draw_stability(data, found.by_control), outputs.at(path), note)
        write_table(found.to_polars(), outputs.at(table))
        keep_json(listed, json_file, outputs)
    if json_file != "-":
        print_table(out, limits_table(found.limits, found.bob_weight, units))
        say(found.disagreement.words)
        say(f"written: {path}")
        say(f"written: {table}")
    print_json(listed, json_file)
