"""The process in which a user's model is loaded, trimmed and flown for some frames (`ownmodel`).

Its exit code is 0 if that succeeds, or fails with an error that the parent will find as well. With
the reason on standard error it is REFUSED if Python cannot read the model, and UNCREATED if the
model reads properties that are never created.
"""

from __future__ import annotations

import faulthandler
import json
import os
import sys
from pathlib import Path

from coupled.errors import InputError
from coupled.flight.aircraft import make_unchecked
from coupled.flight.ownmodel import REFUSED, UNCREATED
from coupled.parallel import limit_memory
from coupled.rig.parameters import Flight

_FRAMES = 5


def main() -> int:
    """Fly the request on the standard input, and return the exit code."""
    faulthandler.disable()
    limit_memory()
    task = json.loads(sys.stdin.buffer.read())
    flight = Flight.model_validate_json(task["flight"])
    try:
        made = make_unchecked(flight, task["frame_s"], task["controls"], [Path(task["home"])])
        for _ in range(_FRAMES):
            made.step((0.0, 0.0, 0.0))
    except InputError as error:
        if error.key != "flight.properties":
            return 0
        print(error.problem, file=sys.stderr, flush=True)
        os._exit(UNCREATED)  # JSBSim aborts when it deletes such a model
    except Exception as error:
        print(f"{type(error).__name__}: {error}".replace("\n", " "), file=sys.stderr)
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main())
