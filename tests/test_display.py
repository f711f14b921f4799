"""Units for people: exact factors, the unit that ends a name, and what a share is shown in."""

from __future__ import annotations

import pytest

from coupled.display import shown, unit_in


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("force_N", "N"),
        ("peak_rate_rad_per_s", "rad_per_s"),
        ("true_airspeed_m_per_s", "m_per_s"),
        ("column_gradient_N_per_m", "N_per_m"),
        ("column_surface_norm", "norm"),
        ("load_factor", ""),
        ("flight-path/gamma-deg", ""),
    ],
)
def test_a_name_ends_in_its_unit(name: str, unit: str) -> None:
    assert unit_in(name) == unit


@pytest.mark.parametrize(
    ("name", "value", "si", "us"),
    [
        ("force_N", 4.4482216152605, "4.448 N", "1 lb"),
        ("column_deflection_m", 0.0254, "0.0254 m", "1 in"),
        ("altitude_m", 304.8, "304.8 m", "1000 ft"),
        ("true_airspeed_m_per_s", 51.444444444, "51.44 m/s", "100 kt"),
        ("dynamic_pressure_Pa", 47.88025898, "47.88 Pa", "1 lb/ft²"),
        ("gradient_N_per_m", 2189.08791, "2189 N/m", "12.5 lb/in"),
        ("bend_m_per_N", 9.1363e-5, "9.136e-05 m/N", "0.016 in/lb"),
        ("pitch_rad", 0.5235987756, "30 °", "30 °"),
        ("loss", 0.1667, "16.67 %", "16.67 %"),
        ("load_factor", 1.5, "1.5", "1.5"),
    ],
)
def test_a_quantity_is_shown_in_the_units_of_each_system(
    name: str, value: float, si: str, us: str
) -> None:
    for system, text in (("si", si), ("us", us)):
        unit = shown(name, "us" if system == "us" else "si")
        assert f"{unit.written(value)} {unit.unit}".strip() == text
