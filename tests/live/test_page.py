"""The page in a real Chromium: it draws, its switches act, it saves, and the diagnosis comes.

Needs Debian's chromium and playwright; where one lacks, these are skipped.
"""

from __future__ import annotations

import http.client
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from coupled.record.record import read_record

ROOT = Path(__file__).parents[2]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.slow


@contextmanager
def flown(folder: Path, *words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Fly live with a page; yield the process and the page's address."""
    pytest.importorskip("uvicorn")
    command = [sys.executable, "-u", "-m", "coupled", "live", *words, "--dashboard"]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, cwd=folder, env=env, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        url = process.stdout.readline().removeprefix("page: ").strip()
        assert url.startswith("http://127.0.0.1:")
        yield process, url
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


@contextmanager
def opened(url: str) -> Iterator[tuple[Any, list[str]]]:
    """Open an address in Chromium; yield the page, and what went wrong on it."""
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("no chromium")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page, wrong = browser.new_page(viewport={"width": 1280, "height": 900}), []
        page.on("console", lambda message: wrong.append(message.text))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda asked: wrong.append(asked.url) if alien(asked.url, url) else None)
        page.goto(url)
        yield page, wrong
        browser.close()


def alien(asked: str, url: str) -> bool:
    """Return whether a request goes to another host."""
    return not asked.startswith("data:") and urlsplit(asked).netloc != urlsplit(url).netloc


def number(page: Any, name: str) -> float:
    """Return a number of the list `Now`, by its name."""
    text = page.locator(f"#now dt:text-is('{name}') + dd").inner_text()
    return float(text.replace("−", "-").split()[0])


def test_a_flight_by_the_page_s_own_hand(tmp_path: Path) -> None:
    words = ("--rig", "report-column", "-o", "flown.csv")
    with flown(tmp_path, *words) as (process, url), opened(url) as (page, wrong):
        page.wait_for_selector("#phase:text-is('flying')", timeout=120_000)
        pad = page.locator("#pad").bounding_box()
        page.mouse.move(pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2)
        page.mouse.down()
        page.mouse.move(pad["x"] + pad["width"] / 2, pad["y"] + 0.6 * pad["height"], steps=10)
        page.wait_for_timeout(3000)
        held, before = number(page, "deflection δ"), number(page, "force F")
        assert held == pytest.approx(0.2 * 177.8, rel=0.05)
        assert abs(number(page, "authority lost now")) < 1.0
        page.evaluate("document.getElementById('switch-deflection').click()")
        page.wait_for_timeout(2000)
        assert number(page, "authority lost now") > 10.0
        page.evaluate("document.getElementById('switch-gradient').click()")
        page.wait_for_timeout(2000)
        assert number(page, "force F") < 0.9 * before  # the switch changes what is felt
        page.mouse.up()
        drawn = (
            "c => [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data].some(v => v)"
        )
        assert page.locator("#loop").evaluate(drawn)
        assert page.locator("#history canvas").evaluate(drawn)
        page.click("#save")
        page.click("#mark")
        page.wait_for_timeout(7000)
        page.click("#stop")
        page.wait_for_selector("#verdict", timeout=120_000)
        for wide in (1280, 390):
            page.set_viewport_size({"width": wide, "height": 900})
            over = page.evaluate("document.documentElement.scrollWidth - innerWidth")
            assert over <= 0, wide
        page.click("#leave")
        assert process.wait(20.0) == 0
        assert wrong == []
    record = read_record(tmp_path / "flown.csv")
    assert len(read_record(tmp_path / "flown-so-far.csv")) < len(record)
    live = record.manifest["live"]
    assert [change["what"] for change in live["switched"]] == ["deflection", "gradient"]
    assert len(live["marks"]) == 1


def test_the_flight_goes_on_without_its_page(tmp_path: Path) -> None:
    words = ("tracking", "--duration", "8", "-o", "r.csv")
    with flown(tmp_path, *words) as (process, url):
        port = urlsplit(url).port
        found = subprocess.run(
            ["pgrep", "-P", str(process.pid)], capture_output=True, text=True, check=False
        ).stdout.split()
        assert found, port
        for child in found:
            subprocess.run(["kill", "-9", child], check=False)
        assert process.wait(150.0) == 0
    assert len(read_record(tmp_path / "r.csv")) == 960


def test_requests_of_another_origin_are_refused(tmp_path: Path) -> None:
    with flown(tmp_path, "tracking") as (_, url):
        place = urlsplit(url)

        def status(path: str, **headers: str) -> int:
            line = http.client.HTTPConnection("127.0.0.1", place.port or 0, timeout=5.0)
            line.request(
                "GET", path, headers={name.replace("_", "-"): v for name, v in headers.items()}
            )
            code = line.getresponse().status
            line.close()
            return code

        good = f"/?{place.query}"
        assert status(good) == 200
        assert status("/") == 403
        assert status("/?token=wrong") == 403
        assert status(good, Host="evil.example:80") == 403
        assert status(f"/../../pyproject.toml?{place.query}") == 404
        upgrade = {
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
            "Sec_WebSocket_Version": "13",
        }
        own = f"http://127.0.0.1:{place.port}"
        assert status(f"/ws?{place.query}", Origin="http://evil.example", **upgrade) == 403
        assert status(f"/ws?{place.query}", **upgrade) == 403
        assert status("/ws?token=wrong", Origin=own, **upgrade) == 403
        assert status(f"/ws?{place.query}", Origin=own, **upgrade) == 101


def test_a_flight_of_a_given_length_ends_with_its_page_open(tmp_path: Path) -> None:
    with flown(tmp_path, "--rig", "report-column", "--duration", "0.5") as (process, _):
        assert process.wait(240.0) == 0
    assert (tmp_path / "out" / "report-column-live.csv").is_file()
