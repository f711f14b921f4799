"""Rigs: load one."""

from __future__ import annotations

from os import PathLike, fspath

from coupled.arguments import public
from coupled.resources import find, shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig


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
    >>> worn.controls["column"].loader.play
    0.001
    """
    return read_rig(find(fspath(rig), shipped_rigs(), "rig"))
