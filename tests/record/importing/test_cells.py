"""Cells that are no plain numbers: elements by name, angles that wrap, decimal commas, dates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy import io as scipy_io

from coupled.errors import InputError
from coupled.record.importing.cells import signed
from coupled.record.importing.convert import import_log
from coupled.record.importing.mapping import Channel
from tests.support.logs import FORCE_N, MAP, ROWS, DEFLECTION_m, TIME_s, imported

JOINTS = """
[clock]
from = "t"
[channels.column_computed_m]
from = "position"
element = {element}
unit = "m"
"""


def joints(turned: bool) -> tuple[list[list[str]], list[list[float]]]:
    """Return the names and the places of two joints, whose order is turned half way."""
    orders = (["grip", "wheel"], ["wheel", "grip"])
    names = [orders[turned and i >= ROWS // 2] for i in range(ROWS)]
    both = {"grip": DEFLECTION_m, "wheel": np.full(ROWS, 0.3)}
    return names, [[float(both[n][i]) for n in row] for i, row in enumerate(names)]


def write(
    folder: Path, form: str, names: Sequence[Sequence[str]], places: list[list[float]]
) -> Path:
    path = folder / f"log.{form}"
    table = pl.DataFrame({"t": TIME_s, "name": names, "position": places})
    if form == "parquet":
        table.write_parquet(path)
    else:
        rows = [
            f'{t!r},"{n}","{p}"' for t, n, p in zip(TIME_s.tolist(), names, places, strict=True)
        ]
        path.write_text("\n".join(["t,name,position", *rows]))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_an_element_is_found_by_its_name_and_its_place_only_where_that_stays(
    tmp_path: Path, form: str
) -> None:
    path, log_map = write(tmp_path, form, *joints(turned=True)), tmp_path / "map.toml"
    log_map.write_text(JOINTS.format(element='"grip"'))
    record, _ = import_log(path, log_map)
    np.testing.assert_array_equal(record["column_computed_m"], DEFLECTION_m)
    log_map.write_text(JOINTS.format(element=1))
    with pytest.raises(InputError, match=r"element 1 is 'grip' in row \d .* element = \"grip\""):
        import_log(path, log_map)
    log_map.write_text(JOINTS.format(element='"gripp"'))
    with pytest.raises(InputError, match=r"has no element 'gripp'; did you mean grip"):
        import_log(path, log_map)
    write(tmp_path, form, *joints(turned=False))
    log_map.write_text(JOINTS.format(element=1))
    record, _ = import_log(path, log_map)
    np.testing.assert_array_equal(record["column_computed_m"], DEFLECTION_m)
    for wrong in ("0", "true", '""', "1.5", "[1]"):
        log_map.write_text(JOINTS.format(element=wrong))
        with pytest.raises(InputError, match=r"element: should be a place from 1 to 10000, or"):
            import_log(path, log_map)


def test_a_name_needs_a_column_of_names(tmp_path: Path) -> None:
    names, places = joints(turned=False)
    path = write(tmp_path, "csv", [["1", "2"] for _ in names], places)
    (tmp_path / "map.toml").write_text(JOINTS.format(element='"grip"'))
    with pytest.raises(InputError, match=r"no column beside it names its elements: .* 1 to 2"):
        import_log(path, tmp_path / "map.toml")


def turned(values: np.ndarray, wraps_at: float, unwrap: bool | None = None) -> np.ndarray:
    channel = Channel(source="x", wraps_at=wraps_at, unwrap=unwrap)
    return signed(values, channel, "log", lambda row: row + 2)


@pytest.mark.parametrize("low", [0.0, -180.0])
def test_an_angle_is_followed_over_more_than_a_turn(low: float) -> None:
    angle = np.linspace(-20.25, 800.5, 400)
    read = np.mod(angle - low, 360.0) + low
    read[7] = np.nan
    found = turned(read, 360.0)
    assert np.isnan(found[7])
    np.testing.assert_allclose(np.delete(found, 7), np.delete(angle, 7), atol=1e-9)


@pytest.mark.parametrize("neutral", [0.0, 90.0, 175.0, 270.0, 359.9, -180.0])
@pytest.mark.parametrize("low", [0.0, -180.0])
def test_an_encoder_is_followed_from_its_own_neutral(neutral: float, low: float) -> None:
    """The map's offset takes the neutral off; nothing moves it by a turn."""
    angle_deg = 30.0 * np.sin(np.arange(300) / 20.0) + 0.4
    read = np.mod(angle_deg + neutral - low, 360.0) + low
    channel = Channel(source="x", wraps_at=360.0, scale=0.5, offset=-0.5 * neutral)
    found = channel.scale * signed(read, channel, "log", lambda row: row) + channel.offset
    np.testing.assert_allclose(found, 0.5 * angle_deg, atol=1e-9)


def test_whole_counts_that_cross_their_half_are_asked_about() -> None:
    angle = np.arange(0, 9000, 100)
    counts = np.mod(angle, 4096).astype(np.float64)
    with pytest.raises(InputError, match=r"row 23 jumps .* unwrap = true .* unwrap = false"):
        turned(counts, 4096.0)
    np.testing.assert_array_equal(turned(counts, 4096.0, unwrap=True), angle)
    assert turned(counts, 4096.0, unwrap=False).min() < -1900.0


def test_an_angle_that_cannot_be_followed_is_refused() -> None:
    with pytest.raises(InputError, match="more than wraps_at = 360"):
        turned(np.array([0.5, 361.0]), 360.0)
    with pytest.raises(InputError, match=r"row 3 is 0.39 of wraps_at from the row before"):
        turned(np.array([0.5, 140.0]), 360.0)


@pytest.mark.parametrize("pattern", ["%d.%m.%Y %H:%M:%S,%f", "iso"])
def test_a_decimal_comma_leaves_dates_as_they_are(tmp_path: Path, pattern: str) -> None:
    rows = []
    for time_s, force, place in zip(TIME_s, FORCE_N, DEFLECTION_m, strict=True):
        clock = f"12:00:{time_s:09.6f}".replace(".", ",")
        date = "01.03.2026" if pattern != "iso" else "2026-03-01"
        numbers = f"{-force / 4.4482216152605:.12g};{place / 0.0254:.12g}".replace(".", ",")
        rows.append(f"{date} {clock};{numbers}")
    log_map = MAP.replace('unit = "ms"', f'date = "{pattern}"')
    log_map = '[log]\ndelimiter = ";"\ndecimal = ","\n' + log_map
    record, _ = imported(tmp_path, "\n".join(["T;F;D", *rows]), log_map)
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-9)


def test_a_column_of_another_clock_is_not_cut_to_this_ones_rows(tmp_path: Path) -> None:
    long = np.repeat(FORCE_N, 2)
    scipy_io.savemat(tmp_path / "log.mat", {"T": 1e3 * TIME_s, "F": long, "D": DEFLECTION_m})
    (tmp_path / "map.toml").write_text(MAP)
    with pytest.raises(InputError, match="F: has 1200 rows, the clock 600"):
        import_log(tmp_path / "log.mat", tmp_path / "map.toml")
