"""An estimate with its standard error and 95 % interval, and the errors of the instruments."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from coupled.errors import InputError
from coupled.units import DEGREE_rad

Floats = NDArray[np.float64]
COVERAGE = 0.95


@dataclass(frozen=True)
class Estimate:
    """An estimate, its standard error with its degrees of freedom, and a 95 % interval."""

    value: float
    error: float
    freedom: float

    @property
    def half_width(self) -> float:
        """Half of the 95 % interval, by Student's t."""
        return self.half_width_at(COVERAGE)

    def half_width_at(self, confidence: float) -> float:
        """Half of the interval of a confidence, by Student's t."""
        return float(stdtrit(self.freedom, 0.5 + 0.5 * confidence)) * self.error

    @property
    def low(self) -> float:
        """Lower end of the interval."""
        return self.value - self.half_width

    @property
    def high(self) -> float:
        """Upper end of the interval."""
        return self.value + self.half_width

    def holds(self, true: float) -> bool:
        """Return whether the interval contains a value."""
        return self.low <= true <= self.high

    def scaled(self, factor: float) -> Estimate:
        """Return the estimate in another unit."""
        return Estimate(factor * self.value, abs(factor) * self.error, self.freedom)

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        ends = {"low": self.low, "high": self.high}
        return {"value": self.value, "standard_error": self.error, **ends}


def mean_of(values: Floats) -> Estimate:
    """Return the mean of independent values, with the error from their scatter."""
    n = len(values)
    return Estimate(float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(n)), n - 1.0)


def product(first: Estimate, second: Estimate) -> Estimate:
    """Return the product of independent estimates; degrees of freedom by Welch-Satterthwaite."""
    return _joined(
        first.value * second.value, first.scaled(second.value), second.scaled(first.value)
    )


def total(first: Estimate, second: Estimate) -> Estimate:
    """Return the sum of independent estimates; degrees of freedom by Welch-Satterthwaite."""
    return _joined(first.value + second.value, first, second)


def _joined(value: float, first: Estimate, second: Estimate) -> Estimate:
    one, two = first.error**2, second.error**2
    spread = one**2 / first.freedom + two**2 / second.freedom
    freedom = (one + two) ** 2 / spread if spread > 0.0 else first.freedom + second.freedom
    return Estimate(value, float(np.sqrt(one + two)), freedom)


@dataclass(frozen=True)
class Instruments:
    """The errors of ruler, spring scale, voltmeter and hand.

    `ruler` in d, `scale` in N and `meter` in V are standard deviations of a reading without the
    rounding to the `_step`; `hand` is the relative standard deviation of a held force between two
    readings.
    """

    ruler: float
    scale: float
    meter: float
    hand: float
    ruler_step: float
    scale_step: float
    meter_step: float

    def __post_init__(self) -> None:
        """Refuse errors below 0. Raises InputError."""
        for name, error in vars(self).items():
            if not 0.0 <= error < math.inf:
                raise InputError("instruments", name, f"is {error:g}; give 0, or a number above it")

    def deflection_variance(self, deflection: Floats, looks: Floats | float = 1.0) -> Floats:
        """Return the variance of the mean of `looks` readings of the ruler, d².

        It includes error, rounding and the hand's variation.
        """
        own = self.ruler**2 + self.ruler_step**2 / 12.0
        return np.asarray((own + (self.hand * deflection) ** 2) / looks)

    def force_variance(self, force: Floats, looks: Floats | float = 1.0) -> Floats:
        """Return the variance of the mean of `looks` readings of the spring scale, N²."""
        own = self.scale**2 + self.scale_step**2 / 12.0
        return np.asarray((own + (self.hand * force) ** 2) / looks)

    def voltage_variance(self, voltage: Floats) -> Floats:
        """Return the variance of a voltmeter's reading in V²."""
        own = self.meter**2 + self.meter_step**2 / 12.0
        return own + (self.hand * voltage) ** 2


def usual_instruments(control: str) -> Instruments:
    """Return a careful person's instruments.

    A ruler read to half a millimetre (a protractor to half a degree), a spring scale to half a
    newton, a voltmeter to 10 mV of 100 V, and a hand that varies by 0.3 %. The values are chosen,
    not from a source.
    """
    ruler = 0.2 * DEGREE_rad if control == "wheel" else 0.3e-3
    ruler_step = 0.5 * DEGREE_rad if control == "wheel" else 0.5e-3
    return Instruments(ruler, 0.3, 0.01, 0.003, ruler_step, 0.5, 0.01)


def perfect_instruments() -> Instruments:
    """Return instruments without any error."""
    return Instruments(*(0.0,) * 7)
