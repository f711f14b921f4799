"""A rig's aircraft in its conditions: the plain airframe with its wrappers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from coupled.flight.airframe import JSBSimAirframe, main_file
from coupled.flight.altered import Alterations
from coupled.flight.gusts import Gusts
from coupled.flight.loading import Loading
from coupled.flight.ownmodel import check_own_model
from coupled.flight.wrapper import Aircraft, Wrapper
from coupled.record.channels import ControlName
from coupled.rig.parameters import Flight


def make_aircraft(
    flight: Flight,
    frame_s: float,
    controls: Sequence[str] = ("column",),
    models: Sequence[Path] = (),
    file: object = "rig",
    *,
    record: Sequence[str] = (),
    run_file: object = "run",
    conditions: Sequence[Wrapper] = (),
    gusts: Gusts | None = None,
) -> JSBSimAirframe:
    """Return a rig's aircraft, trimmed, by its `flight` section and a run's conditions.

    `controls` are those of the rig in its order; `models`, folders of our own models, searched
    first; `file` and `run_file`, the files of rig and run, for faults; `record`, further properties
    to read each frame; `gusts`, in place of those that the rig draws from seed 0. Raises
    InputError.

    Before each frame the conditions act in their order, then the gusts, then the factors, which
    follow a moved trim. A model of the user's own is first loaded in a process of its own.
    """
    main_file(flight, models, file)  # refuses what is not there
    check_own_model(flight, frame_s, controls, models, file)
    return make_unchecked(
        *(flight, frame_s, controls, models, file),
        record=record,
        run_file=run_file,
        conditions=conditions,
        gusts=gusts,
    )


def make_unchecked(
    flight: Flight,
    frame_s: float,
    controls: Sequence[str] = ("column",),
    models: Sequence[Path] = (),
    file: object = "rig",
    *,
    record: Sequence[str] = (),
    run_file: object = "run",
    conditions: Sequence[Wrapper] = (),
    gusts: Gusts | None = None,
) -> JSBSimAirframe:
    """Return an aircraft as `make_aircraft` does, of a model that does not crash the process."""

    def plain_aircraft(control: ControlName, names: Sequence[str]) -> Aircraft:
        return JSBSimAirframe(flight, frame_s, (control,), models, file, names)

    wrappers = (
        *conditions,
        gusts or Gusts(flight, frame_s),
        Alterations(flight, plain_aircraft),
        Loading(flight),
    )
    return JSBSimAirframe(flight, frame_s, controls, models, file, record, run_file, wrappers)
