"""The command `import`: converts a user's log to a record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from coupled.cli.app import JsonOption, app
from coupled.cli.feel import keep_feel, print_feel
from coupled.cli.new import check_new
from coupled.cli.terminal import check_json, keep_json, out, print_json, say
from coupled.errors import InputError, shown
from coupled.files import check_target
from coupled.outputs import Outputs
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.calibration.feel import Feel
    from coupled.record.channels import ControlName
    from coupled.record.importing.account import ClockAccount, ImportAccount
    from coupled.record.importing.suggest.propose import Proposal
    from coupled.record.record import Record
    from coupled.rig.rig import Rig

_LISTED = 12  # unmapped columns named on the terminal; the manifest has all


@app.command(
    "import",
    epilog="[dim]Examples:\n\n"
    "coupled import test7.mat --suggest map.toml\n\n"
    "coupled import test7.mat --map map.toml -o out/test7.csv --rig 737\n\n"
    "coupled import command.csv state.csv --map map.toml\n\n"
    "coupled import JSBout.csv[/]",
)
def import_log(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="A log: CSV, JSON, Parquet, MATLAB, HDF5, MDF 4, TDMS, MCAP or ULog; or "
            "several logs of one test, which are interpolated to the rows of the first.",
        ),
    ],
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            metavar="MAP.toml",
            help="Map of the log: names, units, signs and clock. Logs of JSBSim, FlightGear and "
            "X-Plane need none.",
        ),
    ] = None,
    suggest: Annotated[
        Path | None,
        typer.Option(
            metavar="MAP.toml",
            help="Write a first map, from the log's names, units and magnitudes; undecided "
            'entries are "?". Convert nothing.',
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File of the record: CSV or Parquet. (default: out/LOG.csv)"
        ),
    ] = None,
    rig: Annotated[
        str,
        typer.Option(
            help="A rig file, or the name of a shipped rig: gives the frame rate; travels and "
            "gradients are compared with the channels."
        ),
    ] = "",
    feel: Annotated[
        Path | None,
        typer.Option(
            metavar="CURVE.toml",
            help="For a slow sweep of one control, out and back: also write its breakout, friction "
            "and force curve, with a plot beside them.",
        ),
    ] = None,
    json_file: JsonOption = "",
) -> None:
    """Convert your own log to a record, and report whether each channel is plausible."""
    if map_file is not None and suggest is not None:
        problem = "give a map, or --suggest to have one proposed: one of the two"
        raise InputError("coupled import", "--map", problem)
    rig_file = find(rig, shipped_rigs(), "rig") if rig else None
    inputs = [*logs, *([rig_file] if rig_file else [])]
    if suggest is not None:
        if output is not None:
            raise InputError("coupled import", "--output", "goes with --map, not with --suggest")
        if feel is not None:
            raise InputError("coupled import", "--feel", "goes with --map, not with --suggest")
        _suggest(logs, suggest, rig_file, inputs, json_file)
    else:
        _convert(logs, map_file, output, rig_file, inputs, json_file, feel)


def _rig(rig_file: Path | None) -> Rig | None:
    from coupled.rig.rigfile import read_rig

    return None if rig_file is None else read_rig(rig_file)


def _convert(
    logs: list[Path],
    map_file: Path | None,
    output: Path | None,
    rig_file: Path | None,
    inputs: list[Path],
    json_file: str,
    feel: Path | None,
) -> None:
    from coupled.record.importing.convert import import_log as import_file
    from coupled.record.importing.heads import known_map
    from coupled.record.record import check_suffix, manifest_path, write_record

    path = output or Path("out") / f"{logs[0].stem}.csv"
    inputs = [*inputs, *([map_file] if map_file else [])]
    program = known_map(logs[0])[0] if map_file is None else ""
    check_suffix(path)
    written = [path, manifest_path(path)]
    if feel is not None:
        check_new(feel, ".toml")
        written += [feel, feel.with_suffix(".png")]
    for target in written:
        check_target(target, inputs)
    check_json(json_file, [*inputs, *written])
    record, account = import_file(logs, map_file, _rig(rig_file))
    table = {"record": str(path), **account.as_dict()}
    found = None if feel is None else _felt(record, logs[0])
    with Outputs() as outputs:
        write_record(record, outputs.at(path))
        if feel is not None and found is not None:
            keep_feel(found[1], found[0], shown(logs[0].name), feel, outputs)
        keep_json(table, json_file, outputs)
    if json_file != "-":
        if program:
            say(f"map: built in for {program}, recognised by the log's header")
        _print_account(account)
        say(f"record: {path}  ({len(record)} rows, {len(record.channels)} channels)")
        say(f"manifest: {manifest_path(path)}")
        if feel is not None and found is not None:
            print_feel(found[1], found[0], feel)
    print_json(table, json_file)


def _felt(record: Record, log: Path) -> tuple[ControlName, Feel]:
    """Return the control that a log sweeps, and its feel."""
    from coupled.calibration.feel import fit_feel, sweep_of_record, swept_control

    control = swept_control(record, log)
    return control, fit_feel(sweep_of_record(record, control, log))


def _suggest(
    logs: list[Path], target: Path, rig_file: Path | None, inputs: list[Path], json_file: str
) -> None:
    from coupled.record.importing.suggest.propose import propose

    if target.suffix != ".toml":
        raise InputError(target, "--suggest", "is a map: its name ends in .toml")
    check_target(target, inputs)
    check_json(json_file, [*inputs, target])
    proposal = propose(logs, _rig(rig_file))
    table = {"map": str(target), **proposal.as_dict()}
    with Outputs() as outputs:
        outputs.at(target).write_text(proposal.text, encoding="utf-8")
        keep_json(table, json_file, outputs)
    if json_file != "-":
        _print_proposal(proposal)
        say(f"map: {target}")
    print_json(table, json_file)


def _print_account(account: ImportAccount) -> None:
    """Print how the clock was read, a row for each channel, and what was left out."""
    from coupled.cli.tables import print_table
    from coupled.tables.logs import account_table

    out.print(_clock_in_words(account.clock), highlight=False)
    print_table(out, account_table(account))
    for warning in account.warnings:
        out.print(f"[yellow]{escape(warning)}[/]", highlight=False)
    left = account.unmapped
    if left:
        more = f" and {len(left) - _LISTED} more" if len(left) > _LISTED else ""
        out.print(f"not mapped: {escape(', '.join(left[:_LISTED]))}{more}", highlight=False)


def _print_proposal(proposal: Proposal) -> None:
    """Print the column of each channel in a proposed map, and the open questions."""
    from coupled.cli.tables import print_table
    from coupled.tables.logs import proposal_table

    print_table(out, proposal_table(proposal))
    for question in proposal.questions:
        out.print(f"[yellow]to answer:[/] {escape(question)}", highlight=False)
    for warning in proposal.warnings[:_LISTED]:
        out.print(f"[yellow]{escape(warning)}[/]", highlight=False)
    if proposal.unmapped:
        out.print(f"not used: {escape(', '.join(proposal.unmapped[:_LISTED]))}", highlight=False)


def _clock_in_words(clock: ClockAccount) -> str:
    """Return how the rows of the log became frames of the record."""
    rows = f"{clock.rows_used} of {clock.log_rows} rows at {clock.log_rate_Hz:.4g} Hz"
    if clock.method == "pchip":
        steps = f"{1e3 * clock.least_step_s:.3g} to {1e3 * clock.greatest_step_s:.3g} ms"
        how = f"{steps} apart, interpolated (PCHIP)"
    else:
        how = "evenly spaced, not interpolated"
    frames = f"{clock.frames} frames at {clock.frame_rate_Hz:g} Hz"
    return f"clock: {rows}, {how};\n       {frames}"
