"""The surface's chain as JSBSim components (`rig/surface`), and its command."""

from __future__ import annotations

from coupled.exporting.controlexport import ControlExport, stepping
from coupled.exporting.expression import Expr, either, prop, within
from coupled.exporting.host import pressure


def add_surface(made: ControlExport) -> None:
    """Add the surface's command about trim, and add it to the aircraft's trim."""
    control, system, own = made.control, made.system, made.own
    rigging = control.rigging
    system.channel(
        "surface", "the command about trim, ±1 the whole travel, and its sum with the trim"
    )
    asked = _share(made)
    if rigging.stretch_loss > 0.0:
        asked = asked / (1.0 + rigging.stretch_loss * pressure(made))
    if rigging.lag > 0.0:
        before = made.kept("surface/lagged")
        gain = made.frame_gain(rigging.lag)
        asked = made.add_at_frame("surface/lagged", before + gain * (asked - before))
    if rigging.rate_limit > 0.0:
        before, step = made.kept("surface/moved"), rigging.rate_limit / made.rig.frame_rate
        asked = made.add_at_frame("surface/moved", within(asked, before - step, before + step))
    if rigging.play > 0.0:
        half = 0.5 * rigging.play
        before = made.kept("surface/position")
        played = within(before, asked - half, asked + half)
        asked = made.add_at_frame("surface/position", played)
    made.add_at_frame(
        "surface-norm", asked + rigging.offset, out="the surface's command about trim, ±1"
    )
    given = either(stepping(), own("trim-norm") + own("surface-norm"), prop(made.command))
    system.add("command-norm", given, output=made.command, out="the command given to JSBSim, ±1")


def _share(made: ControlExport) -> Expr:
    """Return δ̂ over the travel on its side, within ±1, by the sign of the surface's command."""
    control, estimate = made.control, made.own(f"estimate-{made.d}")
    if control.pull == control.push:
        return within((made.sign / control.pull) * estimate, -1.0, 1.0)
    pulled, pushed = within(estimate, 0.0, control.pull), within(estimate, -control.push, 0.0)
    return (made.sign / control.pull) * pulled + (made.sign / control.push) * pushed
