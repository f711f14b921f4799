"""The reasons of failed checks: limits of the compensation, and wrong settings of the host.

They are found from the rig file alone. A fault that the file does not state is found by a diagnosis
of a record.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from coupled.calibration.checks import ControlCheck
from coupled.display import Shown, System, in_system
from coupled.record.channels import ControlName, unit_of

if TYPE_CHECKING:
    from coupled.rig.parameters import Control
    from coupled.rig.rig import Rig

_FORCE = ("force", "breakout")
_SURFACE = "surface"
_SAME = 0.02  # relative error of K̂ that is negligible


def reasons(
    rig: Rig, name: ControlName, checks: Sequence[ControlCheck], system: System = "si"
) -> list[str]:
    """Return why checks of a rig's control fail, a sentence each; empty if all pass."""
    failed = [check for check in checks if not check.passed]
    if not failed:
        return []
    control, d = rig.controls[name], unit_of(name)
    sentences = _host_errors(control, in_system(f"{d}/N", system))
    far = any(_is_force(check) and not _within_breakout(control, check) for check in failed)
    unknown = far and not sentences
    if control.loader.bend > 0.0:
        sentences += _bend_effects(control, failed, in_system("N", system))
    if unknown or not sentences:
        of_force = " of the force's error" if sentences else ""
        sentences += [
            f"The rig file does not show the reason{of_force}. docs/calibration.md has a table of"
            " faults by failed check, and coupled diagnose finds them in a record."
        ]
    return sentences


def _is_force(check: ControlCheck) -> bool:
    return check.name.startswith(_FORCE)


def _within_breakout(control: Control, check: ControlCheck) -> bool:
    """Tell whether a loader that rests within its breakout may cause so large an error."""
    return abs(check.measured - check.reference) <= control.loader.breakout


def _host_errors(control: Control, bent: Shown) -> list[str]:
    """Return what the host corrects wrongly or not at all."""
    host, bend, sensing = control.compensation, control.loader.bend, control.sensing
    found = []
    if bend > 0.0 and not host.gradient:
        found.append(
            "The gradient's correction is off, so the bend of the structure softens the feel."
        )
    if bend > 0.0 and not host.deflection:
        found.append("The deflection's correction is off, so the surface lacks the bend K·F.")
    if (host.gradient or host.deflection) and abs(host.bend - bend) > _SAME * max(bend, host.bend):
        found.append(
            f"The host assumes K = {bent.written(host.bend)} {bent.unit}, and the structure has"
            f" {bent.written(bend)}: coupled calibrate finds it."
        )
    scales = {
        "computed_scale": sensing.computed_scale,
        "deflection_scale": sensing.deflection_scale,
        "modifying_scale": sensing.modifying_scale,
        "force_scale": sensing.force_scale,
    }
    off = [f"{name} = {value:.4g}" for name, value in scales.items() if abs(value - 1.0) > _SAME]
    if off:
        found.append(f"Scales are off ({', '.join(off)}): coupled calibrate finds them.")
    return found


def _bend_effects(control: Control, failed: Sequence[ControlCheck], force: Shown) -> list[str]:
    """Return effects of a bent structure that eq. (12) does not correct."""
    found = []
    timed = any(not check.name.startswith((*_FORCE, _SURFACE)) for check in failed)
    if timed and control.compensation.gradient and not control.compensation.force_lead:
        found.append(
            "Release: the grip springs back by the structure's bend K·F at once, and starts from"
            " there at rest, so times from 90 % of the displacement are late. Then it oscillates"
            " faster than specified, since eq. (12) makes the loader's spring stiffer. Mass,"
            " damping and lead scheduled by the gradient correct both: coupled document RIG"
            " --write NEW.toml."
        )
    near = any(_is_force(check) and _within_breakout(control, check) for check in failed)
    if near and control.loader.breakout > 0.0:
        breakout = f"{force.written(control.loader.breakout)} {force.unit}"
        found.append(
            f"Force near neutral: within the breakout of {breakout} the loader"
            " rests while the grip moves by K·F. No correction outside of the loader changes that."
        )
    return found
