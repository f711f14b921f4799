"""A real browser without a window: a page's console messages and its print."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
PAPERS = {"A4": (595, 842), "Letter": (612, 792)}  # points


def printed(page: Path, paper: str) -> tuple[Path, list[str]]:
    """Print a page on a paper size; return the PDF and the browser's messages."""
    assert CHROMIUM is not None
    sized = page.with_name(f"{page.stem}-{paper}.html")
    text = page.read_text(encoding="utf-8")
    sized.write_text(text.replace("</head>", f"<style>@page{{size:{paper}}}</style></head>"))
    target = sized.with_suffix(".pdf")
    done = subprocess.run(
        [
            CHROMIUM,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            f"--user-data-dir={page.parent / 'profile'}",
            "--enable-logging=stderr",
            "--no-pdf-header-footer",
            f"--print-to-pdf={target}",
            sized.as_uri(),
        ],
        check=True,
        capture_output=True,
        text=True,
        timeout=120,
    )
    return target, [line for line in done.stderr.splitlines() if "CONSOLE" in line]
