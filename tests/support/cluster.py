"""A dask cluster on this machine, in separate processes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CLUSTER = """
import logging, sys
from distributed import LocalCluster
if __name__ == "__main__":
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    workers = int(sys.argv[1])
    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[str]:
    (folder / "cluster.py").write_text(CLUSTER)
    process: subprocess.Popen[str] = subprocess.Popen(
        [sys.executable, "cluster.py", str(workers)],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    pipes: Any = process
    try:
        yield pipes.stdout.readline().strip()
    finally:
        process.communicate(timeout=30)
