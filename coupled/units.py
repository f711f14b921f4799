"""Factors from the units of the field's edges to SI: multiply by them to get SI."""

from __future__ import annotations

import math
from typing import Final

from scipy import constants

FOOT_m: Final[float] = constants.foot
INCH_m: Final[float] = constants.inch
KNOT_m_per_s: Final[float] = constants.knot
POUND_N: Final[float] = constants.lbf
PSF_Pa: Final[float] = constants.lbf / constants.foot**2
POUND_PER_INCH_N_per_m: Final[float] = constants.lbf / constants.inch
INCH_PER_POUND_m_per_N: Final[float] = constants.inch / constants.lbf
DEGREE_rad: Final[float] = math.pi / 180.0
