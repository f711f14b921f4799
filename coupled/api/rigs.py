"""Rigs: load one, draft one for an aircraft, survey the available aircraft."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike, fspath
from pathlib import Path

from coupled.arguments import public
from coupled.resources import find, shipped_rigs
from coupled.rig.rig import Rig, of_file
from coupled.rig.rigfile import read_rig, rig_from_table
from coupled.schema import loads_toml
from coupled.surveying.draft import draft
from coupled.surveying.modelsurvey import Survey, survey_models
from coupled.surveying.survey import chosen_model, surveyed
from coupled.surveying.terms import ModelTerms, list_terms


@public
def load_rig(rig: str | PathLike[str]) -> Rig:
    """Return the rig of a file, or a shipped one by its name, checked.

    Raises InputError with file and key for an unknown name, a missing file or an invalid rig.

    >>> import coupled
    >>> rig = coupled.load_rig("t37")
    >>> rig.frame_rate, list(rig.controls)
    (120.0, ['column', 'wheel', 'pedals'])
    >>> worn = rig.changed({"controls.column.loader.play_m": 1e-3})
    >>> worn["controls.column.loader.play_m"]
    0.001
    """
    return read_rig(find(fspath(rig), shipped_rigs(), "rig"))


def rig_given(rig: Rig | str | PathLike[str]) -> Rig:
    """Return a rig from a `Rig`, a file, or the name of a shipped rig."""
    return rig if isinstance(rig, Rig) else load_rig(rig)


@public
def models(
    names: Sequence[str] = (),
    workers: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
) -> Survey:
    """Return where JSBSim models trim or why not, how their controls move, and their rigs.

    `names` are names of models, or folders of others (default: all known models). `workers` is the
    number of processes, 0 for one for each core. Raises InputError for a model that is not found.

    >>> import coupled
    >>> found = coupled.models(["T37"])
    >>> found[0].controls, "t37" in found[0].rigs
    (('column', 'wheel', 'pedals'), True)
    """
    return survey_models(names, workers, progress)


@public
def terms(
    model: str | PathLike[str],
    run: str | PathLike[str] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> ModelTerms:
    """Return the named functions of a JSBSim model's aerodynamics, with axis and share.

    `flight.terms` of a rig scales them by name. The share is the RMS of a function over that of all
    named functions of its axis, in the first case of a `run`; by default in a flight with a doublet
    and a 3-2-1-1 on each surface. `model` is as in `new_rig`. Raises InputError for a model that is
    not found, does not trim or has no named functions, and for a run of another model.

    >>> import coupled
    >>> found = coupled.terms("c172p")
    >>> max((one for one in found if one.axis == "ROLL"), key=lambda one: one.share).term
    'aero/coefficient/ClDa'
    """
    return list_terms(model, run, progress)


@public
def new_rig(model: str | PathLike[str], name: str = "", *, airframe_only: bool = False) -> Rig:
    """Return a first rig for a JSBSim model: its trim is computed, its loader guessed.

    `model` is the name of a known model, or the folder or XML file of another. `name` is the rig's,
    by default the model's. `airframe_only`: it has no control. The file that `save` writes marks
    each guess. Raises InputError for a model that is not found, does not trim, or has no control
    that a rig can move.

    >>> import coupled
    >>> rig = coupled.new_rig("T37", "mine")
    >>> rig
    Rig(mine: column, wheel, pedals at 120 Hz; T37)
    >>> "guess" in rig.to_toml()
    True
    """
    word = fspath(model)
    chosen = chosen_model(word)
    found = surveyed(word, chosen, airframe_only)
    title = name or chosen.file or chosen.model
    text = draft(found, title, str(chosen.home) if chosen.own else "", airframe_only)
    file = Path(f"{title}.toml")
    return of_file(rig_from_table(loads_toml(text, file), file), (file, text))
