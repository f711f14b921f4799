"""`--units us` on what people read, and tables that no terminal cuts."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import coupled.cli
from coupled.cli.gaps import in_words
from coupled.cli.tables import print_table
from coupled.display import in_system, split_unit
from coupled.gap.findings.proposal import EffectPower
from coupled.gap.findings.result import EffectResult, ParameterEstimate
from coupled.plots.maps import draw_losses
from coupled.tables.gaps import effects_table, power_table
from coupled.tables.table import Mark, Table
from tests.support.commands import coupled as command

POUND_N, INCH_m, DEGREE_rad = 4.4482216152605, 0.0254, 0.017453292519943295


@pytest.mark.parametrize(
    ("unit", "shown", "factor"),
    [
        ("N", "lb", 1 / POUND_N),
        ("N·s/m", "lb·s/in", INCH_m / POUND_N),
        ("N/m³", "lb/in³", INCH_m**3 / POUND_N),
        ("m/N", "in/lb", POUND_N / INCH_m),
        ("N/rad", "lb/°", DEGREE_rad / POUND_N),
        ("kg", "lb", 1 / 0.45359237),
        ("Pa", "lb/ft²", 0.3048**2 / POUND_N),
        ("V/N", "V/lb", POUND_N),
        ("s", "s", 1.0),
        ("", "", 1.0),
        ("°", "°", 1.0),
    ],
)
def test_a_unit_is_shown_factor_by_factor(unit: str, shown: str, factor: float) -> None:
    found = in_system(unit, "us")
    assert found.unit == shown
    assert found.factor == pytest.approx(factor, rel=1e-9)
    assert in_system(unit, "si") == in_system(unit)
    assert (in_system(unit).unit, in_system(unit).factor) == (unit, 1.0)


def test_a_name_is_split_from_its_unit() -> None:
    assert split_unit("play_m") == ("play", "m")
    assert split_unit("damping_N_s_per_m") == ("damping", "N·s/m")
    assert split_unit("column_deflection_m") == ("column_deflection", "m")
    assert split_unit("drift_per_s") == ("drift", "1/s")
    assert split_unit("cubic_N_per_m3") == ("cubic", "N/m³")
    assert split_unit("acceleration_rad_per_s2") == ("acceleration", "rad/s²")
    assert split_unit("s1_over_s2") == ("s1_over_s2", "")
    assert split_unit("factor") == ("factor", "")


PLAY = ParameterEstimate(
    "play_m", 1.27e-3, 1e-3, 1.5e-3, "loader.play_m", "m", 0.0, 1.27e-3, 1.016e-3, 1.524e-3
)


def printed(width: int, table: Table) -> str:
    console = Console(width=width, no_color=True, color_system=None)
    with console.capture() as caught:
        print_table(console, table, edge=True)
    return caught.get()


@pytest.mark.parametrize("width", [24, 40, 80])
def test_a_diagnosis_in_us_units_is_whole_on_any_terminal(width: int) -> None:
    effect = EffectResult("backlash", "linkage", 0.97, (PLAY,))
    text = printed(width, effects_table([effect], [], "us"))
    assert "…" not in text
    assert "0 → 0.05 in (+0.05)" in " ".join(text.split())
    said = " ".join(text.split())
    assert "0.04 to 0.06" in said or "--wide shows also: 95 % interval" in said
    assert width == 40 or "0.04 to 0.06" in said
    sizes = [EffectPower("backlash", "linkage", True, True, (("play_m", 0.0254),))]
    text = printed(width, power_table(sizes, "us"))
    assert "play, in 1" in " ".join(text.split())


def test_what_is_to_be_set_in_a_file_stays_in_the_files_unit() -> None:
    whole: Any = SimpleNamespace(
        summary="Backlash, 0 → 0.00127 m (+0.00127). Set loader.play_m to 0.00127 m.",
        effects=[EffectResult("backlash", "linkage", 0.97, (PLAY,))],
    )
    assert in_words(whole, "si") == whole.summary
    assert in_words(whole, "us") == (
        "Backlash, 0 → 0.05 in (+0.05). Set loader.play_m to 0.00127 m."
    )


@pytest.mark.parametrize("width", [12, 20, 40])
def test_a_narrow_terminal_writes_rows_downwards(width: int) -> None:
    heads = ("gradient", "force", "", "a word", "")
    row = ("1234.5", "9.876", "N", "six words that may be wrapped", Mark("FAIL", "bad"))
    text = printed(width, Table(heads, (row,), align="rl"))
    assert "…" not in text and max(map(len, text.splitlines())) <= width
    assert {"1234.5", "9.876", "FAIL"} <= set(text.split())
    if width == 20:
        assert "gradient: 1234.5" in text and "force: 9.876 N" in text


def test_every_table_of_the_command_line_is_printed_whole() -> None:
    for path in Path(coupled.cli.__file__).parent.rglob("*.py"):
        if path.name != "tables.py":
            text = path.read_text(encoding="utf-8")
            assert "rich.table" not in text, path


def test_a_plan_of_readings_in_us_units_is_the_one_in_si(tmp_path: Path) -> None:
    words = ("calibrate", "--plan", "--rig", "t37", "--json", "plan.json")
    us = command(tmp_path, *words, "--units", "us")
    assert us.returncode == 0, us.stderr
    readings = json.loads((tmp_path / "plan.json").read_text())["readings"]
    assert "gradient, lb/in  q̄, lb/ft²  deflection, in  force, lb" in us.stdout
    first = readings[0]
    row = f"{first['gradient'] * INCH_m / POUND_N:.5g}"
    [line] = [line for line in us.stdout.splitlines() if line.strip().startswith(row)]
    assert float(line.split()[2]) == pytest.approx(first["deflection"] / INCH_m, rel=1e-4)
    assert "gradient, N/m" in command(tmp_path, *words).stdout


def test_a_map_is_drawn_in_us_units() -> None:
    loss: Any = SimpleNamespace(
        control="column",
        configuration="rigid",
        loss=np.array([[0.0, 0.1], [0.0, 0.2]]),
        pressure_Pa=np.array([0.0, 4788.025898]),
        deflection=np.array([0.0, 0.254]),
    )
    nothing = np.zeros((2, 0))
    figure = draw_losses("rig", {"column": [loss] * 4}, {"column": nothing}, "us")
    axes = figure.axes[0]
    assert axes.get_ylim()[1] == pytest.approx(10.0)
    assert axes.get_xlim()[1] == pytest.approx(100.0)
    assert "lb/ft²" in axes.get_xlabel() and axes.get_ylabel().endswith(", in")
