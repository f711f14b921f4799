"""The command that takes in a user's own log: import."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import JsonOption, app
from coupled.cli.terminal import check_json, keep_json, out, print_json, say
from coupled.files import check_target
from coupled.outputs import Outputs
from coupled.resources import shipped_rigs


@app.command(
    "import",
    epilog="[dim]Example: coupled import test7.mat --map map.toml -o out/test7.csv --rig 737[/]",
)
def import_log(
    log: Annotated[Path, typer.Argument(help="A log: CSV, Parquet or MATLAB (up to v7.2).")],
    map_file: Annotated[
        Path, typer.Option("--map", metavar="MAP.toml", help="Its names, units, signs and clock.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Record, CSV or Parquet.  [default: out/LOG.csv]"),
    ] = None,
    rig: Annotated[
        str, typer.Option(help="Hold it against a rig file, or the name of a shipped one.")
    ] = "",
    json_file: JsonOption = "",
) -> None:
    """Make a record of your own log, and tell whether each channel can be true."""
    from coupled.cli.tables.logs import print_account
    from coupled.record.importing.convert import import_log as import_file
    from coupled.record.record import check_suffix, manifest_path, write_record
    from coupled.resources import find

    path = output or Path("out") / f"{log.stem}.csv"
    check_suffix(path)
    rig_file = find(rig, shipped_rigs(), "rig") if rig else None
    inputs = [log, map_file, *([rig_file] if rig_file else [])]
    for target in (path, manifest_path(path)):
        check_target(target, inputs)
    check_json(json_file, [*inputs, path, manifest_path(path)])
    nominal = None
    if rig_file is not None:
        from coupled.rig.rigfile import read_rig

        nominal = read_rig(rig_file)
    record, account = import_file(log, map_file, nominal)
    table = {"record": str(path), **account.as_dict()}
    with Outputs() as outputs:
        write_record(record, outputs.at(path))
        keep_json(table, json_file, outputs)
    if json_file != "-":
        print_account(out, account)
        say(f"record: {path}  ({len(record)} rows, {len(record.channels)} channels)")
        say(f"manifest: {manifest_path(path)}")
    print_json(table, json_file)
