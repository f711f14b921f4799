"""Readings for tests, made directly from eq. (3) without a bench."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Instruments
from coupled.calibration.readings import Readings, readings_of
from coupled.resources import shipped_rigs
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.units import INCH_PER_POUND_m_per_N

S1, S2, S3 = 562.43, 0.25, 0.26
K = 0.016 * INCH_PER_POUND_m_per_N
Floats = NDArray[np.float64]


def report_rig() -> Rig:
    return read_rig(shipped_rigs()["report-column"])


def column() -> Control:
    return report_rig().controls["column"]


def grid(gradients: int = 5, deflections: int = 5) -> tuple[Floats, Floats]:
    """Return true δ in m and F in N on a grid of 3.2 to 12.5 lb/in, up to 150 N."""
    slopes = np.repeat(np.linspace(560.4, 2189.1, gradients), deflections)
    share = np.tile(np.linspace(0.4, 1.0, deflections), gradients)
    delta = share * np.minimum(0.169, 150.0 / slopes)
    return delta, slopes * delta


def readings(
    delta: Floats,
    force: Floats,
    v1: Floats | None = None,
    v3: Floats | None = None,
    per_set: int = 5,
) -> Readings:
    """Return readings of these values, volts by eq. (3) unless given; no null."""
    n = len(delta)
    four = (delta, force, S1 * (delta - K * force) if v1 is None else v1)
    columns = np.stack((*four, S3 * force if v3 is None else v3, *np.full((2, n), np.nan)))
    labels = [str(1 + i // per_set) for i in range(n)]
    return readings_of(range(2, n + 2), labels, columns, [], np.empty((4, 0)))


def with_errors(
    delta: Floats, force: Floats, tools: Instruments, rng: np.random.Generator
) -> Readings:
    """Return readings with independent normal errors of the instruments' variances."""
    true = readings(delta, force)

    def off(values: Floats, variance: Floats) -> Floats:
        return values + np.sqrt(variance) * rng.standard_normal(len(values))

    return readings(
        off(delta, tools.deflection_variance(delta)),
        off(force, tools.force_variance(force)),
        off(true.v1, tools.voltage_variance(true.v1)),
        off(true.v3, tools.voltage_variance(true.v3)),
    )


CSV = """gradient_set,deflection_in,force_lb,v1_V,v3_V,v2_V,remark
soft,2.0,6.4,27.11,7.40,,
soft,4.0,12.8,54.23,14.80,,first try
soft,6.0,19.2,81.35,22.21,,
stiff,1.0,12.5,11.43,14.46,,
stiff,2.0,25.0,22.86,28.91,,
stiff,2.5,31.25,28.57,36.14,,
null,,,40.0,12.5,12.0,
null,,,60.0,18.75,18.0,
"""


def csv_file(folder: Path, text: str = CSV) -> Path:
    path = folder / "readings.csv"
    path.write_text(text, encoding="utf-8")
    return path
