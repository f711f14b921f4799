"""The log-likelihood by which one fit beats another on the same outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.gap.search.fit import Fit
from coupled.gap.signals.output import Output, memory


def misfit(left: NDArray[np.float64]) -> float:
    """Return −2 log-likelihood a sample of a residual in noise floors, less that of one floor.

    Above the noise floor the variance is estimated by the residual's own; below it, by the noise.
    """
    square = float(np.mean(left**2))
    return float(np.log(square)) if square > 1.0 else square - 1.0


def likelier_by(outputs: Sequence[Output], right: Fit, wrong: Fit) -> float:
    """Return the log-likelihood by which the `right` fit of whole records beats the `wrong` one.

    Effective samples are counted by the autocorrelation time of what the right one leaves.
    """
    gain = 0.0
    for output in outputs:
        left = output.residual(right.rig)
        count = 0.5 * len(left) / memory(left)
        gain += count * (misfit(output.residual(wrong.rig)) - misfit(left))
    return gain
