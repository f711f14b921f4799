"""The option `--report`: a command's result as one HTML file."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.terminal import say
from coupled.errors import InputError, printable
from coupled.files import check_target, write_text
from coupled.outputs import Outputs

if TYPE_CHECKING:
    from coupled.reports.page import Provenance, Report

ReportOption = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="FILE.html",
        help="Write verdict, tables, figures and settings as one self-contained HTML file.",
    ),
]


def check_report(path: Path | None, others: Iterable[Path], made: Path | None = None) -> list[Path]:
    """Raise InputError if a report cannot be written or is another file; return its path or None.

    `made` is a folder that the command makes.
    """
    if path is None:
        return []
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(path, "--report", "is one HTML file: its name ends in .html")
    check_target(path, others, "is another file of this command; give another name", made)
    return [path]


def write_report(
    path: Path,
    outputs: Outputs,
    inputs: Iterable[Path],
    report: Callable[[Provenance], Report],
    note: str = "",
) -> None:
    """Write a command's report with its other files; `inputs` are the files that it read.

    The `note` is a sentence below its verdict.
    """
    from coupled.reports.page import render
    from coupled.reports.provenance import provenance_of

    command = shlex.join(["coupled", *map(printable, sys.argv[1:])])
    made = report(provenance_of(command, inputs))
    if note:
        verdict = replace(made.verdict, remarks=(*made.verdict.remarks, note))
        made = replace(made, verdict=verdict)
    write_text(outputs.at(path), render(made))


def say_report(path: Path | None) -> None:
    """Print the path of the report, if requested."""
    if path is not None:
        say(f"report: {path}")
