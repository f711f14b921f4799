"""Settings of all tests: the number of workers, and one thread for each."""

from __future__ import annotations

import gc
import os
from collections.abc import Generator

import pytest
from hypothesis import settings

# A machine that does other work is no fault of the code: the suite's own time is watched instead.
# In CI one commit has one verdict; a developer's runs draw new examples each time.
settings.register_profile("coupled", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("coupled")

WORKER = os.environ.get("PYTEST_XDIST_WORKER")
if WORKER:
    # A worker has one core: threads of linear algebra, and processes beside it, would fight for it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("PYTHON_CPU_COUNT", "1")

MOST_WORKERS = 4


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return the number of workers: one per core for the whole suite, none for a part of it.

    Nor do benchmarks: what runs beside a measurement is measured, too.
    """
    chosen = config.args_source is not pytest.Config.ArgsSource.TESTPATHS
    measuring = config.option.markexpr == "bench"
    if chosen or measuring or config.option.keyword or config.option.capture == "no":
        return 0
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return min(MOST_WORKERS, cores or 1)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect tests without garbage collection, a fifth of the time: all that is made is kept."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
