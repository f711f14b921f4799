"""Units: every factor is exact by definition, as scipy has it too."""

from __future__ import annotations

import math

import pytest
from scipy import constants

from coupled import units

EXACT = {
    **{"in": constants.inch, "ft": constants.foot, "mm": constants.milli, "km": constants.kilo},
    **{"kt": constants.knot, "mph": constants.mph, "fpm": constants.foot / constants.minute},
    **{"lbf": constants.lbf, "kgf": constants.kilogram_force, "g": constants.g},
    **{"psi": constants.psi, "psf": constants.lbf / constants.foot**2, "bar": constants.bar},
    **{"hPa": constants.hecto, "h": constants.hour, "min": constants.minute},
    **{"us": constants.micro, "ns": constants.nano, "%": constants.centi, "deg": constants.degree},
}


@pytest.mark.parametrize("name", EXACT)
def test_a_unit_is_what_scipy_has_it_be(name: str) -> None:
    unit = units.parse_unit(name)
    assert unit is not None
    assert unit.factor == EXACT[name]


def test_the_factors_of_the_edges_are_those_of_the_units() -> None:
    assert constants.foot == units.FOOT_m
    assert constants.knot == units.KNOT_m_per_s
    assert constants.lbf == units.POUND_N
    assert constants.lbf / constants.inch == units.POUND_PER_INCH_N_per_m
    assert constants.inch / constants.lbf == units.INCH_PER_POUND_m_per_N
    assert math.pi / 180.0 == units.DEGREE_rad


@pytest.mark.parametrize("name", ["m·N", "m*N", "m N", "N-m", "N*m", "Nm"])
def test_a_product_is_its_factors_in_any_order(name: str) -> None:
    unit = units.parse_unit(name)
    assert unit is not None
    assert (unit.factor, unit.word) == (1.0, "a torque")


@pytest.mark.parametrize("name", ["ft-lb", "lb-ft", "lbf*ft", "ft lbf", "ftlbf"])
def test_a_pound_foot_is_read_as_people_write_it(name: str) -> None:
    unit = units.parse_unit(name)
    assert unit is not None
    assert unit.factor == pytest.approx(constants.lbf * constants.foot, rel=1e-15)
    assert unit.word == "a torque"


@pytest.mark.parametrize("name", ["N/mm·s", "N/mm s", "m-", "-m", "m**N", "N*"])
def test_an_unclear_product_is_no_unit(name: str) -> None:
    assert units.parse_unit(name) is None
