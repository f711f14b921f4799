"""The Augmentor Wing aircraft in JSBSim without a rig, shared by its tests."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from types import ModuleType
from typing import Any

from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.rigfile import read_rig

HOME = aircraft_folder() / "awjsra"
RIG = read_rig(shipped_rigs()["awjsra"])
LEVERS = ("fcs/throttle-cmd-norm[0]", "fcs/throttle-cmd-norm[1]")
CLEAN = {"fcs/flap-cmd-norm": 0.0, "fcs/nozzle-cmd-deg": 18.5, "gear/gear-cmd-norm": 0.0}


@cache
def script(name: str) -> ModuleType:
    """Return a script in the folder of the aircraft as a module."""
    spec = importlib.util.spec_from_file_location(name, HOME / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # used by its dataclasses and by the other scripts
    spec.loader.exec_module(module)
    return module


def validation() -> ModuleType:
    """Return the module with the table of published and flown values."""
    return script("validate")


def trimmed(properties: dict[str, float] | None = None, **flight: float) -> Any:
    """Return the aircraft trimmed as in its rig file, with some keys changed."""
    assert RIG.flight is not None
    changes: dict[str, Any] = {f"flight.{key}": value for key, value in flight.items()}
    changes["flight.properties"] = {**RIG.flight.properties, **(properties or {})}
    return validation().trimmed(RIG.changed(changes))


def place(fdm: Any, levers: dict[str, float] | None = None, **state: float) -> Any:
    """Set a trimmed aircraft to another state of flight and lever positions.

    States have JSBSim's names, without `ic/` and with two underscores for a dash.
    """
    fdm.set_trim_status(True)  # slow actuators move to their commands at once
    for name, value in (levers or {}).items():
        fdm[name] = value
    for name, value in state.items():
        fdm["ic/" + name.replace("__", "-")] = value
    for _ in range(4):  # the rate of the angle of attack depends on the result
        fdm.run_ic()
    fdm.set_trim_status(False)
    return fdm


def fly(fdm: Any, seconds: float) -> None:
    for _ in range(round(seconds * 120)):
        fdm.run()
