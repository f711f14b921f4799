"""The command of a rig's stability: stability."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import JsonOption, UnitsOption, app
from coupled.cli.progress import progress
from coupled.cli.rigs import DEFAULT_RIG, say_doubts
from coupled.cli.terminal import check_json, err, keep_json, out, print_json, say
from coupled.errors import InputError, nearest
from coupled.files import check_target
from coupled.outputs import Outputs
from coupled.record.channels import unit_of
from coupled.resources import find, shipped_rigs


@app.command(
    epilog="[dim]Examples: coupled stability 737"
    " · coupled stability my.toml --control wheel -o wheel.png[/]"
)
def stability(
    rig: Annotated[str, typer.Argument(help="A rig file, or a shipped one.")] = DEFAULT_RIG,
    control: Annotated[
        str, typer.Option(help="column, wheel or pedals. (default: all that bend)")
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Figure, PNG, PDF or SVG. (default: out/RIG-stability.png)"
        ),
    ] = None,
    json_file: JsonOption = "",
    units: UnitsOption = "si",
) -> None:
    """Map where a rig is stable, simulated and by linear theory, over K·G_T.

    Against the host's K̂, the frame of a digital product, the hand, the servo and the gauge.
    """
    from coupled.authority.stability.aircraft import bob_weight
    from coupled.authority.stability.limits import disagreement, stability_limits
    from coupled.authority.stability.planes import kinds_of, plane
    from coupled.cli.tables.stability import print_limits, write_planes
    from coupled.plots.saving import check_format, save
    from coupled.plots.stability import draw_stability
    from coupled.rig.rigfile import read_rig

    file = find(rig, shipped_rigs(), "rig")
    data = read_rig(file)
    names = [name for name in data.controls if control in ("", name)]
    if not names:
        raise InputError(file, "--control", f"no {control!r}; {nearest(control, data.controls)}")
    bent = [name for name in names if data.controls[name].loader.bend > 0.0]
    if not bent:
        d = unit_of(names[0])
        key = f"controls.{names[0]}.loader.bend_{d}_per_N"
        raise InputError(file, key, "is 0 and nothing bends; a map over K·G_T needs a K above 0")
    path = output or Path("out") / f"{data.name}-stability.png"
    table = path.with_suffix(".csv")
    check_format(path)
    for target in (path, table):
        check_target(target, [file])
    check_json(json_file, [file, path, table])
    note = say_doubts(data)
    asked = [(name, kind) for name in bent for kind in kinds_of(data.controls[name])]
    every = []
    err.print(
        f"simulating {len(asked)} maps, some thousand motions of a control each", soft_wrap=True
    )
    with progress() as advance:
        limits = [stability_limits(data, name) for name in bent]
        bob = bob_weight(data, file) if "column" in bent else None
        for done, (name, kind) in enumerate(asked):
            advance(f"{name}, {kind}", done, len(asked))
            every.append(plane(data, name, kind))
    planes = {name: [each for each in every if each.control == name] for name in bent}
    apart = disagreement(every)
    listed = {
        "rig": data.name,
        "controls": [each.as_dict() for each in limits],
        "greatest_difference_percent": None if apart.worst is None else 100.0 * apart.worst,
        "limits_without_theory": apart.alone,
    }
    with progress("drawing the maps"), Outputs() as outputs:
        save(draw_stability(data, planes), outputs.at(path), note)
        write_planes(data, every, outputs.at(table))
        keep_json(listed, json_file, outputs)
    if json_file != "-":
        print_limits(out, limits, bob, units)
        say(apart.words)
        say(f"written: {path}")
        say(f"written: {table}")
    print_json(listed, json_file)
