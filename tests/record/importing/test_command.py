"""`coupled import`: the record, the doubts it prints, and wrong arguments."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from coupled.cli import app
from coupled.errors import InputError
from coupled.record.record import read_record
from tests.support.commands import coupled
from tests.support.logs import (
    FORCE_N,
    MAP,
    ROWS,
    edited,
    imported,
)


def test_the_command_writes_a_record_and_prints_its_doubts(tmp_path: Path) -> None:
    imported(tmp_path)
    (tmp_path / "a").mkdir()
    done = coupled(tmp_path, "import", "log.csv", "--map", "map.toml", "-o", "a/r.csv")
    assert done.returncode == 0, done.stderr
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    assert "evenly spaced, not interpolated" in done.stdout
    np.testing.assert_allclose(read_record(tmp_path / "a/r.csv")["column_force_N"], FORCE_N)
    manifest = json.loads((tmp_path / "a/r.manifest.json").read_text())
    assert set(manifest["inputs_sha256"]) == {"log.csv", "map.toml"}
    assert manifest["map"]["channels"]["column_force_N"]["sign"] == -1
    assert manifest["import"]["clock"]["frames"] == ROWS
    (tmp_path / "log.csv").write_text(edited(7, "20,1,1"))
    bad = coupled(tmp_path, "import", "log.csv", "--map", "map.toml", "-o", "b.csv")
    assert (bad.returncode, bad.stdout, bad.stderr.count("\n")) == (2, "", 1)
    assert bad.stderr.startswith("error: log.csv: T: row 8: time goes back")
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize(
    "words",
    [
        ["log.csv", "--map", "map.toml", "-o", "log.csv"],
        ["log.csv", "--map", "map.toml", "-o", "link.csv"],
        ["log.csv", "--map", "map.toml", "-o", "r.xls"],
        ["log.csv", "--map", "map.toml", "-o", "log.csv/r.csv"],
        ["log.csv", "--map", "map.toml", "--json", "map.toml"],
        ["log.csv", "--map", "map.toml", "-o", "r.csv", "--json", "r.manifest.json"],
        ["log.csv", "--map", "map.toml", "--rig", "nothing"],
        ["log.csv", "--map", "none.toml"],
        ["log.csv", "--map", "log.csv"],
        ["none.csv", "--map", "map.toml"],
        [".", "--map", "map.toml"],
        ["folder.csv", "--map", "map.toml"],
        ["a" * 5000 + ".csv", "--map", "map.toml"],
        ["/dev/zero", "--map", "dev.toml"],
    ],
    ids=lambda words: " ".join(words)[:40],
)
def test_wrong_arguments_write_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    imported(tmp_path)
    (tmp_path / "dev.toml").write_text('log.format = "csv"\n' + MAP)
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "log.csv")
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        app(["import", *words], standalone_mode=False)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


def test_the_map_of_the_manual_reads_the_log_that_it_describes(tmp_path: Path) -> None:
    manual = (Path(__file__).parents[3] / "docs" / "files.md").read_text(encoding="utf-8")
    log_map = manual.partition("## Map of a log")[2].partition("```toml\n")[2].partition("```")[0]
    time = np.arange(1200) / 120.0
    late = np.sin(time - 0.004)
    lines = ["# test 7", "TIME;FORCE_LB;COL_IN;GRIP;QBAR;NOTE", "ms;lbf;in;;psf;"]
    for k, t in enumerate(time):
        counts = 2048 + 409.6 * np.sin(t)
        pressure = "" if k % 10 and k != len(time) - 1 else "20.9"
        row = f"{1000 * t:.3f};{-late[k]:.9f};{np.sin(t):.9f};{counts:.6f};{pressure};ok"
        lines.append(row.replace(".", ","))
    record, account = imported(tmp_path, "\r\n".join(lines), log_map)
    signal = np.sin(record.time_s)
    np.testing.assert_allclose(record["column_force_N"], 4.4482216152605 * signal, atol=2e-4)
    np.testing.assert_allclose(record["column_computed_m"], 0.0254 * signal, atol=1e-9)
    np.testing.assert_allclose(record["column_deflection_m"], 0.0254 * signal, atol=1e-8)
    np.testing.assert_allclose(record["dynamic_pressure_Pa"], 20.9 * 47.88025898)
    assert account.unmapped == ("NOTE",)
    assert account.channels["dynamic_pressure_Pa"].filled_cells > 1000
