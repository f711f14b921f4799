"""The app of the command line, its exit codes, and the options that commands share.

Exit code 0 is success, 1 a flight that ended early, 2 unusable input or an output that cannot be
written (with one line of reason and no partial output), 130 and 143 an interruption, 141 a closed
pipe of the output.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import sys
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.exceptions import TyperException

from coupled.cli.process import (
    INTERRUPTED,
    PIPE_CLOSED,
    REFUSED,
    Stop,
    error_text,
    prepare_streams,
    prepare_threads,
    prepare_warnings,
    silence_streams,
)
from coupled.cli.terminal import ReaderGoneError, err, out, say_error
from coupled.display import System
from coupled.errors import InputError, shown
from coupled.timing import parts
from coupled.version import __version__

app = typer.Typer(
    add_completion=True,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Fly a JSBSim aircraft through a compliant control loader.",
    epilog="[dim]First steps: coupled runs · coupled compare · coupled diagnose --help[/]",
)

_FAULTS = 3000  # characters of a file's faults that are printed
_GARBAGE = 100_000  # a command is short: garbage is collected less often

RunArgument = Annotated[
    str, typer.Argument(help="A run file, or the name of a shipped run (see coupled runs).")
]
JsonOption = Annotated[
    str,
    typer.Option(
        "--json", metavar="FILE", help="Write the result as JSON to this file; - prints it."
    ),
]


UnitsOption = Annotated[
    System,
    typer.Option(
        "--units",
        help="Units of printed text and figures: si, or us (lb, in, kt, ft, °). Files stay in SI.",
    ),
]

PanelsOption = Annotated[
    str,
    typer.Option(
        "--panels",
        metavar="NAMES",
        help="Panels of the figure, separated by commas: surface, motion, force, loss; of a sweep,"
        " names listed in its keep. (default: all)",
    ),
]
OverlayOption = Annotated[
    bool,
    typer.Option(
        "--overlay", help="Draw all cases (of a sweep, all configurations) in the same axes."
    ),
]
SizeOption = Annotated[
    str,
    typer.Option(
        "--size",
        metavar="WxH",
        help="Printed size of the figure, in cm, mm or in, as 8.5x6cm. (default: by the panels)",
    ),
]

WideOption = Annotated[
    bool,
    typer.Option(
        "--wide", help="Print all columns of each table, even if lines exceed the terminal's width."
    ),
]


def main() -> None:
    """Run the command line; every fault of input is one line and exit code 2."""
    gc.set_threshold(_GARBAGE)
    prepare_streams()
    prepare_threads()
    prepare_warnings()
    with Stop() as stop:
        try:
            code = _run()
        except KeyboardInterrupt:  # a second interruption, during the first
            code = INTERRUPTED
        except Exception:
            if not stop.received:  # a library interrupted while it loads may raise any exception
                raise
            code = INTERRUPTED
    silence_streams()
    sys.exit(stop.exit_code or code)


def _run() -> int:
    """Return the exit code of the command that the user gave."""
    try:
        code = _commands()(standalone_mode=False)
        if sys.stdout is not None:
            sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except (typer.Abort, KeyboardInterrupt):
        return INTERRUPTED
    except (ReaderGoneError, BrokenPipeError, SystemExit):  # the last is the help's, in a pipe
        return PIPE_CLOSED
    except InputError as error:
        line = _lines_of(error)
    except TyperException as error:  # an unknown word of the command line
        words = " ".join(error.format_message().split()).replace("Value error, ", "")
        if not words:  # a group without a command: its help has been printed
            return 0
        line = shown(words, 400) + " (see coupled --help)"
    except (OSError, MemoryError) as error:
        line = error_text(error)
    with contextlib.suppress(OSError):
        for each in line.split("\n"):
            say_error(each)
    return REFUSED


@cache
def _commands() -> Any:
    """Return the commands with their options, collected once in a process."""
    return typer.main.get_command(app)


def check_cluster(workers: int | None, cluster: str) -> tuple[int, str]:
    """Return the number of workers, 0 for one per core, and the address of a cluster or ""."""
    if cluster and workers is not None:
        raise InputError("--workers", "", "a cluster has its own; leave it out")
    return workers or 0, cluster


def _lines_of(error: InputError) -> str:
    """Return the faults of a file, one line each; of a long list the number of the rest."""
    lines = [str(one) for one in error.every]
    kept = lines[:1]
    for line in lines[1:]:
        if len("\n".join([*kept, line])) > _FAULTS:
            return "\n".join([*kept, f"{error.file}: {len(lines) - len(kept)} more faults"])
        kept.append(line)
    return "\n".join(kept)


def _version(wanted: bool) -> None:
    if wanted:
        out.print(f"coupled {__version__}")
        raise typer.Exit


def _say_timing() -> None:
    for part, seconds in parts().items():
        err.print(f"{part:>16}  {seconds:6.3f} s of the processor", highlight=False)


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
    timing: Annotated[bool, typer.Option("--timing", hidden=True)] = False,
) -> None:
    """Fly a JSBSim aircraft through a compliant control loader."""
    if timing:
        atexit.register(_say_timing)
    try:
        Path.cwd()
    except OSError:
        raise InputError("working folder", "", "no longer exists; change to another") from None
