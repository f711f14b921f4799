"""Logs that earlier imports read wrong without a message, or refused without a remedy."""

from __future__ import annotations

import json
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from coupled import InputError, import_log
from coupled.record.record import read_record
from tests.support.commands import coupled
from tests.support.readhere import in_process

CASES = Path(__file__).parents[1] / "data" / "cases"


@pytest.fixture(autouse=True)
def here() -> Iterator[None]:
    """Read in this process."""
    with in_process():
        yield


def taken(folder: Path, case: str) -> Path:
    """Copy the files of a case, and return where they are."""
    for file in (CASES / case).iterdir():
        shutil.copyfile(file, folder / file.name)
    return folder


def imported(folder: Path, log: str, rig: str = "") -> dict[str, np.ndarray]:
    """Import a log by its map, and return the channels of the record."""
    words = ["import", log, "--map", "map.toml", "-o", "r.csv", *(["--rig", rig] if rig else [])]
    done = coupled(folder, *words)
    assert done.returncode == 0, done.stderr
    record = read_record(folder / "r.csv")
    return {name: record[name] for name in record.channels}


def refused(folder: Path, log: str) -> str:
    """Import a log that is refused, and return the one line; nothing is written."""
    before = sorted(folder.iterdir())
    done = coupled(folder, "import", log, "--map", "map.toml", "-o", "r.csv")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert sorted(folder.iterdir()) == before
    return done.stderr


def remapped(folder: Path, *edits: tuple[str, str]) -> None:
    """Change the map."""
    text = (folder / "map.toml").read_text()
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    (folder / "map.toml").write_text(text)


def column(folder: Path, place: int) -> np.ndarray:
    """Return a column of the log in a case's CSV, counted from 0."""
    return np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1, usecols=place)


def test_a_clock_that_goes_back_is_named_and_its_remedy_works(tmp_path: Path) -> None:
    folder = taken(tmp_path, "clock-goes-back")
    said = refused(folder, "log.csv")
    assert "log.csv: t: row 121: time goes back" in said
    assert "wraps_at = N" in said
    assert 'drop_rows = ["121-240"]' in said
    assert "sort" not in said
    remapped(folder, ("[clock]", "[clock]\nsort = true"))  # leaves a gap of minutes
    assert "rows are missing" in refused(folder, "log.csv")
    remapped(folder, ("sort = true", "wraps_at = 160"))
    record = imported(folder, "log.csv")
    np.testing.assert_array_equal(record["column_force_N"], column(folder, 1))
    remapped(folder, ("wraps_at = 160", 'drop_rows = ["121-240"]'))
    record = imported(folder, "log.csv")
    np.testing.assert_array_equal(record["column_force_N"], column(folder, 1)[:119])


def test_sorting_does_not_mix_a_clock_that_was_set_back(tmp_path: Path) -> None:
    folder = taken(tmp_path, "clock-goes-back")
    head, *rows = (folder / "log.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    start = float(cells[60][0]) + 0.004
    again = [f"{start + i / 120:.6f},{','.join(row[1:])}" for i, row in enumerate(cells[:60])]
    (folder / "log.csv").write_text("\n".join([head, *rows[:119], *again]))
    remapped(folder, ("[clock]", "[clock]\nsort = true"))
    assert 'clock.drop_rows = ["121-180"]' in refused(folder, "log.csv")
    remapped(folder, ("sort = true", 'drop_rows = ["121-180"]'))
    assert len(imported(folder, "log.csv")["time_s"]) == 119


def test_a_row_that_is_there_twice_is_dropped_on_request(tmp_path: Path) -> None:
    folder = taken(tmp_path, "duplicate-row")
    said = refused(folder, "log.csv")
    assert "row 121 repeats the time" in said
    assert "clock.drop_duplicates = true" in said
    remapped(folder, ("[clock]", "[clock]\ndrop_duplicates = true"))
    record = imported(folder, "log.csv")
    np.testing.assert_array_equal(record["column_force_N"], np.delete(column(folder, 1), 119))


def test_an_angle_that_wraps_is_followed(tmp_path: Path) -> None:
    folder = taken(tmp_path, "encoder-0-360")
    read = column(folder, 3)
    assert np.ptp(read) > 350.0
    turned_deg = np.where(read > 180.0, read - 360.0, read)
    scale = 0.010471975511965978
    record = imported(folder, "log.csv")
    np.testing.assert_allclose(record["column_deflection_m"], scale * turned_deg, atol=1e-12)
    assert np.ptp(record["column_deflection_m"]) < 0.04


def test_a_column_of_two_of_one_name_can_be_named(tmp_path: Path) -> None:
    folder = taken(tmp_path, "same-name-twice")
    assert 'give from = "Pos#1" or "Pos#2"' in refused(folder, "log.csv")
    text = (folder / "map.toml").read_text().replace('"Pos"', '"Pos#1"', 1)
    (folder / "map.toml").write_text(text.replace('"Pos"', '"Pos#2"'))
    record = imported(folder, "log.csv")
    np.testing.assert_array_equal(record["column_computed_m"], column(folder, 2))
    np.testing.assert_array_equal(record["column_deflection_m"], column(folder, 3))


def test_joints_whose_order_changes_are_read_by_name(tmp_path: Path) -> None:
    folder = taken(tmp_path, "joint-order")
    said = refused(folder, "log.mcap")
    assert "/joint_states.effort[0]: is column in one message and wheel in another" in said
    assert "give it by its name, as /joint_states.effort[column]" in said
    remapped(folder, ("[0]", "[column]"))
    record = imported(folder, "log.mcap")
    assert np.max(np.abs(record["column_deflection_m"])) < 0.02  # the wheel stands at 0.3
    assert np.max(np.abs(np.diff(record["column_deflection_m"]))) < 1e-3


def test_the_rule_behind_a_value_table_is_used(tmp_path: Path) -> None:
    record = imported(taken(tmp_path, "mdf-value-table"), "log.mf4")
    force_N = record["column_force_N"]  # 0.1·n − 400, by its default conversion
    assert force_N[0] == pytest.approx(0.1 * 4001 - 400.0, abs=1e-9)
    np.testing.assert_allclose(10.0 * force_N, np.rint(10.0 * force_N), atol=1e-6)
    assert np.max(np.abs(force_N)) < 50.0


def test_a_scale_that_the_library_does_not_know_is_refused(tmp_path: Path) -> None:
    said = refused(taken(tmp_path, "tdms-unknown-scale"), "log.tdms")
    assert "log.tdms: F: " in said
    assert "Unsupported scale type: Reciprocal" in said


def test_a_grip_is_not_taken_for_the_actuator(tmp_path: Path) -> None:
    folder = taken(tmp_path, "suggest-exchanged")
    done = coupled(folder, "import", "run17_friction.csv", "--suggest", "m.toml")
    assert done.returncode == 0, done.stderr
    channels = tomllib.loads((folder / "m.toml").read_text())["channels"]
    assert channels["column_computed_m"]["from"] == "Act Pos (in)"
    assert channels["column_deflection_m"]["from"] == "Grip LVDT (in)"
    remapped(folder, ('"?"', "-1"))  # the exchanged map, its question answered
    done = coupled(folder, "import", "run17_friction.csv", "--map", "map.toml", "-o", "r.csv")
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.replace("│", " ").split())
    assert "falls short of" in said
    assert "exchanged, or a scale?" in said


@pytest.mark.slow
def test_a_bench_with_one_gradient_needs_no_dynamic_pressure(tmp_path: Path) -> None:
    folder = taken(tmp_path, "bench-without-pressure")
    imported(folder, "log.csv", rig="rig.toml")
    done = coupled(folder, "diagnose", "r.csv", "--rig", "rig.toml", "--control", "wheel")
    assert done.returncode == 0, done.stderr
    assert "Coulomb friction" in done.stdout


@pytest.mark.parametrize("name", ["rep.csv", "dates.parquet"])
def test_stamps_that_stand_still_are_no_clock(tmp_path: Path, name: str) -> None:
    folder = taken(tmp_path, "robust-06")
    done = coupled(folder, "import", name, "--suggest", "m.toml")
    assert done.returncode == 0, done.stderr
    assert tomllib.loads((folder / "m.toml").read_text())["clock"] == {"rate_Hz": "?"}


def test_a_column_of_nested_lists_is_refused(tmp_path: Path) -> None:
    folder = taken(tmp_path, "robust-06")
    done = coupled(folder, "import", "nested.parquet", "--suggest", "m.toml")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    shutil.copyfile(folder / "m-nested.toml", folder / "map.toml")
    remapped(folder, ('element = "?"', "element = 1"))
    assert "force_lbf: holds List(List(Float64))" in refused(folder, "nested.parquet")


# Of the same kinds, in other forms


COLUMNS = ("F", "DC", "D", "Q")
RATE_Hz, ROWS = 200.0, 400


def pulled() -> dict[str, np.ndarray]:
    """Return time, force, computed deflection, deflection and dynamic pressure of a slow pull."""
    time_s = np.arange(ROWS) / RATE_Hz
    force_N = 25.0 * np.sin(4.0 * time_s)
    computed_m = force_N / 1500.0
    return {
        "t": time_s,
        "F": force_N,
        "DC": computed_m,
        "D": computed_m + 2e-5 * force_N,
        "Q": np.full(ROWS, 3000.0),
    }


def mapped(folder: Path, clock: str = "", more: str = "", **source: str) -> None:
    """Write a map; `source` gives a column's name, `<name>_more` further keys of its channel."""
    names = ("pedals_force_N", "pedals_computed_m", "pedals_deflection_m", "dynamic_pressure_Pa")
    text = f'{more}[clock]\nfrom = "{source.get("t", "t")}"\n{clock}'
    for column_, name in zip(COLUMNS, names, strict=True):
        unit = name.rpartition("_")[2]
        text += f'\n[channels.{name}]\nfrom = "{source.get(column_, column_)}"\nunit = "{unit}"\n'
        text += source.get(f"{column_}_more", "")
    (folder / "map.toml").write_text(text)


def csv(folder: Path, columns: dict[str, np.ndarray], units: str = "") -> None:
    rows = [",".join(f"{x:.9g}" for x in row) for row in zip(*columns.values(), strict=True)]
    head = [",".join(columns), *([units] if units else [])]
    (folder / "log.csv").write_text("\n".join([*head, *rows]))


def test_times_in_a_unit_that_nobody_gave_are_refused(tmp_path: Path) -> None:
    """Of a clock in ns, read as s, the rows would come at 2e-7 Hz."""
    csv(tmp_path, {**pulled(), "t": np.arange(ROWS) * 5e6})
    mapped(tmp_path)
    assert "its rows come at 2e-07 Hz" in refused(tmp_path, "log.csv")
    mapped(tmp_path, clock='unit = "ns"\n')
    assert len(imported(tmp_path, "log.csv")["time_s"]) == ROWS


def test_a_clock_whose_unit_is_none_of_time_is_refused(tmp_path: Path) -> None:
    csv(tmp_path, pulled(), units="ticks,N,m,m,Pa")
    mapped(tmp_path, more="[log]\nunits_row = true\n")
    assert "t: the log states 'ticks', no unit of time; give clock.unit" in refused(
        tmp_path, "log.csv"
    )


def test_a_point_beside_a_decimal_comma_is_refused(tmp_path: Path) -> None:
    """3.000 in a German log is three thousand."""
    lines = ["t;F;DC;D;Q", *(f"{i / 100:.2f};1,5;0,01;0,01;".replace(".", ",") for i in range(50))]
    (tmp_path / "log.csv").write_text("3.000\n".join(lines).replace("Q3.000", "Q") + "3.000")
    mapped(tmp_path, more='[log]\ndelimiter = ";"\ndecimal = ","\n')
    assert "Q: row 2 holds '3.000'; log.decimal is a comma" in refused(tmp_path, "log.csv")


def test_an_angle_by_a_wrong_period_is_refused(tmp_path: Path) -> None:
    columns = pulled()
    counts = np.round(columns["DC"] * 1e4) % 4000
    csv(tmp_path, {**columns, "DC": counts})
    keys = "scale = 1e-4\nunwrap = true\nwraps_at = "
    mapped(tmp_path, DC_more=f"{keys}4096\n")
    assert "crosses wraps_at = 4096 by" in refused(tmp_path, "log.csv")
    mapped(tmp_path, DC_more=f"{keys}4000\n")
    found = imported(tmp_path, "log.csv")["pedals_computed_m"]
    np.testing.assert_allclose(found, columns["DC"], atol=0.51e-4)


def test_an_angle_that_starts_again_is_in_doubt(tmp_path: Path) -> None:
    columns = pulled()
    csv(tmp_path, {**columns, "DC": columns["DC"] % 0.4})
    mapped(tmp_path)
    done = coupled(tmp_path, "import", "log.csv", "--map", "map.toml", "-o", "r.csv")
    assert "jumps over its whole range" in " ".join(done.stdout.split())


def test_packed_numbers_of_hdf5_are_unpacked(tmp_path: Path) -> None:
    """By the conventions of netCDF: scale, offset, and the number that means none."""
    h5py = pytest.importorskip("h5py")
    columns = pulled()
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values in columns.items():
            file[name] = values
        del file["F"]
        counts = np.round((columns["F"] + 400.0) / 0.1).astype("u2")
        counts[7] = 65535
        file["F"] = counts
        file["F"].attrs.update({"scale_factor": 0.1, "add_offset": -400.0, "_FillValue": 65535})
    mapped(tmp_path)
    found = imported(tmp_path, "log.h5")["pedals_force_N"]
    np.testing.assert_allclose(found, columns["F"], atol=0.051)


def test_samples_that_an_mdf_calls_invalid_are_empty(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    columns = pulled()
    invalid = np.zeros(ROWS, dtype=bool)
    invalid[70:72] = True
    wrong = np.where(invalid, 9999.0, columns["F"])
    signals = [
        asammdf.Signal(wrong, columns["t"], name="F", invalidation_bits=invalid),
        *(asammdf.Signal(columns[name], columns["t"], name=name) for name in COLUMNS[1:]),
    ]
    with asammdf.MDF() as file:
        file.append(signals)
        file.save(tmp_path / "log.mf4")
    mapped(tmp_path, t="time")
    found = imported(tmp_path, "log.mf4")["pedals_force_N"]
    np.testing.assert_allclose(found, columns["F"], atol=0.01)


@pytest.mark.parametrize("form", ["objects", "identifiers"])
def test_joints_that_change_places_are_read_by_name(tmp_path: Path, form: str) -> None:
    """Each joint an object with its name, or numbers beside a list of identifiers."""
    writing = pytest.importorskip("mcap.writer")
    columns = pulled()
    with (tmp_path / "log.mcap").open("wb") as file:
        writer = writing.Writer(file)
        writer.start()
        schema = writer.register_schema("joints", "jsonschema", b"{}")
        channel = writer.register_channel("/j", "json", schema)
        for row in range(ROWS):
            motor, grip = columns["DC"][row], columns["D"][row]
            joints = [(1, columns["F"][row], motor), (2, 0.0, grip)][:: 1 if row % 3 else -1]
            message: dict[str, object] = {"t": columns["t"][row], "Q": 3000.0}
            if form == "objects":
                message["x"] = [{"name": f"j{i}", "f": f, "p": p} for i, f, p in joints]
            else:
                ids, forces, places = zip(*joints, strict=True)
                message["x"] = {"ids": ids, "f": forces, "p": places}
            writer.add_message(channel, row, json.dumps(message).encode(), row)
        writer.finish()
    by_place, by_name = ("x[{0}].{1}", "x[j{0}].{1}")
    if form == "identifiers":
        by_place, by_name = ("x.{1}[{0}]", "x.{1}[id {0}]")
    place = {"DC": by_place.format(0, "p"), "D": by_place.format(1, "p")}
    mapped(tmp_path, t="/j.t", F=f"/j.{by_place.format(0, 'f')}", Q="/j.Q", **place)
    said = refused(tmp_path, "log.mcap")
    assert "in one message and" in said
    assert f"as /j.{by_name.format(2, 'f')}" in said
    named = {"DC": f"/j.{by_name.format(1, 'p')}", "D": f"/j.{by_name.format(2, 'p')}"}
    mapped(tmp_path, t="/j.t", F=f"/j.{by_name.format(1, 'f')}", Q="/j.Q", **named)
    found = imported(tmp_path, "log.mcap")
    np.testing.assert_allclose(found["pedals_computed_m"], columns["DC"], atol=1e-12)
    np.testing.assert_allclose(found["pedals_deflection_m"], columns["D"], atol=1e-12)


def test_a_map_of_no_log_is_refused() -> None:
    with pytest.raises(InputError, match="import_log: log: is empty"):
        import_log([], "map.toml")


def raw_counts(folder: Path, form: str) -> tuple[str, dict[str, np.ndarray]]:
    """Write forces as counts of 0.1 N above −400 N, with that scaling in attributes of a tool."""
    columns = pulled()
    counts = np.round((columns["F"] + 400.0) / 0.1)
    scaling = {"Gain": 0.1, "Offset": -400.0}
    if form == "hdf5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(folder / "log.h5", "w") as file:
            file.update({**columns, "F": counts})
            file["F"].attrs.update(scaling)
            file["D"].attrs.update({"scale": 1.0, "offset": 0.0})
        return "log.h5", columns
    nptdms = pytest.importorskip("nptdms")
    written = {**columns, "F": counts}
    channels = [
        nptdms.ChannelObject("g", name, values, scaling if name == "F" else {})
        for name, values in written.items()
    ]
    with nptdms.TdmsWriter(str(folder / "log.tdms")) as writer:
        writer.write_segment(channels)
    return "log.tdms", columns


@pytest.mark.parametrize("form", ["hdf5", "tdms"])
def test_a_scaling_that_no_reader_applies_is_decided_in_the_map(tmp_path: Path, form: str) -> None:
    log, columns = raw_counts(tmp_path, form)
    mapped(tmp_path)
    said = refused(tmp_path, log)
    assert f"{log}: F: the file gives Gain = 0.1, Offset = -400" in said
    assert "give channels.pedals_force_N.scale and offset" in said
    mapped(tmp_path, F_more="scale = 0.1\noffset = -400.0\n")
    force_N = imported(tmp_path, log)["pedals_force_N"]
    np.testing.assert_allclose(force_N, columns["F"], atol=0.051)


def test_numbers_outside_the_valid_range_of_netcdf_are_empty(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    columns = pulled()
    counts = np.round(columns["F"] * 100.0).astype("i2")
    counts[70:72] = 9999
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.update({**columns, "F": counts})
        file["F"].attrs.update({"scale_factor": 0.01, "valid_range": np.array([-8000, 8000], "i2")})
    mapped(tmp_path)
    found = imported(tmp_path, "log.h5")["pedals_force_N"]
    np.testing.assert_allclose(found, columns["F"], atol=0.02)


@pytest.mark.parametrize(
    ("force", "said"),
    [
        (np.ones((ROWS, 2)), "holds an array of 400 x 2 numbers, no vector"),
        (1j * np.ones((ROWS, 1)), "holds complex numbers"),
    ],
)
@pytest.mark.parametrize("form", ["mat", "h5"])
def test_a_variable_that_is_no_vector_is_refused_by_its_kind(
    tmp_path: Path, form: str, force: np.ndarray, said: str
) -> None:
    """The message was that the log has no such variable."""
    columns = {**pulled(), "F": force}
    if form == "mat":
        scipy_io = pytest.importorskip("scipy.io")
        scipy_io.savemat(tmp_path / "log.mat", columns)
    else:
        with pytest.importorskip("h5py").File(tmp_path / "log.h5", "w") as file:
            file.update(columns)
    mapped(tmp_path)
    assert f"log.{form}: F: {said}" in refused(tmp_path, f"log.{form}")


def test_a_true_among_numbers_is_no_number(tmp_path: Path) -> None:
    each = zip(*pulled().values(), strict=True)
    rows = [dict(zip(pulled(), map(float, row), strict=True)) for row in each]
    rows[30]["F"] = True
    (tmp_path / "log.json").write_text(json.dumps(rows))
    mapped(tmp_path)
    assert "log.json: F: row 31 holds 'true', which is no number" in refused(tmp_path, "log.json")


def test_a_clock_of_unsigned_integers_beyond_those_with_a_sign_is_read(tmp_path: Path) -> None:
    columns = pulled()
    count = [2**63 + round(1e9 * t) for t in columns["t"].tolist()]
    table = pl.DataFrame({**columns, "t": pl.Series(count, dtype=pl.UInt64)})
    table.write_parquet(tmp_path / "log.parquet")
    mapped(tmp_path, clock='unit = "ns"\n')
    found = imported(tmp_path, "log.parquet")
    np.testing.assert_allclose(found["time_s"], columns["t"], atol=1e-9)


def test_days_without_a_year_include_the_29th_of_february(tmp_path: Path) -> None:
    columns = pulled()
    csv(tmp_path, columns)
    head, *rows = (tmp_path / "log.csv").read_text().splitlines()
    stamps = [
        f"28/02 23:59:{59 + t:.3f}" if t < 1.0 else f"29/02 00:00:{t - 1.0:06.3f}"
        for t in columns["t"].tolist()
    ]
    text = [f"{stamp},{row.partition(',')[2]}" for stamp, row in zip(stamps, rows, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join([head, *text]))
    mapped(tmp_path, clock='date = "%d/%m %H:%M:%S.%f"\n')
    assert len(imported(tmp_path, "log.csv")["time_s"]) == ROWS
