"""The command line's frame: the app, its exit codes, and the options that commands share.

Exit code 0 when all went well, 1 when a flight ended before its time, 2 for input that
cannot be used (one line says why, and nothing is written).
"""

from __future__ import annotations

import sys
from typing import Annotated

import typer
from typer.exceptions import TyperException

from coupled import __version__
from coupled.cli.terminal import out, say_error
from coupled.errors import InputError

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Fly a JSBSim aircraft through a compliant control loader.",
    epilog="[dim]First steps: coupled compare · coupled runs · coupled fly pull-up-t37[/]",
)

RunArgument = Annotated[
    str, typer.Argument(help="A run file, or the name of a shipped one (coupled runs).")
]
JsonOption = Annotated[
    str, typer.Option("--json", metavar="FILE", help="Write the table as JSON; - prints it.")
]


def main() -> None:
    """Run the command line; every fault of input is one line and exit code 2."""
    try:
        code = app(standalone_mode=False)
    except InputError as error:
        say_error(str(error))
        code = 2
    except TyperException as error:  # a word of the command line that it does not know
        say_error(
            " ".join(error.format_message().split()) + " (coupled --help shows what there is)"
        )
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    except BrokenPipeError:
        sys.stderr.close()
        code = 1
    sys.exit(code if isinstance(code, int) else 0)


def _version(wanted: bool) -> None:
    if wanted:
        out.print(f"coupled {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Fly a JSBSim aircraft through a compliant control loader."""
