"""Logs of other programs: each format, made by its own library, gives the one record."""

from __future__ import annotations

import importlib.util
import io
import json
import logging
import os
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from mcap.writer import Writer
from nptdms import ChannelObject, TdmsWriter
from scipy import io as scipy_io

from coupled.errors import InputError
from coupled.record.importing import separate
from coupled.record.importing.convert import import_log
from coupled.record.importing.formats import mcap
from coupled.record.importing.formats.warned import kept_warnings
from coupled.record.importing.suggest.propose import propose
from tests.support import formats
from tests.support.commands import coupled
from tests.support.readhere import in_process

N_PER_LBF = 4.4482216152605
ONE = """
[clock]
from = "{time}"
{unit}
[channels.column_force_N]
from = "{force}"
unit = "lbf"
"""
TWO = (
    ONE
    + """
[channels.column_computed_m]
from = "{place}"
unit = "in"
"""
)
SAME_TOPIC = {"force": "/force.data[0]", "place": "/position.data[0]"}
CASES: dict[str, tuple[Callable[[Path], None], dict[str, str]]] = {
    "a.mf4": (formats.write_mdf, {"time": "1.time", "force": "force", "place": "position"}),
    "a.tdms": (formats.write_tdms, {"time": "time", "force": "force", "place": "position"}),
    "json.mcap": (formats.write_mcap_json, {"time": "/force.header.stamp", **SAME_TOPIC}),
    "ros2.mcap": (formats.write_mcap_ros2, {"time": "/force.log_time", **SAME_TOPIC}),
    "pb.mcap": (
        formats.write_mcap_protobuf,
        {
            "time": "/force.log_time",
            "force": "/force.number_value",
            "place": "/position.number_value",
        },
    ),
    "a.ulg": (
        formats.write_ulog,
        {"time": "reading.timestamp", "force": "reading.data[0]", "place": "reading[1].data[0]"},
    ),
}  # fmt: skip


@pytest.fixture
def here() -> Iterator[None]:
    """Read in this process; the separate process of each format is in the first test."""
    with in_process():
        yield


def read(folder: Path, name: str, log_map: str) -> Any:
    (folder / "map.toml").write_text(log_map)
    return import_log(folder / name, folder / "map.toml")


@pytest.mark.parametrize("name", CASES)
def test_two_sensors_with_a_clock_each_lie_on_one_records_frames(tmp_path: Path, name: str) -> None:
    write, columns = CASES[name]
    write(tmp_path / name)
    record, account = read(tmp_path, name, TWO.format(unit="", **columns))
    assert account.clock.method == "rows as they are"
    assert account.clock.frame_rate_Hz == 60.0
    assert 595 <= len(record) <= 600  # as long as both last
    time_s = account.clock.start_s + record.time_s
    force_N = record["column_force_N"] / N_PER_LBF
    np.testing.assert_allclose(force_N, 4.0 * np.sin(time_s), atol=1e-3)
    place_in = record["column_computed_m"] / 0.0254
    np.testing.assert_allclose(place_in, np.sin(time_s), atol=1e-4)  # led over from 80 Hz


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["a.mf4", "a.tdms", "json.mcap", "ros2.mcap"])
def test_a_map_is_proposed_that_has_every_sensor_by_its_clock(tmp_path: Path, name: str) -> None:
    CASES[name][0](tmp_path / name)
    proposal = propose([tmp_path / name])
    assert set(proposal.mapped) == {"column_force_N", "column_deflection_m"}
    stamps = CASES[name][1]["time"]  # of JSON those of the sensors: the recorder's are late
    assert f'[clock]\nfrom = "{stamps}"\nunit = ' in proposal.text


@pytest.mark.usefixtures("here")
def test_a_recorders_stamps_are_proposed_where_a_topic_has_no_other(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        ids = [writer.register_channel(topic, "json", 0) for topic in ("/load", "/grip")]
        for row in range(60):
            ns = 1_770_000_000_000_000_000 + row * 10_000_000
            stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
            sent: dict[str, Any] = {"stamp": stamp, "force_N": np.sin(0.1 * row)}
            for id_, message in zip(ids, (sent, {"pos_m": np.cos(0.1 * row)}), strict=True):
                writer.add_message(id_, ns, json.dumps(message).encode(), ns)
        writer.finish()
    assert '[clock]\nfrom = "/load.log_time"' in propose([tmp_path / "a.mcap"]).text


def write_structs(path: Path, columns: dict[str, dict[str, np.ndarray]]) -> None:
    """Write vectors of two structs or groups, as of a model whose blocks log apart."""
    if path.suffix == ".mat":
        scipy_io.savemat(path, columns)
        return
    with h5py.File(path, "w") as file:
        for struct, each in columns.items():
            for name, values in each.items():
                file[f"{struct}/{name}"] = values


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["a.mat", "a.h5"])
@pytest.mark.parametrize(("late_s", "per_s"), [(0.5, 1.0), (0.0, 1.0), (0.5, 1000.0)])
def test_a_struct_with_times_of_its_own_lies_where_they_say(
    tmp_path: Path, name: str, late_s: float, per_s: float
) -> None:
    time_s = np.arange(600) / 60.0
    load = {"time": per_s * (time_s + late_s), "value": np.sin(time_s + late_s)}
    place = {"time": per_s * time_s, "value": np.cos(time_s)}
    write_structs(tmp_path / name, {"load": load, "place": place})
    unit = 'unit = "ms"' if per_s > 1.0 else ""
    names = {"time": "place.time", "force": "load.value", "place": "place.value"}
    record, account = read(tmp_path, name, TWO.format(unit=unit, **names))
    assert len(record) == 600 - 60 * late_s
    true_s = account.clock.start_s + record.time_s
    np.testing.assert_allclose(record["column_force_N"] / N_PER_LBF, np.sin(true_s), atol=1e-9)
    np.testing.assert_allclose(record["column_computed_m"] / 0.0254, np.cos(true_s), atol=1e-9)


@pytest.mark.usefixtures("here")
def test_dates_of_a_tdms_channel_have_their_unit(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-01-01T00:00:00") + np.arange(600) * np.timedelta64(20, "ms")
    force = np.sin(np.arange(600) / 50.0)
    with TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment([ChannelObject("g", "t", stamps), ChannelObject("g", "F", force)])
    record, _ = read(tmp_path, "a.tdms", ONE.format(time="t", unit="", force="F"))
    np.testing.assert_allclose(record.time_s, np.arange(600) / 50.0, atol=1e-9)
    np.testing.assert_allclose(record["column_force_N"] / N_PER_LBF, force, atol=1e-12)


@pytest.mark.usefixtures("here")
def test_matlab_of_version_7_3_has_the_names_of_its_earlier_ones(tmp_path: Path) -> None:
    formats.write_matlab73(tmp_path / "a.mat")
    maps = [
        ONE.format(time="LOG.time", unit="", force="LOG.force"),
        ONE.format(time="RUN(1).values", unit="", force="RUN(2).values"),
        '[log]\nmatrix = "data"\n' + ONE.format(time="T", unit="", force="F"),
    ]
    for log_map in maps:
        record, _ = read(tmp_path, "a.mat", log_map)
        np.testing.assert_allclose(record["column_force_N"], N_PER_LBF * formats.FORCE_lbf)
    with pytest.raises(InputError, match=r"map.toml: channels.column_force_N.from: a.mat has no"):
        read(tmp_path, "a.mat", ONE.format(time="LOG.time", unit="", force="note"))


@pytest.mark.usefixtures("here")
def test_hdf5_gives_units_and_columns_of_compound_sets(tmp_path: Path) -> None:
    formats.write_hdf5(tmp_path / "a.h5")
    log_map = ONE.format(time="test.clock.T", unit="", force="test.force")
    record, _ = read(tmp_path, "a.h5", log_map.replace('unit = "lbf"', ""))
    np.testing.assert_allclose(record["column_force_N"], N_PER_LBF * formats.FORCE_lbf, atol=1e-5)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("way", ["external", "virtual", "link"])
def test_hdf5_reads_no_other_file_that_it_names(tmp_path: Path, way: str) -> None:
    formats.write_hdf5(tmp_path / "other.h5")
    secret = tmp_path / "secret.bin"
    secret.write_bytes(np.arange(100.0).tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("own", data=np.arange(100.0))
        if way == "external":
            file.create_dataset("T", (100,), "<f8", external=str(secret))
        elif way == "virtual":
            layout = h5py.VirtualLayout((600,), "<f4")
            layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "test/force", (600,))
            file.create_virtual_dataset("T", layout)
        else:
            file["T"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "test/force")
    with pytest.raises(InputError, match=r"clock.from: a\.h5 has no 'T'"):
        read(tmp_path, "a.h5", ONE.format(time="T", unit="", force="own"))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("conversion", "factor"),
    [
        ({"P1": 0.0, "P2": 0.002, "P3": 0.0, "P4": 0.0, "P5": 0.0, "P6": 2.0}, 1.0),
        ({"raw_0": -9e3, "raw_1": 9e3, "phys_0": -9.0, "phys_1": 9.0, "interpolation": True}, 1.0),
    ],
    ids=["rational", "table"],
)  # fmt: skip
def test_mdf_is_converted_as_it_says(
    tmp_path: Path, conversion: dict[str, Any], factor: float
) -> None:
    formats.write_mdf(tmp_path / "a.mf4", conversion)
    record, _ = read(tmp_path, "a.mf4", ONE.format(unit="", **CASES["a.mf4"][1]))
    force_lbf = factor * formats.FORCE_lbf
    np.testing.assert_allclose(record["column_force_N"], N_PER_LBF * force_lbf, atol=3e-3)


@pytest.mark.usefixtures("here")
def test_a_formula_that_mdf_holds_is_not_run(tmp_path: Path) -> None:
    formats.write_mdf(tmp_path / "a.mf4", {"formula": "X * 0.001"})
    with pytest.raises(InputError, match=r"a\.mf4: force: is converted by a formula"):
        read(tmp_path, "a.mf4", ONE.format(unit="", **CASES["a.mf4"][1]))


def test_a_lacking_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pyulog" else there(name)
    )
    (tmp_path / "a.ulg").write_bytes(b"ULog\x01\x12\x35")
    with pytest.raises(InputError, match=r"needs pyulog.*pip install 'coupled\[logs\]'"):
        read(tmp_path, "a.ulg", ONE.format(time="T", unit="", force="F"))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_matlab_objects_are_read_or_refused_by_name(tmp_path: Path, version: str) -> None:
    formats.write_matlab_objects(tmp_path / "a.mat", version)
    for time, force in (
        ("t", "F"),  # plain vectors, as if no object lay beside them
        ("span", "F"),
        ("LOG.runs.When", "LOG.runs.force"),
        ("plain.T", "plain.force"),
    ):
        record, account = read(tmp_path, "a.mat", ONE.format(time=time, unit="", force=force))
        np.testing.assert_allclose(record["column_force_N"], N_PER_LBF * formats.FORCE_lbf)
        assert account.clock.frame_rate_Hz == 60.0
    with pytest.raises(InputError, match=r"a\.mat: LOG.runs.note: holds text or objects"):
        read(tmp_path, "a.mat", ONE.format(time="t", unit="", force="LOG.runs.note"))
    with pytest.raises(InputError, match=r"a\.mat: kinds: is a MATLAB categorical: save it as"):
        read(tmp_path, "a.mat", ONE.format(time="t", unit="", force="kinds"))


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_plain_vectors_beside_objects_need_no_mat_io(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str
) -> None:
    formats.write_matlab_objects(tmp_path / "a.mat", version)
    task = separate.Task("mat" if version == "v7" else "hdf5", "a.mat", "", "signals", [])
    there = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "matio" else there(name)
    )
    table = separate.read_here(task, (tmp_path / "a.mat").read_bytes(), [])
    refused = dict(zip(table["name"], table["refused"], strict=True))
    assert refused["F"] == refused["t"] == refused["LOG.gain"] == ""
    assert refused["LOG.runs"].startswith("is a MATLAB timetable: reading it needs mat-io")
    assert refused["kinds"].startswith("is a MATLAB categorical")


@pytest.mark.usefixtures("here")
def test_a_text_among_an_mdf_channels_numbers_is_refused_unless_it_means_none(
    tmp_path: Path,
) -> None:
    counts = 0.001 * np.rint(1000.0 * formats.FORCE_lbf)
    table = {"val_0": 17, "text_0": b"SNA", "default_addr": {"a": 0.001, "b": 0.0}}
    formats.write_mdf(tmp_path / "a.mf4", table)
    log_map = ONE.format(unit="", **CASES["a.mf4"][1])
    record, _ = read(tmp_path, "a.mf4", log_map)  # no row holds 17
    np.testing.assert_allclose(record["column_force_N"], N_PER_LBF * counts, atol=1e-9)
    table["val_0"] = round(1000.0 * formats.FORCE_lbf[9])
    there = np.rint(1000.0 * formats.FORCE_lbf) != table["val_0"]
    formats.write_mdf(tmp_path / "a.mf4", table)
    with pytest.raises(InputError, match=r'force: row 10 is the text "SNA".*log.missing = \["SNA"'):
        read(tmp_path, "a.mf4", log_map)
    record, account = read(tmp_path, "a.mf4", '[log]\nmissing = ["SNA"]\n' + log_map)
    assert account.channels["column_force_N"].filled_cells == np.count_nonzero(~there)
    np.testing.assert_allclose(record["column_force_N"][there], N_PER_LBF * counts[there])


@pytest.mark.usefixtures("here")
def test_a_formula_behind_a_value_table_is_not_run(tmp_path: Path) -> None:
    table = {"val_0": 17, "text_0": b"SNA", "default_addr": {"formula": "X * 0.001"}}
    formats.write_mdf(tmp_path / "a.mf4", table)
    with pytest.raises(InputError, match=r"a\.mf4: force: is converted by a formula"):
        read(tmp_path, "a.mf4", ONE.format(unit="", **CASES["a.mf4"][1]))


@pytest.mark.usefixtures("here")
def test_a_warning_of_a_reader_library_is_shown_as_one_line(tmp_path: Path) -> None:
    formats.write_tdms(tmp_path / "a.tdms")
    content = bytearray((tmp_path / "a.tdms").read_bytes())
    content[8:12] = (4714).to_bytes(4, "little")  # the version of the format
    (tmp_path / "a.tdms").write_bytes(content)
    _, account = read(tmp_path, "a.tdms", TWO.format(unit="", **CASES["a.tdms"][1]))
    assert account.warnings == ("nptdms warns: Unrecognised version number: 4714",)


@pytest.mark.usefixtures("here")
def test_a_proposal_says_which_columns_are_not_read(tmp_path: Path) -> None:
    scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Reciprocal"}
    with TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment(
            [
                ChannelObject("g", "time", formats.TIME_s),
                ChannelObject("g", "column encoder [mm]", 20.0 * np.sin(formats.TIME_s)),
                ChannelObject("g", "column force [N]", formats.FORCE_lbf, scale),
            ]
        )
    done = coupled(tmp_path, "import", "a.tdms", "--suggest", "m.toml", columns=200)
    assert done.returncode == 0, done.stderr
    assert "column force [N]: npTDMS does not know what its numbers are: Unsuppor" in done.stdout


@pytest.mark.usefixtures("here")
def test_a_ulog_of_which_parts_are_damaged_says_so(tmp_path: Path) -> None:
    formats.write_ulog(tmp_path / "a.ulg")
    content = bytearray((tmp_path / "a.ulg").read_bytes())
    middle = len(content) // 2
    content[middle : middle + 30] = b"\xff" * 30
    (tmp_path / "a.ulg").write_bytes(content)
    _, account = read(tmp_path, "a.ulg", TWO.format(unit="", **CASES["a.ulg"][1]))
    assert any("the file is damaged from byte" in warning for warning in account.warnings)
    formats.write_ulog(tmp_path / "a.ulg")
    _, account = read(tmp_path, "a.ulg", TWO.format(unit="", **CASES["a.ulg"][1]))
    assert account.warnings == ()


@pytest.mark.parametrize("kept", [60, None])
def test_a_ulog_of_which_the_definitions_are_damaged_is_refused(
    tmp_path: Path, kept: int | None
) -> None:
    """Its reader went back from the end of the file for ever, until the time limit of 20 s."""
    formats.write_ulog(tmp_path / "a.ulg")
    content = (tmp_path / "a.ulg").read_bytes()
    (tmp_path / "a.ulg").write_bytes(content[:16] + b"\xff\xff\x7f" + content[19:kept])
    with pytest.raises(InputError, match="is damaged from byte 16 on, before its data"):
        read(tmp_path, "a.ulg", ONE.format(time="T", unit="", force="F"))


def test_warnings_about_the_file_are_kept_and_those_about_code_are_not() -> None:
    notes: list[str] = []
    with kept_warnings(notes):
        warnings.warn("of the file", UserWarning, stacklevel=1)
        warnings.warn("of the code", DeprecationWarning, stacklevel=1)
        logging.getLogger("some.library").warning("logged %d", 7)
        print("printed")
    assert notes == ["logged 7", "of the file", "printed"]


def test_names_above_and_beside_an_array_name_its_elements() -> None:
    message = {
        "joint_names": ["a", "b"],
        "units": ["N", "N"],
        "actual": {"positions": [1.0, 2.0], "all": [5, 6, 7]},
        "each": [
            {"interface_names": ["x", "y"], "values": [10, 11]},
            {"interface_names": ["y", "x"], "values": [21, 20]},
        ],
    }
    file = io.BytesIO()
    writer: Any = Writer(file)
    writer.start()
    schema = writer.register_schema("state", "jsonschema", b"{}")
    channel = writer.register_channel("/arm", "json", schema)
    writer.add_message(channel, 1, json.dumps(message).encode(), 1)
    writer.finish()
    read = mcap.read_mcap(Path("arm.mcap"), file.getvalue())
    found = {each.name.removeprefix("/arm."): each.values[0] for each in read if not each.refused}
    assert found["actual.positions[b]"] == found["actual.positions[1]"] == 2.0
    assert found["each[b].values[x]"] == 20
    assert found["each[0].values[y]"] == 11
    assert found["actual.all[2]"] == 7
    assert "actual.positions[N]" not in found


def read_messages(messages: list[dict[str, Any]], logged_ns: list[int]) -> dict[str, Any]:
    """Return the columns of messages in JSON of one topic, by the names of their fields."""
    file = io.BytesIO()
    writer: Any = Writer(file)
    writer.start()
    schema = writer.register_schema("state", "jsonschema", b"{}")
    channel = writer.register_channel("/arm", "json", schema)
    for message, at_ns in zip(messages, logged_ns, strict=True):
        writer.add_message(channel, at_ns, json.dumps(message).encode(), at_ns)
    writer.finish()
    read = mcap.read_mcap(Path("arm.mcap"), file.getvalue())
    return {each.name.removeprefix("/arm."): each for each in read}


def test_a_stamp_of_s_and_ns_has_its_unit_whatever_its_name() -> None:
    messages = [{"timestamp": {"sec": k, "nsec": 5}, "old": {"stamp": 0.5 * k}} for k in range(3)]
    found = read_messages(messages, [0, 1, 2])
    assert found["timestamp"].values.tolist() == [5, 1_000_000_005, 2_000_000_005]
    assert found["timestamp"].unit == "ns"
    assert found["old.stamp"].unit == ""  # a number, of whatever unit


def test_messages_are_read_in_the_order_of_the_file() -> None:
    """Sorted by a stamp that is wrong, a row lay among others without a word."""
    found = read_messages([{"force": k} for k in range(4)], [10, 20, 5, 40])
    assert found["force"].values.tolist() == [0, 1, 2, 3]
    assert found["log_time"].values.tolist() == [10, 20, 5, 40]


def test_a_text_among_numbers_is_refused_by_its_message() -> None:
    """It was an empty cell, and interpolated."""
    messages: list[dict[str, Any]]
    messages = [{"force": 1.0, "frame": "hand"}, {"force": None}, {"force": "off"}]
    found = read_messages(messages, [1, 2, 3])
    assert found["force"].refused == "message 3 of /arm holds 'off', not a number"
    assert "frame" not in found
    found = read_messages([*messages[:2], {"force": "NaN"}], [1, 2, 3])
    assert not found["force"].refused


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CASES, "a.mat", "a.h5"])
def test_a_broken_log_is_one_line(tmp_path: Path, name: str) -> None:
    write = {"a.mat": formats.write_matlab73, "a.h5": formats.write_hdf5}.get(name)
    (write or CASES[name][0])(tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    noise = np.random.default_rng(1).integers(0, 256, len(whole), dtype=np.uint8).tobytes()
    third = len(whole) // 3
    broken = [whole[:60] + noise[60:], whole[:third], whole[:300] + noise[300:900] + whole[900:]]
    log_map = TWO.format(unit="", **CASES.get(name, CASES["a.mf4"])[1])
    for content in broken:
        (tmp_path / name).write_bytes(content)
        try:
            read(tmp_path, name, log_map)  # what is left of it may do
        except InputError as error:
            assert name in str(error) and "\n" not in str(error) and len(str(error)) < 600


def test_a_broken_log_ends_the_command_with_2_and_nothing_written(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n" + os.urandom(500))
    (tmp_path / "map.toml").write_text(ONE.format(time="T", unit="", force="F"))
    done = coupled(tmp_path, "import", "a.mcap", "--map", "map.toml", "-o", "r.csv")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr == "error: a.mcap: is not an MCAP file, or is damaged\n"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.mcap", "map.toml"]


def test_a_log_that_leads_in_a_circle_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    formats.write_mdf(tmp_path / "a.mf4")
    content = bytearray((tmp_path / "a.mf4").read_bytes())
    first = int.from_bytes(content[64 + 24 : 64 + 32], "little")  # the header's first data group
    content[first + 24 : first + 32] = first.to_bytes(8, "little")  # … whose next is itself
    (tmp_path / "a.mf4").write_bytes(content)
    monkeypatch.setattr(separate, "LONGEST_s", 1.0)
    with pytest.raises(InputError, match=r"not read within 1 s|is damaged"):
        read(tmp_path, "a.mf4", ONE.format(unit="", **CASES["a.mf4"][1]))
