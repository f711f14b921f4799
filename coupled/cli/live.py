"""The command that flies live: the host of a loader, a hand, views and the page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, app
from coupled.cli.rigs import say_stale
from coupled.cli.terminal import check_json, err, keep_json, out, print_json, say
from coupled.errors import InputError
from coupled.files import check_target
from coupled.outputs import Outputs

if TYPE_CHECKING:
    from coupled.flight.manoeuvre import Manoeuvre
    from coupled.live.host import Watcher
    from coupled.live.session import LiveFlight

_EXAMPLES = (
    "[dim]Examples: coupled live --rig report-column --dashboard · coupled live tracking"
    " · coupled live --rig my-rig.toml --loader udp://192.168.1.20:5760[/]"
)


@app.command(epilog=_EXAMPLES)
def live(
    run: Annotated[str, typer.Argument(help="A run to fly; or give --rig.")] = "",
    rig: Annotated[str, typer.Option(help="A rig to fly without a run, until it is stopped.")] = "",
    case: Annotated[str, typer.Option(help="Case of the run, by its label; else the first.")] = "",
    duration: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="How long; else as the run, or 7200.")
    ] = None,
    loader: Annotated[
        str, typer.Option(metavar="URL", help="sim, udp://HOST:PORT or cls2sim://HOST:PORT.")
    ] = "sim",
    hand: Annotated[
        str,
        typer.Option(help="Who moves a simulated loader: pilot (the run's), page or stick."),
    ] = "",
    unmeasured: Annotated[
        bool, typer.Option("--unmeasured", help="The loader at udp:// does not measure δ.")
    ] = False,
    adapt: Annotated[
        bool, typer.Option("--adapt", help="Give K as found in service to the compensation.")
    ] = False,
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="As fast as the loader answers, not in real time.")
    ] = False,
    flightgear: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Send the view to FlightGear.")
    ] = "",
    force_limit: Annotated[
        float, typer.Option(metavar="N", help="The most that a real loader is asked for.")
    ] = 600.0,
    rate_limit: Annotated[
        float, typer.Option(metavar="N/S", help="How fast that may change.")
    ] = 5000.0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Record, CSV or Parquet.  [default: out/NAME.csv]"),
    ] = None,
    json_file: JsonOption = "",
) -> None:
    """Fly in real time, with a loader, a hand and views attached; q or Ctrl-C ends it.

    The record has the format of `coupled fly`, whole up to the frame at which it ended.
    """
    from coupled.live.attach import open_link, rig_live, run_live
    from coupled.live.host import Plan
    from coupled.live.keys import Keys
    from coupled.live.safety import Limits
    from coupled.live.session import fly_live
    from coupled.record.record import check_suffix, manifest_path, write_record

    if bool(run) == bool(rig):
        raise InputError("coupled live", "", "give a run, or --rig RIG, one of the two")
    who = hand or ("pilot" if run else "page")
    flown = run_live(run, case, duration, who) if run else rig_live(rig, duration, who)
    path = output or Path("out") / f"{flown.name}.csv"
    check_suffix(path)
    inputs = _inputs(flown)
    for target in (path, manifest_path(path)):
        check_target(target, inputs)
    check_json(json_file, [*inputs, path, manifest_path(path)])
    say_stale(flown.rig)
    limits = Limits(_positive("--force-limit", force_limit), _positive("--rate-limit", rate_limit))
    watchers: list[Watcher] = []
    if flightgear:
        watchers.append(_flightgear(flightgear))
    link = open_link(loader, flown.rig, lockstep, not unmeasured)
    keys = Keys()
    plan = Plan(
        paced=not lockstep,
        link=link,
        limits=limits,
        adapt=adapt,
        watchers=[*watchers, keys],
        warn=lambda text: err.print(f"[yellow]{text}[/]"),
    )
    try:
        flight = fly_live(flown, plan)
    finally:
        keys.close()
    with Outputs() as outputs:
        write_record(flight.record, outputs.at(path))
        keep_json(flight.record.manifest["live"], json_file, outputs)
    if json_file != "-":
        _print(flight, path)
    print_json(flight.record.manifest["live"], json_file)
    if flight.record.ended_early:
        err.print(f"[yellow]ended early:[/] {flight.record.ended_early}; the record is kept")
        raise typer.Exit(1)


def _positive(option: str, value: float) -> float:
    if not 0.0 < value <= 1e5:
        raise InputError(option, "", f"is {value:g}; give more than 0, at most 100000")
    return value


def _inputs(flown: Manoeuvre) -> list[Path]:
    from coupled.flight.manifest import input_files

    return input_files(flown)


def _flightgear(address: str) -> Watcher:
    """Return the view, and print the line that starts FlightGear."""
    from coupled.live.flightgear import FlightGear, start_line
    from coupled.live.link import split_address

    _, host, port = split_address(f"--flightgear://{address}")
    say(f"start FlightGear by: {start_line(port)}")
    return FlightGear(host, port)


def _print(flight: LiveFlight, path: Path) -> None:
    from coupled.record.record import manifest_path

    record = flight.record
    say(f"record: {path}  ({len(record)} rows, {len(record.channels)} channels)")
    say(f"manifest: {manifest_path(path)}")
    if flight.lateness is not None:
        say(str(flight.lateness))
    for name, found in record.manifest["live"]["bend_in_service"].items():
        if found["bend"] is not None:
            d = "rad" if name == "wheel" else "m"
            interval = f"{found['low']:.4g} to {found['high']:.4g}"
            out.print(f"K of the {name} in service: {found['bend']:.4g} {d}/N, 95 % {interval}")
