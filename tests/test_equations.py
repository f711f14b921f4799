"""docs/equations.md is an index of the report's equations, generated from the code and its tests.

A function implements an equation if its docstring names it, as `eq. (12)` or `appendix A`; a test
likewise, or by its name. `python tests/test_equations.py` writes the index.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
INDEX = ROOT / "docs" / "equations.md"

# Each equation in this package's symbols, and its meaning.
EQUATIONS = {
    "1": ("δc = δ − K·F", "the structure bends by K·F between servo and grip"),
    "2": ("v₁ = S₁·δc", "the computed deflection in volts"),
    "3": ("v₁ = S₁·δ − S₁·K·F", "(1) in volts, as read on a bench"),
    "4": ("v₁ = a·δ + b·F", "the polynomial fitted to readings"),
    "5a": ("S₁ = a", "the scale from the fit"),
    "5b": ("K = −b/S₁", "the bend coefficient from the fit"),
    "6": ("F = G_T·δ", "the force specified"),
    "7": ("δc = δ·(1 − K·G_T)", "the computed deflection at the correct felt gradient"),
    "7a": ("Δδc = −δ·K·G_T", "the deflection lost relative to a rigid control"),
    "8": ("F_L = G_B·δc", "the loader's own spring force"),
    "9": ("F_mod = F − F_L", "the modifying force needed"),
    "10": ("F_mod = G_T·δ − G_B·δc", "the same, with (6) and (8)"),
    "11": ("F_mod = (G_T/(1 − K·G_T) − G_B)·δc", "the same as a function of δc, with (7)"),
    "12": ("ΔG = G_T/(1 − K·G_T) − G_B", "the modifying gradient, compensated for the bend"),
    "13": ("S₃ = (1/n)·Σ v₃/F", "the scale of the force, a mean of ratios"),
    "14": ("S₂ = v₂·S₃/v₃", "the scale of the modifying force, by nulling v₁"),
    "15": ("δ = L·sin θ", "the reading of a level ruler"),
    "16": ("δ = L·θ", "the deflection along the arc"),
    "17": ("sin θ ≈ θ − θ³/6", "the difference between (15) and (16)"),
    "A": ("(a, b) by Cramer's rule", "the normal equations of (4)"),
    "B": ("S₁·v₃/S₃ = S₁·v₂/S₂", "the derivation of (14)"),
    "C": ("F = F_BO + G₁·δ, slope G₂ beyond δ₁", "two segments, with the bend compensated"),
}

HEAD = """\
Each equation of [the report](report.md) in this package's symbols, its code and its tests.
`python tests/test_equations.py` writes this file from the docstrings.

number| equation| meaning| code| tests
---| ---| ---| ---| ---
"""

MISPRINTS = """
## Misprints and omissions of the report

where| printed| correct
---| ---| ---
bend coefficient| 0.928 m/N (0.016 in./lb)| 0.016 in/lb is 9.14e-5 m/N
worst case| 2155.2 N/m (12.5 lb/in.)| 12.5 lb/in is 2189 N/m
full column| 0.788 m (7 in.)| 7 in is 0.1778 m
(7a)| "differentiating" (7)| the loss relative to a rigid control; \
relative to a calibration at G₀ it is δ·K·(G_T − G₀)/(1 − K·G₀)
(11), appendix C| δ = δc/(1 − K·G_T)| with a breakout (δc + K·F_BO)/(1 − K·G_T): as printed, \
the force lacks G_T·K·F_BO/(1 − K·G_T) at a δc
(12)| no limit| singular at K·G_T = 1: no gradient can exceed the stiffness of the structure
appendix C| no flow chart| the break lies at δc₁ = δ₁ − K·F(δ₁): this project's \
reading, see `rig/modification.py`
"""

CITED = re.compile(r"\b[Ee]qs?\. (\(\w+\)(?:(?:, | and | to )\(\w+\))*)")
APPENDIX = re.compile(r"\bappendix ([ABC])\b(?!, table)", re.IGNORECASE)
NAMED = re.compile(r"_eqs?_(\d+[ab]?)(?:_to_(\d+))?")


def cited(text: str) -> Iterator[str]:
    """Yield the keys of `EQUATIONS` that a text names, ranges filled."""
    for places in CITED.findall(text):
        parts = re.findall(r"(to )?\((\w+)\)", places)
        for i, (to, key) in enumerate(parts):
            if to:
                yield from (str(n) for n in range(int(parts[i - 1][1]) + 1, int(key)))
            yield key
    yield from APPENDIX.findall(text)


@cache
def functions(folder: str) -> tuple[tuple[Path, ast.FunctionDef], ...]:
    """Return the functions of the files that name an equation."""
    texts = {path: path.read_text(encoding="utf-8") for path in (ROOT / folder).rglob("*.py")}
    named = (CITED, APPENDIX, NAMED)
    return tuple(
        (path.relative_to(ROOT), node)
        for path, text in sorted(texts.items())
        if any(pattern.search(text) for pattern in named)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
    )


@cache
def implemented() -> dict[str, list[str]]:
    """Return links to the functions that implement each equation, the closed forms first."""
    found = defaultdict(list)
    for path, node in functions("coupled"):
        for key in dict.fromkeys(cited(ast.get_docstring(node) or "")):
            module = ".".join(path.with_suffix("").parts[1:])
            link = f"[`{module}.{node.name}`](../{path.as_posix()}#L{node.lineno})"
            found[key].append((path.stem != "equations", link))
    return {key: [link for _, link in sorted(links)] for key, links in found.items()}


@cache
def held_by() -> dict[str, list[str]]:
    """Return links to the tests of each equation."""
    found = defaultdict(list)
    for path, node in functions("tests"):
        if not node.name.startswith("test_"):
            continue
        keys = list(cited(ast.get_docstring(node) or ""))
        for first, last in NAMED.findall(node.name):
            keys += [str(n) for n in range(int(first), int(last) + 1)] if last else [first]
        for key in dict.fromkeys(keys):
            found[key].append(f"[`{node.name}`](../{path.as_posix()})")
    return found


def index() -> str:
    """Return the text of docs/equations.md."""
    code, tests = implemented(), held_by()
    lines = ["# The report's equations", ""]
    lines += HEAD.splitlines()
    for key, (says, means) in EQUATIONS.items():
        name = f"appendix {key}" if key in "ABC" else f"({key})"
        where = "<br>".join(code.get(key, ["none"]))
        held = "<br>".join(tests.get(key, ["none"]))
        lines.append(f"{name}| {says}| {means}| {where}| {held}")
    lines += MISPRINTS.splitlines()
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("key", EQUATIONS)
def test_an_equation_has_code_and_a_test(key: str) -> None:
    assert implemented().get(key), "no function's docstring names it"
    assert held_by().get(key), "no test names it"


def test_only_equations_of_the_report_are_named() -> None:
    assert set(implemented()) | set(held_by()) <= set(EQUATIONS)


def test_the_index_is_that_of_the_code() -> None:
    stale = "docs/equations.md is stale: run python tests/test_equations.py"
    assert INDEX.read_text(encoding="utf-8") == index(), stale


def test_ranges_and_lists_are_read() -> None:
    assert list(cited("eqs. (9), (10) to (12) and (7a); appendix C")) == [
        "9",
        "10",
        "11",
        "12",
        "7a",
        "C",
    ]
    assert list(cited("14 CFR Part 60, appendix A, table A2A")) == []


if __name__ == "__main__":
    INDEX.write_text(index(), encoding="utf-8")
