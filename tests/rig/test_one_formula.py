"""Each formula of the report stands in one place: a second copy in the sources is found here."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from coupled.rig import equations
from coupled.rig.replay import replay_schedule
from tests.support.rigs import bench

PACKAGE = Path(__file__).parents[2] / "coupled"
HOME = PACKAGE / "rig" / "equations.py"
# The twin is written anew on purpose: it is what the stages are held against.
SOURCES = [p for p in sorted(PACKAGE.rglob("*.py")) if "twin" not in p.parts and p != HOME]
GRADIENT_TABLES = {"total_gradient", "second_gradient", "gradients"}


def names(node: ast.AST) -> set[str]:
    """Return the names and attributes within a piece of source."""
    found = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
    return found | {n.attr for n in ast.walk(node) if isinstance(n, ast.Attribute)}


def copies(text: str) -> Iterator[str]:
    """Yield each line that writes a formula of `equations` out again."""
    for node in ast.walk(ast.parse(text)):
        line = f"{getattr(node, 'lineno', 0)}"
        interpolates = isinstance(node, ast.Call) and ast.unparse(node.func).endswith("interp")
        if interpolates and names(node) & GRADIENT_TABLES:
            yield f"{line}: a schedule's table by interp; take specified_gradient"
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.Div):
            over = node.right if isinstance(node, ast.BinOp) else node.value
            if re.match(r"\(?1(\.0)? [-+] .*\*", ast.unparse(over)) and any(
                name.endswith("bend") for name in names(over)
            ):
                yield f"{line}: division by 1 ± K·G; take total_to_computed or felt_gradient"
        if isinstance(node, ast.IfExp) and "None" in ast.unparse(node.test):
            pair = {"basic_gradient", "breakout"} & names(node.test)
            if pair:
                yield f"{line}: what the host assumes of {pair}; take control.assumed_…"


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_formula_is_written_out_again(path: Path) -> None:
    assert list(copies(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    "line",
    [
        "g = np.interp(q, table.dynamic_pressure, table.total_gradient)",
        "g = float(np.interp(at, pressures, gradients))",
        "asked = g / (1.0 - host.bend * g)",
        "asked /= 1.0 - bend * g",
        "felt = g / (1.0 + true_bend * g)",
        "known = loader.basic_gradient if host.basic_gradient is None else host.basic_gradient",
    ],
)
def test_a_copy_would_be_found(line: str) -> None:
    assert list(copies(line))


def test_the_specified_gradient_has_the_shape_of_the_pressure() -> None:
    table = bench().controls["column"].schedule
    assert equations.specified_gradient(table, 1500.0) == pytest.approx((560.0 + 2189.0) / 2)
    grid = np.array([[-1.0, 0.0, 1000.0], [1500.0, 3000.0, 1e6]])
    found = equations.specified_gradient(table, grid)
    assert found.shape == grid.shape
    assert found.ravel() == pytest.approx(replay_schedule(bench(), "column", grid.ravel()))


def test_the_second_gradient_is_the_first_where_there_is_one_segment() -> None:
    one = bench().controls["column"].schedule
    assert equations.second_gradient(one, 1000.0) == equations.specified_gradient(one, 1000.0)
    given = {"second_gradient_N_per_m": [300.0, 900.0], "break_deflection_m": 0.05}
    two = bench({f"controls.column.schedule.{k}": v for k, v in given.items()})
    q = np.array([0.0, 750.0, 5000.0])
    found = equations.second_gradient(two.controls["column"].schedule, q)
    assert found == pytest.approx([300.0, 450.0, 900.0])
    assert found == pytest.approx(replay_schedule(two, "column", q, beyond=True))


def test_what_the_host_assumes_is_the_loaders_own_where_nothing_else_is_given() -> None:
    rig = bench({"breakout_N": 9.0})
    assert rig.controls["column"].assumed_basic_gradient == 560.0
    assert rig.controls["column"].assumed_breakout == 9.0
    host = "controls.column.compensation"
    other = rig.changed({f"{host}.basic_gradient_N_per_m": 0.0, f"{host}.breakout_N": 4.0})
    assert other.controls["column"].assumed_basic_gradient == 0.0
    assert other.controls["column"].assumed_breakout == 4.0
