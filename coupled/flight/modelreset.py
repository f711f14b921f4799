"""A reset of a loaded JSBSim aircraft to its state before the first trim, as far as possible.

`reset_to_initial_conditions` alone keeps the initial conditions of the last trim, from which the
next one starts: a T-37 is then 2e-9 m higher. So they are set to zero, the models are reset with a
step, and once more without (a B747's fuel flow is known only after the step), and they are set to
zero again, since the step has changed their last digits.

The reset also sets the two angles of attack between which a stall lasts to zero, and no property
sets them: they are set in the memory of JSBSim's aerodynamics (`addresses`).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from coupled.flight.addresses import neighbours
from coupled.flight.modeltext import read_xml

# In this order: airspeed first, so that it does not override the others; the height three times,
# since the first still refers to the aircraft's old position.
_ZEROS = (
    *("vc-kts", "lat-gc-rad", "long-gc-rad", "terrain-elevation-ft"),
    *("h-sl-ft", "h-sl-ft", "h-sl-ft"),
    *("alpha-rad", "beta-rad", "phi-rad", "theta-rad", "psi-true-rad"),
    *("p-rad_sec", "q-rad_sec", "r-rad_sec", "vn-fps", "ve-fps", "vd-fps"),
)
_WITHOUT_RUN = 2  # JSBSim's mode of a reset without a step
# The number of steps, and memory that JSBSim reads before it sets it.
_TELLS_NOTHING = re.compile(r"simulation/frame|gear/unit(\[\d+\])?/side_friction_coeff").fullmatch


def stall_limits(fdm: Any, main: Path) -> Callable[[], None] | None:
    """Return the function that sets a stall's limits, to be called after a reset.

    `main` is the model's file, and `fdm` has not been reset. None if the limits are not found.
    """
    given = read_xml(main).find(".//hysteresis_limits")
    if given is None:
        return lambda: None
    values = [float(given.findtext(each, "nan")) for each in ("max", "min")]
    limits = neighbours(fdm.get_aerodynamics(), values)
    if limits is None:
        return None

    def set_them() -> None:
        limits[:] = values

    return set_them


def put_back(fdm: Any) -> None:
    """Reset an aircraft's models and its initial conditions."""
    _zero_initial_conditions(fdm)
    fdm.reset_to_initial_conditions(0)
    fdm.reset_to_initial_conditions(_WITHOUT_RUN)
    _zero_initial_conditions(fdm)


def _zero_initial_conditions(fdm: Any) -> None:
    for name in _ZEROS:
        fdm[f"ic/{name}"] = 0.0


def is_state_property(name: str) -> bool:
    """Return whether a property is part of the aircraft's state."""
    return not _TELLS_NOTHING(name)
