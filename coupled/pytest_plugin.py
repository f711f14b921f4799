"""Run files as tests of pytest: one test for each expectation on each flight.

    [tool.pytest.ini_options]
    coupled_runs = ["runs/*.toml"]

These are patterns relative to pytest's root, matched wherever pytest looks for tests. Without the
option they are `runs/*.toml`, and a file counts only if it has `rig` and `[[expect]]`. Where no
file matches, nothing but this module is loaded. `pytest --coupled-report FILE.html` writes the
expectations that failed as one HTML file.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from coupled.campaign.check import Asked
    from coupled.campaign.verdict import Verdict

_JUDGED = "coupled_verdict"  # attribute of a test's report, also from workers of xdist
_DEFAULT = "runs/*.toml"  # default; then a file must also look like a run
_EXPECTS = re.compile(rb"^[ \t]*\[\[[ \t]*expect[ \t]*\]\]", re.M)
_RIG = re.compile(rb"^[ \t]*rig[ \t]*=", re.M)


class ExpectationError(AssertionError):
    """An expectation that is not met."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the patterns of run files, and the report."""
    help_text = "run files whose expectations are tests: patterns, relative to the root"
    parser.addini("coupled_runs", help_text, type="args", default=None)
    parser.getgroup("coupled").addoption(
        "--coupled-report",
        metavar="FILE.html",
        type=Path,
        help="Write the expectations of run files that failed as one HTML file.",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Prepare the requested report; refuse a file other than HTML before any flight."""
    file: Path | None = config.getoption("coupled_report")
    if file is None or hasattr(config, "workerinput"):  # a worker of xdist
        return
    if file.suffix.lower() not in (".html", ".htm"):
        raise pytest.UsageError(f"--coupled-report: {file} is no HTML file: end its name in .html")
    config.pluginmanager.register(FailureReport(file), "coupled-report")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> RunFile | None:
    """Return a run file that matches a pattern."""
    root = parent.config.rootpath
    if file_path.suffix != ".toml" or not file_path.is_relative_to(root):
        return None
    place, patterns = file_path.relative_to(root).as_posix(), parent.config.getini("coupled_runs")
    if patterns is None:
        wanted = fnmatch(place, _DEFAULT) and _looks_like_a_run(file_path)
    else:
        wanted = any(fnmatch(place, pattern) for pattern in patterns)
    if not wanted:
        return None
    run: RunFile = RunFile.from_parent(parent, path=file_path)
    return run


def _looks_like_a_run(file: Path) -> bool:
    """Return whether a TOML file is a run with expectations, and not another program's."""
    try:
        text = file.read_bytes()
    except OSError:
        return False
    return bool(_RIG.search(text) and _EXPECTS.search(text))


class RunFile(pytest.File):
    """A run file, flown once, when the first of its tests runs."""

    _judged: list[Verdict] | None = None

    def collect(self) -> Iterator[Expectation]:
        """Yield a test for each expectation on each flight."""
        from coupled.campaign.check import expectations_of
        from coupled.errors import InputError
        from coupled.flight.runfile import read_run

        try:
            self.cases = read_run(str(self.path))
        except InputError as error:
            raise self.CollectError("\n".join(map(str, error.every))) from None
        for number, asked in enumerate(expectations_of(self.cases)):
            yield Expectation.from_parent(self, name=_name(asked), number=number)

    def verdict(self, number: int) -> Verdict:
        """Return the verdict on one expectation."""
        from coupled.campaign.check import check_run

        if self._judged is None:
            self._judged = check_run(self.cases)
        return self._judged[number]


def _name(asked: Asked) -> str:
    return f"{asked.scenario.label}: {asked.expect.words} [{asked.configuration}]"


class Expectation(pytest.Item):
    """An expectation on one flight."""

    def __init__(self, *, number: int, **given: Any) -> None:
        super().__init__(**given)
        self.number = number
        self.found: Verdict | None = None

    def runtest(self) -> None:
        """Fly the run, if none of its tests has, and judge the expectation."""
        from coupled.campaign.verdict import verdict_text

        assert isinstance(self.parent, RunFile)
        self.found = self.parent.verdict(self.number)
        if not self.found.passed:
            raise ExpectationError(verdict_text(self.found))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the failure: measured, expected, margin, time and why."""
        from coupled.errors import InputError

        if isinstance(excinfo.value, (ExpectationError, InputError)):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Return the location of the expectation."""
        return self.path, None, f"{self.path.name}: {self.name}"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, Any, None]:
    """Add the verdict to the report of a test."""
    outcome = yield
    if isinstance(item, Expectation) and call.when == "call" and item.found is not None:
        setattr(outcome.get_result(), _JUDGED, dict(vars(item.found)))


class FailureReport:
    """Collects the verdicts of all tests from all processes, and reports the failures."""

    def __init__(self, file: Path) -> None:
        self.file, self.judged = file, list[dict[str, Any]]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Store the verdict of a test."""
        if (judged := getattr(report, _JUDGED, None)) is not None:
            self.judged.append(judged)

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Write the report, and print its path."""
        from coupled.campaign.check import CheckResult
        from coupled.campaign.verdict import Verdict

        if not self.judged:
            terminalreporter.write_line("coupled: no expectation was judged; no report written")
            return
        verdicts = [Verdict(**judged) for judged in self.judged]
        failed = tuple(verdict for verdict in verdicts if not verdict.passed)
        CheckResult(failed, len(verdicts)).report(self.file)
        terminalreporter.write_line(f"coupled report: {self.file}")
