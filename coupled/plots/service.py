"""A flight whose structure changes: authority lost with a fixed and an adapted compensation."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from coupled.record.channels import channel
from coupled.record.record import Record

Floats = NDArray[np.float64]
WINDOW_s = 4.0


def lost_share(record: Record, control: str, window_s: float = WINDOW_s) -> tuple[Floats, Floats]:
    """Return times in s, and the share of δ that δ̂ lacks around each time: 1 − Σδ·δ̂/Σδ².

    The share is a least squares fit over a window, so it is defined where the control is neutral.
    """
    true = record[channel(control, "deflection")]
    estimated = record[channel(control, "estimate")]
    time = record.time_s
    rows = max(2, round(window_s / float(np.median(np.diff(time)))))
    box = np.ones(rows)
    both, own = (np.convolve(product, box, "valid") for product in (true * estimated, true * true))
    middle = time[rows // 2 : rows // 2 + len(own)]
    moved = own > 0.02 * own.max()  # small motion has no significant loss
    return middle[moved], 1.0 - both[moved] / own[moved]


def draw_service(
    fixed: Record, adapted: Record, changed_s: float, control: str = "column"
) -> Figure:
    """Return the figure of authority lost before and after the structure changed at `changed_s`."""
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axis = figure.subplots()
    for record, name in ((fixed, "K̂ as calibrated"), (adapted, "K̂ adapted in service")):
        time, lost = lost_share(record, control)
        axis.plot(time, 100.0 * lost, label=name)
    axis.axvline(changed_s, color="0.5", linestyle=":", label="the structure softens by 40 %")
    axis.set_xlabel("time, s")
    axis.set_ylabel("authority lost, % of δ")
    axis.legend(frameon=False)
    axis.grid(alpha=0.3)
    return figure
