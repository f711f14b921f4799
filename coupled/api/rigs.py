"""Rigs: load one, draft one for an aircraft, survey the aircraft that there are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike, fspath
from pathlib import Path

from coupled.arguments import public
from coupled.errors import InputError
from coupled.resources import find, shipped_rigs
from coupled.rig.rig import Rig, of_file
from coupled.rig.rigfile import read_rig, rig_from_table
from coupled.schema import loads_toml
from coupled.surveying.draft import draft
from coupled.surveying.survey import chosen_model, survey
from coupled.surveying.whole import Survey, survey_models


@public
def load_rig(rig: str | PathLike[str]) -> Rig:
    """Return the rig of a file, or a shipped one by its name, checked.

    Raises InputError for a name or file that is not there, and for what a rig cannot be,
    naming file and key.

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
    """Return a rig given as such, as its file, or as the name of a shipped one."""
    return rig if isinstance(rig, Rig) else load_rig(rig)


@public
def models(
    names: Sequence[str] = (),
    workers: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
) -> Survey:
    """Return where JSBSim's models trim or why not, how their controls move, and their rigs.

    `names` are some of the models that are here, or folders of others; all that are here without.
    `workers` are processes, 0 for one a core. Raises InputError for a model that is not there.

    >>> import coupled
    >>> found = coupled.models(["T37"])
    >>> found[0].controls, "t37" in found[0].rigs
    (('column', 'wheel', 'pedals'), True)
    """
    return survey_models(names, workers, progress)


@public
def new_rig(model: str | PathLike[str], name: str = "") -> Rig:
    """Return a first rig for a JSBSim model: where it trims, found; its loader, guessed.

    `model` is one that is here, or the folder of another, or its file. `name` is the rig's, by
    default the model's. The file that `save` writes marks each guess. Raises InputError for a
    model that is not here, does not trim, or has no control that a rig can move.

    >>> import coupled
    >>> rig = coupled.new_rig("T37", "mine")
    >>> rig
    Rig(mine: column, wheel, pedals at 120 Hz; T37)
    >>> "guess" in rig.to_toml()
    True
    """
    word = fspath(model)
    chosen = chosen_model(word)
    found = survey(chosen, speeds=True)
    if found.flight is None:
        raise InputError(word, "", f"does not trim wherever it was tried: {found.why}")
    if not found.controls:
        raise InputError(word, "", f"has no control that a rig could move: {found.lacking[0]}")
    own = str(chosen.home) if chosen.own else ""
    title = name or chosen.file or chosen.model
    text, file = draft(found, title, own), Path(f"{title}.toml")
    return of_file(rig_from_table(loads_toml(text, file), file), (file, text))
