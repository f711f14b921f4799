"""Why a control's checks fail: what compensation cannot give back, and what is set otherwise.

What a rig file says of its hardware and its host suffices for these; what it does not say, as a
fault that nobody knows of, a record of the rig shows to a diagnosis.
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
_SAME = 0.02  # of K: a host's K̂ that is nearer is as good as right


def reasons(
    rig: Rig, name: ControlName, checks: Sequence[ControlCheck], system: System = "si"
) -> list[str]:
    """Return why checks of a rig's control fail, a sentence each; none where all pass."""
    failed = [check for check in checks if not check.passed]
    if not failed:
        return []
    control, d = rig.controls[name], unit_of(name)
    sentences = _of_the_host(control, in_system(f"{d}/N", system))
    if control.loader.bend > 0.0:
        sentences += _of_the_bend(control, failed, in_system("N", system))
    if not sentences:
        sentences = [
            "The rig file does not say why; docs/calibration.md has a table of which fault fails"
            " which check, and coupled diagnose finds it in a record."
        ]
    return sentences


def _of_the_host(control: Control, bent: Shown) -> list[str]:
    """Return what the host corrects wrongly or not at all."""
    host, bend, sensing = control.compensation, control.loader.bend, control.sensing
    found = []
    if bend > 0.0 and not host.gradient:
        found.append("The gradient's correction is off, so the bent structure makes the feel soft.")
    if bend > 0.0 and not host.deflection:
        found.append("The deflection's correction is off, so the surface lacks the bend K·F.")
    if (host.gradient or host.deflection) and abs(host.bend - bend) > _SAME * max(bend, host.bend):
        found.append(
            f"The host takes K for {bent.written(host.bend)} {bent.unit}, and the structure has"
            f" {bent.written(bend)}:"
            " coupled calibrate finds it."
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


def _of_the_bend(control: Control, failed: Sequence[ControlCheck], force: Shown) -> list[str]:
    """Return what a bent structure does that eq. (12) does not give back."""
    found = []
    timed = any(not check.name.startswith((*_FORCE, _SURFACE)) for check in failed)
    if timed and control.compensation.gradient and not control.compensation.force_lead:
        found.append(
            "A release: let go, the grip springs back by the structure's bend K·F at once, and"
            " starts from there at rest, so what is counted from 90 % of the displacement comes"
            " late; then it swings faster than specified, since eq. (12) makes the loader's spring"
            " stiffer. Mass, damping and lead that go with the gradient put it right: coupled"
            " document RIG --write NEW.toml."
        )
    pushed = any(check.name.startswith(_FORCE) for check in failed)
    if pushed and control.loader.breakout > 0.0:
        breakout = f"{force.written(control.loader.breakout)} {force.unit}"
        found.append(
            f"Force near neutral: within the breakout of {breakout} the loader"
            " rests while the grip moves by K·F. No correction outside of the loader changes that."
        )
    return found
