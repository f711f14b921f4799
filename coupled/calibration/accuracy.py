"""The accuracy of a compensated rig: errors of deflection and felt gradient after a calibration.

Compensated with Ŝ₁, Ŝ₂, Ŝ₃ and K̂, at rest without breakout and at a gradient G:

    δ̂/δ = (S₁/Ŝ₁)·(1 − K·G) + K̂·G·S₃/Ŝ₃                      (the surface follows δ̂)
    felt/specified = (G_L/(1 + K·G_L))/G,
    G_L = G_B + (G/(1 − K̂·G) − G_B)·(S₁/Ŝ₁)·(Ŝ₂/S₂)       (figure 5: v₂ is computed from ΔG and v₁)

The errors of S₁ and K from one fit are correlated and mostly cancel in δ̂. If S₂ is computed from
S₁ by the gain S₁/S₂, their errors cancel in the felt gradient.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coupled.calibration.assumedscales import Scales
from coupled.calibration.errors_in_variables import JointFit
from coupled.calibration.estimate import Estimate, total
from coupled.rig.equations import bend_loss, felt_gradient, modifying_gradient
from coupled.rig.parameters import Control

DEFLECTION_WITHIN, FELT_WITHIN = 0.005, 0.01  # required of a compensated rig, as shares


@dataclass(frozen=True)
class Accuracy:
    """Relative errors of δ̂ and of the felt gradient, at a gradient in N/d.

    `felt` is None if S₂ was not found.
    """

    gradient: float
    deflection: Estimate
    felt: Estimate | None

    def as_dict(self, d: str) -> dict[str, float]:
        """Return the JSON; `d` is the unit of deflection."""
        table = {f"gradient_N_per_{d}": self.gradient}
        table["deflection_half_width"] = self.deflection.half_width
        if self.felt is not None:
            table["felt_half_width"] = self.felt.half_width
        return table


def deflection_off(found: Scales, bend: float, true: Scales, true_bend: float, g: float) -> float:
    """Return δ̂/δ − 1 at a gradient in N/d, for scales and K (d/N) assumed and true."""
    seen = true.s1 / found.s1 * (1.0 - bend_loss(true_bend, g))
    return seen + bend_loss(bend, g) * true.s3 / found.s3 - 1.0


def actual_over_ordered(found: Scales, true: Scales) -> float:
    """Return ΔF over the ΔF ordered, by scales assumed and true: figures 3 and 5."""
    return true.s1 / found.s1 * found.s2 / true.s2


def felt_off(made: float, bend: float, true_bend: float, gradients: tuple[float, float]) -> float:
    """Return felt over specified gradient minus 1.

    `made` is ΔF over the ΔF ordered (`actual_over_ordered`), `gradients` (G, G_B) in N/d.
    """
    g, basic = gradients
    held = basic + modifying_gradient(g, bend, basic) * made
    return felt_gradient(held, true_bend) / g - 1.0


def expected(
    fit: JointFit, s2: Estimate | None, control: Control, tied: bool = False
) -> Accuracy | None:
    """Return the errors of deflection and felt gradient at the gradient where they are largest.

    `tied`: S₂ was computed from this fit's S₁ by the gain S₁/S₂. None if K·G ≥ 1, where no
    compensation exists.
    """
    table = control.schedule.gradients
    bend = fit.line.bend.value
    tried = np.linspace(min(table), max(table), 9)
    if bend_loss(bend, max(table)) >= 1.0:
        return None
    basic = control.loader.basic_gradient
    found = [_at(fit, s2, tied, float(g), basic) for g in tried if g > 0.0]
    return max(found, key=lambda one: one.deflection.half_width, default=None)


def _at(fit: JointFit, s2: Estimate | None, tied: bool, g: float, basic: float) -> Accuracy:
    s1, bend, s3 = fit.line.s1.value, fit.line.bend.value, fit.s3.value
    lost = bend_loss(bend, g)
    off = fit.estimate(0.0, -(1.0 - lost) / s1, g, -lost / s3)
    if s2 is None:
        return Accuracy(g, off, None)
    if tied:
        return Accuracy(g, off, fit.estimate(0.0, 0.0, g, 0.0))
    by_made = (1.0 - lost) * (1.0 - basic / g * (1.0 - lost))
    by_fit = fit.estimate(0.0, -by_made / s1, g, 0.0)
    scaled = Estimate(0.0, abs(by_made) / s2.value * s2.error, s2.freedom)
    return Accuracy(g, off, total(by_fit, scaled))
