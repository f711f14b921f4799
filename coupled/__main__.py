"""The command `coupled`, and `python -m coupled`: the command line, begun and left quickly."""

from __future__ import annotations

import atexit
import os

INTERRUPTED = 130  # as a shell tells of Ctrl-C


def command() -> None:
    """Run the command line, and leave without taking the interpreter apart.

    That takes a quarter of a short command's time, and seconds after an interruption; what is
    to be done at the end is done, files and streams are closed by then. Nothing is loaded before
    an interruption can be dealt with.
    """
    try:
        from coupled.cli import main

        main()
        code: object = 0
    except KeyboardInterrupt:
        code = INTERRUPTED
    except SystemExit as end:
        code = end.code
    atexit._run_exitfuncs()
    os._exit(code if isinstance(code, int) else 0)


if __name__ == "__main__":
    command()
