"""A specified curve as JSBSim components: its nodes on δc once a frame, and F_mod of δc.

The table of force over q̄ and deflection has a column for each deflection. With f_k at q̄, segment k
begins at δc_k = δ_k − K̂·(F_BO + f_k) and has the slope of eq. (12), so that

    F_mod = Σ_k ΔG_k·(min(max(|δc|, a_k), a_{k+1}) − a_k),    a_k = max(δc_k, 0)

in the direction of δc; segments within the bend by the breakout have no width (`rig/modification`).

One two-dimensional JSBSim table of F_mod over q̄ and δc cannot replace this. The specified force is
linear in q̄ at a deflection δ, but a table is linear in q̄ at δc, and with compensation the δc that
belongs to δ moves with q̄: δc = δ − K̂·(F_BO + f). Between two rows of q̄ such a table is up to 3 %
off the compensated force of a column with five segments.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from coupled.exporting.controlexport import ControlExport
from coupled.exporting.expression import Expr, either, greater, less, looked_up, most, size, within
from coupled.rig.equations import felt_gradient, total_to_computed
from coupled.rig.parameters import Schedule

# Of a side: |δ| in d, and the forces over q̄ as sizes, N, from neutral outward.
_Nodes = list[tuple[float, list[float]]]


def sloped(schedule: Schedule, table: list[float]) -> list[float]:
    """Return a table over the schedule's q̄ with the factor on its rise above q̄ = 0."""
    rest = table[0]
    if schedule.dynamic_pressure[0] < 0.0:
        rest = float(np.interp(0.0, schedule.dynamic_pressure, table))
    return [rest + schedule.slope * (value - rest) for value in table]


def add_curve(made: ControlExport, scale: float, sent: Callable[[Expr], Expr]) -> None:
    """Add the curve's nodes at the schedule's q̄, F_extra, and G_T of the segment.

    `scale` is the factor on ΔG; `sent` is a gradient after the host's converter.
    """
    control, add, host = made.control, made.system.add, made.control.compensation
    schedule, sensing, at = control.schedule, control.sensing, made.own("schedule/pressure-Pa")
    bend: Any = add("host/assumed-bend", made.own("gradient-correction") * host.bend)
    preload = control.assumed_breakout if host.breakout_term == "exact" else 0.0
    multiplied = sensing.computed_scale if control.loader.multiplier == "hybrid" else 1.0
    neutral: dict[str, Any] = {}
    for side, nodes in _sides(schedule).items():
        force: Any = 0.0
        begun: Any = add(f"host/{side}-0/computed", -1.0 * bend * preload)
        at_neutral: Any = preload
        for k, ((near, _), (far, forces)) in enumerate(pairwise(nodes), 1):
            place, last = f"host/{side}-{k}", k + 1 == len(nodes)
            reached = add(f"{place}/force-N", looked_up(at, schedule.dynamic_pressure, forces))
            gradient: Any = (reached - force) / (far - near)
            total = add(f"{place}/total", total_to_computed(gradient, bend))
            ended = add(f"{place}/computed", far - bend * (preload + reached))
            passed = most(begun, 0.0) if last else within(0.0, begun, ended)
            at_neutral = at_neutral + total * (passed - begun)
            made.add_at_frame(
                f"{place}/slope", sent(scale * (total - control.assumed_basic_gradient))
            )
            made.add_at_frame(f"{place}/from", most(begun, 0.0) / multiplied)
            force, begun = reached, ended
        neutral[side] = at_neutral
    if preload > 0.0:
        up, down = neutral["pull"], neutral.get("push", neutral["pull"])
        made_force = 1.0 / sensing.modifying_scale
        more = made_force * (0.5 * (up + down) - preload)
        made.add_at_frame("host/extra", more, "F_extra, which appendix C leaves out")
        made.add_at_frame("host/extra-offset", made_force * 0.5 * (up - down))
    read = sensing.read_scale * made.own(f"loader-{made.d}")
    on_computed: Any = curve_slope(made, read / multiplied) / scale + control.assumed_basic_gradient
    says = f"G_T, the gradient of the curve at δc, N/{made.d}"
    felt: Any = felt_gradient(on_computed, bend)
    made.add_at_frame(f"gradient-N_per_{made.d}", felt, out=says)


def curve_force(made: ControlExport, at: Expr) -> Expr:
    """Return F_mod at δc = `at`, N, without F_extra."""
    pull = _along(made, "pull", at)
    if "push" in _sides(made.control.schedule):
        force = pull - _along(made, "push", -1.0 * at)
    else:
        force = pull - _along(made, "pull", -1.0 * at)
    if made.control.assumed_breakout > 0.0:
        exact = made.control.compensation.breakout_term == "exact"
        force = force + made.own("host/extra-offset") if exact else force
    return force


def curve_slope(made: ControlExport, at: Expr) -> Expr:
    """Return dF_mod/dδc at δc = `at`, N/d."""
    slopes = []
    for side, nodes in _sides(made.control.schedule).items():
        slope = made.own(f"host/{side}-1/slope")
        for k in range(2, len(nodes)):
            inside = less(size(at), made.own(f"host/{side}-{k}/from"))
            slope = either(inside, slope, made.own(f"host/{side}-{k}/slope"))
        slopes.append(slope)
    return either(greater(0.0, at), slopes[-1], slopes[0])


def _along(made: ControlExport, side: str, way: Expr) -> Expr:
    """Return the size of F_mod at δc = `way` outward on a side, 0 on the other."""
    segments = len(_sides(made.control.schedule)[side]) - 1
    force: Any = 0.0
    for k in range(1, segments + 1):
        begun = made.own(f"host/{side}-{k}/from")
        inside = most(way, begun)
        if k < segments:
            inside = within(way, begun, made.own(f"host/{side}-{k + 1}/from"))
        force = force + made.own(f"host/{side}-{k}/slope") * (inside - begun)
    found: Expr = force
    return found


def _sides(schedule: Schedule) -> dict[str, _Nodes]:
    """Return the nodes from neutral outward; of an odd curve for a pull only."""
    deflections, forces = schedule.deflection or [], schedule.force or []
    nodes = [
        (abs(at), [abs(value) for value in sloped(schedule, list(column))])
        for at, column in zip(deflections, zip(*forces, strict=True), strict=True)
    ]
    zero = deflections.index(0.0)
    return {"pull": nodes[zero:]} | ({"push": nodes[zero::-1]} if zero else {})
