"""The command `live`: a flight in real time with a loader, a hand, views and the page."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from coupled.cli.app import JsonOption, app
from coupled.cli.rigs import say_doubts
from coupled.cli.terminal import (
    check_json,
    err,
    keep_json,
    out,
    print_json,
    refuse_needless,
    say,
)
from coupled.errors import InputError
from coupled.files import check_target
from coupled.outputs import Outputs

if TYPE_CHECKING:
    from coupled.flight.manoeuvre import Manoeuvre
    from coupled.live.dashboard.page import Page
    from coupled.live.hands import HandPositions
    from coupled.live.host import Watcher
    from coupled.live.recording import Recording
    from coupled.live.session import LiveFlight

_AXES, _HERE = "1,0,3", "127.0.0.1"
FEW_STALE = 0.01  # share of frames without a new sample that is not mentioned
_EXAMPLES = (
    "[dim]Examples: coupled live --rig report-column --dashboard · coupled live tracking"
    " · coupled live --rig my-rig.toml --loader udp://192.168.1.20:5760[/]"
)


@app.command(epilog=_EXAMPLES)
def live(
    run: Annotated[
        str, typer.Argument(help="A run file, or the name of a shipped run; or give --rig.")
    ] = "",
    rig: Annotated[
        str, typer.Option(help="A rig file, or the name of a shipped rig, to fly without a run.")
    ] = "",
    case: Annotated[
        str, typer.Option(help="Label of the run's case. (default: the first case)")
    ] = "",
    duration: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="Duration of the flight; then the page closes, too. (default: the run's, or 7200"
            " with --rig)",
        ),
    ] = None,
    loader: Annotated[
        str,
        typer.Option(
            metavar="URL",
            help="sim (simulated loader), udp://HOST:PORT (open protocol), or"
            " cls2sim://HOST:PORT?WORD=VALUE&… (Brunner CLS2Sim).",
        ),
    ] = "sim",
    hand: Annotated[
        str,
        typer.Option(
            help="Input that moves a simulated loader: pilot (the run's pilots), page (mouse or"
            " keys) or stick. (default: pilot with a run, page with --rig and --dashboard)"
        ),
    ] = "",
    axes: Annotated[
        str,
        typer.Option(
            metavar="N,N,N",
            help="With --hand stick: numbers of its axes for column, wheel, pedals; a minus"
            " reverses an axis.",
        ),
    ] = _AXES,
    unmeasured: Annotated[
        bool, typer.Option("--unmeasured", help="The loader at udp:// does not measure δ.")
    ] = False,
    adapt: Annotated[
        bool, typer.Option("--adapt", help="Adapt the host's K̂ to the K estimated in flight.")
    ] = False,
    lockstep: Annotated[
        bool,
        typer.Option("--lockstep", help="Fly as fast as the loader answers, not in real time."),
    ] = False,
    dashboard: Annotated[
        bool,
        typer.Option("--dashboard", help="Serve a page for the browser, and print its address."),
    ] = False,
    bind: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="With --dashboard: network address of this computer at which the page is"
            " served; the default is reachable from this computer only.",
        ),
    ] = _HERE,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="With --dashboard: port of the page; 0: any free.")
    ] = 0,
    flightgear: Annotated[
        str,
        typer.Option(metavar="HOST:PORT", help="Send position and attitude to FlightGear, by UDP."),
    ] = "",
    xplane: Annotated[
        str,
        typer.Option(metavar="HOST:PORT", help="Send position and attitude to X-Plane, by UDP."),
    ] = "",
    force_limit: Annotated[
        float, typer.Option(metavar="N", help="Limit of the force sent to a real loader, N.")
    ] = 600.0,
    rate_limit: Annotated[
        float, typer.Option(metavar="N/S", help="Limit of the rate of this force, N/s.")
    ] = 5000.0,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="File of the record: CSV or Parquet. (default: out/RUN.csv, or out/RIG-live.csv)",
        ),
    ] = None,
    json_file: JsonOption = "",
) -> None:
    """Fly in real time with a real or simulated loader; q, Esc or Ctrl-C ends the flight.

    The record has the format of `coupled fly`. It is written to disk each second, so a crash of
    the computer loses at most the last second.
    """
    from coupled.live.attach import open_link, rig_live, run_live
    from coupled.live.host import Plan
    from coupled.live.keys import Keys
    from coupled.live.recording import Recording
    from coupled.live.safety import STRONGEST_N, FASTEST_N_per_s, Limits
    from coupled.live.session import fly_live
    from coupled.record.record import write_record

    if bool(run) == bool(rig):
        raise InputError("coupled live", "", "give a run, or --rig RIG, one of the two")
    who = hand or ("pilot" if run else "page" if dashboard else "")
    if rig and loader == "sim" and who not in ("page", "stick"):
        raise InputError(rig, "--hand", "is missing: give page, with --dashboard, or stick")
    if who == "page" and not dashboard:
        raise InputError("--hand", "page", "needs --dashboard")
    simulated = loader == "sim"
    needless: dict[str, dict[str, object]] = {
        "is for a run": {"--case": rig and case},
        "is for --hand stick": {"--axes": who != "stick" and axes != _AXES},
        "is for --loader udp://": {"--unmeasured": unmeasured and not loader.startswith("udp:")},
        "is for a real loader, by --loader": {
            "--force-limit": simulated and force_limit != STRONGEST_N,
            "--rate-limit": simulated and rate_limit != FASTEST_N_per_s,
        },
        "is for the simulated loader": {"--hand": hand and not simulated},
        "needs --dashboard": {"--bind": bind != _HERE, "--port": port} if not dashboard else {},
    }
    for problem, given in needless.items():
        refuse_needless("coupled live", given, problem)
    flown = run_live(run, case, duration, who) if run else rig_live(rig, duration)
    path = output or Path("out") / f"{flown.name}.csv"
    _check_targets(flown, path, json_file)
    say_doubts(flown.rig)
    limits = Limits(_positive("--force-limit", force_limit), _positive("--rate-limit", rate_limit))
    warn = _Warner()
    with ExitStack() as ending:
        keys = Keys()
        ending.callback(keys.close)
        watchers: list[Watcher] = [keys]
        watchers += _views(flightgear, xplane)
        watchers.append(recording := Recording(path, warn))
        page = _page(flown, bind, port, ending) if dashboard else None
        if page is not None:
            watchers.append(page)
            warn.page = page
        plan = Plan(
            paced=not lockstep,
            link=open_link(loader, flown.rig, lockstep, not unmeasured),
            hand_positions=_open_hand(who, loader, axes, page),
            limits=limits,
            adapt=adapt,
            watchers=watchers,
            warn=warn,
            save=lambda record: write_record(record, _so_far(path)),
        )
        flight = fly_live(flown, plan)
        _write(flight, path, json_file, recording)
        if json_file != "-":
            _print(flight, path)
        print_json(flight.record.manifest["live"], json_file)
        if page is not None:
            _finish(page, flight, path, stays=duration is None)
    if flight.record.ended_early:
        err.print(f"[yellow]ended early:[/] {flight.record.ended_early}; the record is kept")
        raise typer.Exit(1)


class _Warner:
    """Prints a warning on the terminal, and on the page if there is one."""

    def __init__(self) -> None:
        self.page: Page | None = None

    def __call__(self, text: str) -> None:
        err.print(f"[yellow]{escape(text)}[/]", soft_wrap=True)
        if self.page is not None:
            self.page.warn(text)


def _check_targets(flown: Manoeuvre, path: Path, json_file: str) -> None:
    """Raise InputError before the flight if its files cannot be written."""
    from coupled.live.recording import recording_path
    from coupled.record.record import check_suffix, manifest_path

    check_suffix(path)
    inputs, growing = _inputs(flown), recording_path(path)
    targets = list(dict.fromkeys((path, manifest_path(path), growing, manifest_path(growing))))
    for target in targets:
        check_target(target, inputs)
    check_json(json_file, [*inputs, *targets])


def _write(flight: LiveFlight, path: Path, json_file: str, recording: Recording) -> None:
    """Write the complete record in place of the file that grew in flight."""
    from coupled.record.record import write_record

    if len(flight.record) < 2:
        err.print("[yellow]ended before two frames were flown: there is no record[/]")
        raise typer.Exit(1)
    try:
        with Outputs() as outputs:
            write_record(flight.record, outputs.at(path))
            keep_json(flight.record.manifest["live"], json_file, outputs)
    except InputError as error:
        raise recording.instead_of(error) from None
    recording.forget()


def _so_far(path: Path) -> Path:
    """Return the file of the record that grows in flight."""
    return path.with_name(f"{path.stem}-so-far{path.suffix}")


def _page(flown: Manoeuvre, address: str, port: int, ending: ExitStack) -> Page:
    """Open the page, and print its address."""
    from coupled.live.attach import check_installed

    for package in ("starlette", "uvicorn", "websockets"):
        check_installed(package, "--dashboard")
    from coupled.live.dashboard.page import Page

    page = Page([str(name) for name in flown.rig.controls], address, port)
    ending.callback(page.end)
    say(f"page: {page.url}")
    return page


def _open_hand(who: str, loader: str, axes: str, page: Page | None) -> HandPositions | None:
    """Return the source of hand positions for a simulated loader; None for a run's pilots."""
    if loader != "sim" or who == "pilot":
        return None
    if who == "stick":
        from coupled.live.attach import check_installed

        check_installed("pygame", "--hand stick")
        from coupled.live.stick import Stick

        return Stick(axes)
    return page


def _finish(page: Page, flight: LiveFlight, path: Path, stays: bool) -> None:
    """Show record and diagnosis on the page; if it `stays`, until the user closes it."""
    from coupled.live.verdict import diagnosed

    page.finish(phase="diagnosing", record=str(path))
    page.finish(phase="done", diagnosis=diagnosed(flight))
    if not stays:
        return
    say("the page stays open until it is closed there, or by Ctrl-C")
    with suppress(KeyboardInterrupt):
        page.wait()


def _positive(option: str, value: float) -> float:
    if not 0.0 < value <= 1e5:
        raise InputError(option, "", f"is {value:g}; give more than 0, at most 100000")
    return value


def _inputs(flown: Manoeuvre) -> list[Path]:
    from coupled.flight.manifest import input_files

    return input_files(flown)


def _views(in_flightgear: str, in_xplane: str) -> list[Watcher]:
    """Return the requested views, and print the command that starts FlightGear."""
    from coupled.live.flightgear import flightgear, start_line
    from coupled.live.link import split_place
    from coupled.live.xplane import xplane

    views: list[Watcher] = []
    if in_flightgear:
        host, port = split_place(in_flightgear, "--flightgear")
        say(f"start FlightGear by: {start_line(port)}")
        views.append(flightgear(host, port))
    if in_xplane:
        views.append(xplane(*split_place(in_xplane, "--xplane")))
    return views


def missing(live: Mapping[str, Any], frames: int) -> str:
    """Return how many packets and samples of a flight were not used; "" if next to none."""
    dropped, stale = live.get("dropped_packets", {}), live.get("stale_frames", 0)
    counts = [f"{count} packets dropped: {why}" for why, count in dropped.items()]
    if stale > FEW_STALE * frames:
        counts.append(f"{stale} of {frames} frames have no new sample")
    return "; ".join(counts)


def _print(flight: LiveFlight, path: Path) -> None:
    from coupled.record.record import manifest_path

    record = flight.record
    say(f"record: {path}  ({len(record)} rows, {len(record.channels)} channels)")
    say(f"manifest: {manifest_path(path)}")
    if flight.lateness is not None:
        say(str(flight.lateness))
    if flight.round_trips is not None:
        say(str(flight.round_trips))
    live = record.manifest["live"]
    if lost := missing(live, len(record)):
        err.print(f"[yellow]{escape(lost)}[/]", soft_wrap=True)
    for name, found in live["bend_in_service"].items():
        if found["bend"] is not None:
            d = "rad" if name == "wheel" else "m"
            interval = f"{found['low']:.4g} to {found['high']:.4g}"
            out.print(f"K of the {name} in service: {found['bend']:.4g} {d}/N, 95 % {interval}")
