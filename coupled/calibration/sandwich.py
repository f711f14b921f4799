"""Errors of a fit from its own residuals, valid for few and unevenly distributed readings.

The sandwich estimator with residuals scaled by their leverage, (I − H)^−½, and the degrees of
freedom of its variance by Satterthwaite: Bell and McCaffrey (Survey Methodology 28, 2002; Imbens
and Kolesár, Review of Economics and Statistics 98, 2016). It is valid even if the instruments'
errors differ from those stated. With all readings at two corners the degrees of freedom fall to
about half of n − 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Estimate

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Sandwich:
    """Errors of a fit's p parameters, in the basis q of its whitened design.

    `q` has shape (readings, residuals of a reading, p), `lifted` is (I − H)^−½·q, `middle` the
    scatter in that basis, `back` transforms from the basis to the parameters.
    """

    q: Floats
    lifted: Floats
    middle: Floats
    back: Floats

    @property
    def covariance(self) -> Floats:
        """The covariance of the parameters, shape (p, p)."""
        return np.asarray(self.back @ self.middle @ self.back.T)

    def freedom(self, slope: Floats) -> float:
        """Return the degrees of freedom of the variance of slope·parameters."""
        share = self.lifted @ (self.back.T @ slope)
        own = np.sum(share**2, axis=1)
        pulled = np.einsum("nmp,nm->np", self.q, share)
        trace = float(np.sum(own) - np.sum(pulled**2))
        squares = np.sum(own**2) - 2.0 * own @ np.sum(pulled**2, axis=1)
        squares += np.sum((pulled.T @ pulled) ** 2)
        return max(trace**2 / float(squares), 1.0) if squares > 0.0 else 1.0

    def estimate(self, value: float, slope: Floats) -> Estimate:
        """Return an estimate with its error; `slope` is its derivative by the parameters."""
        variance = float(slope @ self.covariance @ slope)
        return Estimate(value, float(np.sqrt(max(variance, 0.0))), self.freedom(slope))


def sandwich(design: Floats, residual: Floats) -> Sandwich:
    """Return the errors of a least-squares fit.

    `design`, shape (n, m, p), and `residual`, shape (n, m), are whitened. The m residuals of a
    reading may be correlated, those of different readings are not.
    """
    n, m, p = design.shape
    flat = design.reshape(n * m, p)
    size = np.linalg.norm(flat, axis=0)
    basis, r = np.linalg.qr(flat / size)
    q = basis.reshape(n, m, p)
    left, turn = np.linalg.eigh(np.eye(m) - q @ q.transpose(0, 2, 1))
    root = turn / np.sqrt(np.maximum(left, 1e-9))[:, None, :] @ turn.transpose(0, 2, 1)
    lifted = root @ q
    score = np.einsum("nmp,nm->np", lifted, residual)
    return Sandwich(q, lifted, score.T @ score, np.linalg.inv(r) / size[:, None])
