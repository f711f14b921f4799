"""Change a module in small ways, one at a time, and print the changes that no test detects.

    python -m tests.mutation coupled/campaign/standards.py tests/campaign/test_check.py
    python -m tests.mutation coupled/rig/linkage.py tests/rig/test_linkage.py --plain --sample 25

Each mutant changes one operator, comparison, number or condition of the module. It is killed if
a test fails, or hangs; one that survives is printed with its line: no test holds what it changed.
`--sample 25` takes that many of the mutants at random; `--change OLD NEW`, given once or more,
makes mutants of your own.

The tests run once without a mutant. Each run is a fork of this process, which has imported all;
it imports the changed module, and what depends on it, anew. No file is changed, so a test that
starts another process does not see the mutant. A mutant that ends the process counts as killed
and is printed, since something else may have ended it: try it again by `--change`.

For a module of the rig all stages are compiled once; each fork compiles the changed one and what
calls it, which takes two to eight seconds. `--plain` runs them as plain Python instead: nothing is
compiled, and a test takes a hundred times as long, which is quicker where it runs few substeps.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.abc
import importlib.machinery
import importlib.util
import math
import os
import random
import select
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NoReturn

import numba
import numpy as np
import pytest

from coupled.rig import compiled
from tests.support.interpreted import interpret

ROOT = Path(__file__).parents[1]
ALWAYS = ("-x", "-q", "-n", "0", "-p", "no:cacheprovider")
PASSED = "passed"  # what a fork answers whose tests notice nothing
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
    """One change: bytes from `start` to `end` of the source are replaced by `new`."""

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
            new = ast.unparse(other)
            if isinstance(other, ast.expr):
                new = f"({new})"
            found.append(Mutant(node.lineno, start, end, source[start:end].decode(), new))
    return sorted(found, key=lambda mutant: (mutant.start, mutant.end, mutant.new))


def by_hand(source: bytes, old: str, new: str) -> Mutant:
    """Return the change of a text that occurs once in the source; raises ValueError otherwise."""
    if source.count(old.encode()) != 1:
        message = f"{old!r} is to stand in the module once"
        raise ValueError(message)
    start = source.index(old.encode())
    line = source.count(b"\n", 0, start) + 1
    return Mutant(line, start, start + len(old.encode()), old, new)


def _physics(node: ast.AST) -> Iterator[ast.expr | ast.AugAssign]:
    """Yield the expressions that are evaluated: no annotation, no decorator, no message."""
    if isinstance(node, ast.expr | ast.AugAssign):
        yield node
    for name, field in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases", "format_spec"):
            continue
        if isinstance(node, (ast.Raise, ast.Assert, ast.JoinedStr)):
            continue
        for child in field if isinstance(field, list) else [field]:
            if isinstance(child, ast.AST):
                yield from _physics(child)


def _broken(node: ast.expr | ast.AugAssign) -> Iterator[ast.expr | ast.AugAssign]:
    """Yield the replacements of a node."""
    other = copy.deepcopy(node)
    match other:
        case ast.BinOp() | ast.AugAssign() if type(other.op) in OPERATORS:
            other.op = OPERATORS[type(other.op)]()
            yield other
        case ast.Call(func=ast.Name(id="min" | "max" as which)):
            other.func = ast.Name("max" if which == "min" else "min")
            yield other
        case ast.Call(func=ast.Name(id="abs")):
            yield other.args[0]
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


class _Changed(importlib.machinery.SourceFileLoader):
    """Loads a module from its file's place, and from another source."""

    def __init__(self, name: str, source: bytes) -> None:
        place = ROOT / (name.replace(".", "/") + ".py")
        super().__init__(name, str(place))
        self.source = source

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.source, self.path, "exec")


@dataclass(frozen=True)
class _Finder(importlib.abc.MetaPathFinder):
    """Finds the changed module before Python finds its file."""

    loader: _Changed

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name != self.loader.name:
            return None
        return importlib.util.spec_from_file_location(name, self.loader.path, loader=self.loader)


class _Watch:
    """A pytest plugin that keeps the first failed test; examples are the same each time."""

    name = ""

    def pytest_sessionstart(self) -> None:
        # After pytest, which rewrites what it imports.
        settings: Any = importlib.import_module("hypothesis").settings
        settings.register_profile(
            "mutation", deadline=None, derandomize=True, database=None, max_examples=15
        )
        settings.load_profile("mutation")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.name:
            self.name = report.nodeid

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed and not self.name:
            self.name = f"{report.nodeid} (collecting)"


def _imported(module: ModuleType) -> set[str]:
    """Return the names that a module imports anywhere, and from which modules."""
    found = set()
    for node in ast.walk(ast.parse(Path(str(module.__file__)).read_bytes())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def dependants(name: str) -> set[str]:
    """Return the loaded modules of package and tests that depend on one, and that one."""
    ours = {
        each: _imported(module)
        for each, module in sys.modules.items()
        if each.split(".")[0] in ("coupled", "tests") and getattr(module, "__file__", None)
    }
    found, before = {name}, 0
    while len(found) > before:
        before = len(found)
        found |= {each for each, needs in ours.items() if needs & found}
    return found


def forget(names: set[str]) -> None:
    """Remove modules, so that they are imported again."""
    for name in names & set(sys.modules):
        del sys.modules[name]
        package, _, inner = name.rpartition(".")
        vars(sys.modules.get(package, sys)).pop(inner, None)


def uncached() -> None:
    """Disable the kernels' disk cache, which was compiled from the unchanged file."""

    def entry(function: Any, **_: bool) -> Any:
        return numba.njit(function)

    vars(compiled)["entry"] = entry


def compile_stages() -> None:
    """Compile the stages of the rig, so that a fork compiles only changed ones."""
    rigs: Any = importlib.import_module("tests.support.rigs")
    standalone: Any = importlib.import_module("coupled.rig.standalone")
    rig = rigs.bench()
    rigs.push(rig, 1.0, 0.001)
    standalone.run_control(rig, "column", np.zeros(rig.substeps + 1), np.zeros(1))


def _tried(
    name: str, source: bytes, stale: set[str], tests: list[str], limit_s: float, answer: int
) -> NoReturn:
    """Run the tests with the changed module in a separate process; send the first failure."""
    os.setsid()
    signal.alarm(math.ceil(limit_s) + 1)  # should this process be ended before it
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    if name.startswith("coupled.rig."):
        uncached()
    failure = _Watch()
    status = 1
    try:
        forget(stale)
        sys.meta_path.insert(0, _Finder(_Changed(name, source)))
        status = int(pytest.main([*ALWAYS, *tests], plugins=[failure]))
    finally:
        said = (failure.name or "*") if status else PASSED
        os.write(answer, said.encode())
        os._exit(0)


def killer(name: str, source: bytes, stale: set[str], tests: list[str], limit_s: float) -> str:
    """Return the first test that fails with the changed module; empty if none fails."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        _tried(name, source, stale, tests, limit_s, writing)
    os.close(writing)
    try:
        if not select.select([reading], [], [], limit_s)[0]:
            os.killpg(child, signal.SIGKILL)
            return f"no end within {limit_s:.0f} s"
        if said := os.read(reading, 4096):
            return "" if said == PASSED.encode() else said.decode()
        return "process ended before its tests did"
    finally:
        os.close(reading)
        os.waitpid(child, 0)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutation",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("module")
    parser.add_argument("tests", nargs="+")
    parser.add_argument("--sample", type=int, default=0, help="so many mutants, at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plain", action="store_true", help="the rig's kernels as plain Python")
    parser.add_argument(
        "--change", nargs=2, action="append", metavar=("OLD", "NEW"), help="changes of your own"
    )
    parser.add_argument("-k", dest="only", default="", help="of the tests those of such names")
    parser.add_argument("--deselect", action="append", default=[], help="a test not to be run")
    parser.add_argument("--verbose", action="store_true", help="name each mutant's killer")
    given = parser.parse_args()
    source = (ROOT / given.module).read_bytes()
    chosen = mutants(source)
    if given.change:
        chosen = [by_hand(source, old, new) for old, new in given.change]
    elif given.sample and given.sample < len(chosen):
        chosen = sorted(
            random.Random(given.seed).sample(chosen, given.sample), key=lambda m: m.start
        )
    name = given.module.removesuffix(".py").replace("/", ".")
    of_the_rig = name.startswith("coupled.rig.")
    if given.plain or of_the_rig:
        forget(dependants("coupled.rig.compiled") - {"coupled.rig.compiled", __name__})
        if given.plain:
            interpret()
        else:
            uncached()
    tests = [*given.tests, *(f"--deselect={each}" for each in given.deselect)]
    tests += ["-k", given.only]
    # Imports all, and runs nothing: a thread that a test starts would be lost in the forks.
    pytest.main([*ALWAYS, "--collect-only", *tests], plugins=[_Watch()])
    if of_the_rig and not given.plain:
        compile_stages()
    stale = dependants(name) - {"__main__", "tests.mutation"}
    start_s = time.perf_counter()
    if failed := killer(name, source, stale, tests, 600.0):
        sys.exit(f"{failed} fails without a mutant")
    limit_s = 30.0 + 5.0 * (time.perf_counter() - start_s)
    start_s, survived = time.perf_counter(), 0
    for mutant in chosen:
        test = killer(name, mutant.applied(source), stale, tests, limit_s)
        survived += not test
        if given.verbose or not test or test.startswith(("no end", "process")):
            place = f"{given.module}:{mutant.line}: {mutant.old} → {mutant.new}"
            print(f"{test or 'SURVIVED'}: {place}", flush=True)
    taken = time.perf_counter() - start_s
    dead = len(chosen) - survived
    print(f"{dead} of {len(chosen)} mutants killed, {taken:.0f} s")


if __name__ == "__main__":
    main()
