"""Break a module in small ways, one at a time, and see whether its tests notice.

    python -m tests.mutation coupled/campaign/standards.py tests/campaign/test_check.py

Each mutant changes one operator, comparison, number or condition of the module, in a copy of the
clone that is thrown away. It is killed if a test fails, or hangs. One that survives is printed with
its line: no test holds what it changed. `--sample 40` takes that many of the mutants at random; it
is for kernels, where each mutant is compiled anew.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPIED = ("coupled", "aircraft", "runs", "tests", "docs", "README.md", "pyproject.toml")
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
}
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}


@dataclass(frozen=True)
class Mutant:
    """One change: bytes from `start` to `end` of the source give way to `new`."""

    line: int
    start: int
    end: int
    old: str
    new: str

    def applied(self, source: bytes) -> bytes:
        """Return the source with the change."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def mutants(source: bytes) -> list[Mutant]:
    """Return every mutant of a module that parses, in the order of its lines."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []
    for node in _physics(ast.parse(source)):
        for other in _broken(node):
            assert node.end_lineno is not None and node.end_col_offset is not None
            start = starts[node.lineno - 1] + node.col_offset
            end = starts[node.end_lineno - 1] + node.end_col_offset
            new = f"({ast.unparse(other)})"
            found.append(Mutant(node.lineno, start, end, source[start:end].decode(), new))
    return sorted(found, key=lambda mutant: (mutant.start, mutant.end, mutant.new))


def _physics(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the expressions that are evaluated: no annotation, no decorator, no message."""
    if isinstance(node, ast.expr):
        yield node
    for name, field in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases", "format_spec"):
            continue
        if isinstance(node, (ast.Raise, ast.Assert, ast.JoinedStr)):
            continue
        for child in field if isinstance(field, list) else [field]:
            if isinstance(child, ast.AST):
                yield from _physics(child)


def _broken(node: ast.expr) -> Iterator[ast.expr]:
    """Yield what a node is changed to."""
    other = copy.deepcopy(node)
    match other:
        case ast.BinOp() if type(other.op) in OPERATORS:
            other.op = OPERATORS[type(other.op)]()
            yield other
        case ast.Compare() if type(other.ops[0]) in COMPARISONS:
            other.ops[0] = COMPARISONS[type(other.ops[0])]()
            yield other
        case ast.BoolOp():
            other.op = ast.Or() if isinstance(other.op, ast.And) else ast.And()
            yield other
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield other.operand
        case ast.IfExp():
            yield other.body
            yield other.orelse
        case ast.Constant(value=bool(truth)):
            yield ast.Constant(not truth)
        case ast.Constant(value=int(number) | float(number)):
            yield ast.Constant(number + 1)
            if isinstance(number, float) and number:
                yield ast.Constant(1.1 * number)


def killed(clone: Path, tests: list[str], limit_s: float) -> bool:
    """Return whether a test fails in the clone as it is now, or does not end in time."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider"]
    environment = {**os.environ, "PYTHONPATH": str(clone), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            [*command, *tests],
            cwd=clone,
            env=environment,
            check=False,
            timeout=limit_s,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        return True
    return done.returncode != 0


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("module")
    parser.add_argument("tests", nargs="+")
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    source = (ROOT / given.module).read_bytes()
    chosen = mutants(source)
    if given.sample and given.sample < len(chosen):
        chosen = sorted(
            random.Random(given.seed).sample(chosen, given.sample), key=lambda m: m.start
        )
    with tempfile.TemporaryDirectory() as name:
        clone = Path(name)
        for each in COPIED:
            copying = shutil.copytree if (ROOT / each).is_dir() else shutil.copy2
            copying(ROOT / each, clone / each)
        start = time.perf_counter()
        if killed(clone, given.tests, 600.0):
            sys.exit("the tests fail without a mutant")
        limit_s = 30.0 + 10.0 * (time.perf_counter() - start)
        start, survived = time.perf_counter(), 0
        for mutant in chosen:
            (clone / given.module).write_bytes(mutant.applied(source))
            if not killed(clone, given.tests, limit_s):
                survived += 1
                print(f"{given.module}:{mutant.line}: {mutant.old} → {mutant.new}", flush=True)
        taken = time.perf_counter() - start
    dead = len(chosen) - survived
    print(f"{dead} of {len(chosen)} mutants killed, {taken:.0f} s")


if __name__ == "__main__":
    main()
