"""A test with two sensors with separate clocks, logged in each format by its own library."""

from __future__ import annotations

import importlib
import json
import struct
import warnings
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from asammdf import MDF, Signal
from google.protobuf.struct_pb2 import Struct
from mcap.writer import Writer
from mcap_protobuf.writer import Writer as Protobuf
from mcap_ros2.writer import Writer as Ros2
from nptdms import ChannelObject, TdmsWriter

TIME_s = np.arange(600) / 60.0
LATER_s = 0.005 + np.arange(800) / 80.0  # sample times of the second sensor
FORCE_lbf = 4.0 * np.sin(TIME_s)
DEFLECTION_in = np.sin(LATER_s)


def write_mdf(path: Path, conversion: dict[str, Any] | None = None) -> None:
    """Write two groups, each with its master; a `conversion` turns counts of `force` into lbf."""
    counts = np.rint(1000.0 * FORCE_lbf).astype(np.int32)
    conversion = conversion or {"a": 0.001, "b": 0.0}
    with MDF(version="4.10") as mdf:
        mdf.append([Signal(counts, TIME_s, name="force", unit="lbf", conversion=conversion)])
        mdf.append([Signal(DEFLECTION_in, LATER_s, name="position", unit="in")])
        mdf.save(path, overwrite=True)


def write_tdms(path: Path) -> None:
    """Write two waveforms that start 5 ms apart."""
    begin = np.datetime64("2026-03-01T12:00:00", "us")

    def waveform(name: str, values: Any, unit: str, rate_Hz: float, late_us: int) -> ChannelObject:
        properties = {
            "wf_start_time": begin + np.timedelta64(late_us, "us"),
            "wf_increment": 1.0 / rate_Hz,
            "wf_start_offset": 0.0,
            "unit_string": unit,
        }
        return ChannelObject("test 7", name, values, properties)

    force = waveform("force", FORCE_lbf, "lbf", 60.0, 0)
    place = waveform("position", DEFLECTION_in, "in", 80.0, 5000)
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([force, place])


def _ns(time_s: float) -> int:
    return 1_770_000_000_000_000_000 + round(1e9 * time_s)


def _messages() -> list[tuple[int, str, float]]:
    both = [(_ns(t), "/force", f) for t, f in zip(TIME_s, FORCE_lbf, strict=True)]
    both += [(_ns(t), "/position", x) for t, x in zip(LATER_s, DEFLECTION_in, strict=True)]
    return sorted(both)


def write_mcap_json(path: Path) -> None:
    """Write messages in JSON, stamped unevenly by the recorder and evenly by the sensors."""
    late = np.random.default_rng(4).uniform(0.0, 0.004, len(_messages()))
    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        schema = writer.register_schema("reading", "jsonschema", b"{}")
        ids = {t: writer.register_channel(t, "json", schema) for t in ("/force", "/position")}
        for (ns, topic, value), more in zip(_messages(), late, strict=True):
            stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
            row = {"header": {"stamp": stamp, "frame": "hand"}, "data": [value, 0.0]}
            at = ns + int(1e9 * more)
            writer.add_message(ids[topic], at, json.dumps(row).encode(), at)
        writer.finish()


def write_mcap_ros2(path: Path) -> None:
    """Write messages of ROS 2, with the sensors' stamps."""
    with path.open("wb") as file, Ros2(file) as writer:
        schema = writer.register_msgdef("hand/msg/Reading", "float64[2] data\nstring frame")
        for ns, topic, value in _messages():
            message = {"data": [value, 0.0], "frame": "hand"}
            writer.write_message(topic, schema, message, ns, ns)


def write_mcap_protobuf(path: Path) -> None:
    """Write messages of protobuf, with the sensors' stamps."""
    with path.open("wb") as file, Protobuf(file) as writer:
        for ns, topic, value in _messages():
            message = Struct()
            message.update({"value": value})
            writer.write_message(topic, message.fields["value"], ns, ns)


def write_ulog(path: Path) -> None:
    """Write two topics by the format's description, as pyulog cannot write new files."""

    def block(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), block(b"B", bytes(40))]
    parts.append(block(b"F", b"reading:uint64_t timestamp;double[2] data;"))
    parts += [block(b"A", struct.pack("<BH", i, i) + b"reading") for i in (0, 1)]
    for ns, topic, value in _messages():
        us = (ns - _ns(0.0) + 500) // 1000 + 5_000_000
        content = struct.pack("<HQ2d", topic == "/position", us, value, 0.0)
        parts.append(block(b"D", content))
    path.write_bytes(b"".join(parts))


def write_matlab73(path: Path) -> None:
    """Write a file as MATLAB's `save -v7.3` does: a user block, then HDF5."""
    with h5py.File(path, "w", userblock_size=512) as file:
        log = file.create_group("LOG")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in (("time", TIME_s), ("force", FORCE_lbf)):
            vector = log.create_dataset(name, data=values[None, :])
            vector.attrs["MATLAB_class"] = np.bytes_("double")
        table = file.create_dataset("data", data=np.vstack([TIME_s, FORCE_lbf]))
        table.attrs["MATLAB_class"] = np.bytes_("double")
        word = file.create_dataset("note", data=np.array([[ord(c)] for c in "test 7"], np.uint16))
        word.attrs["MATLAB_class"] = np.bytes_("char")
        kept = file.create_group("#refs#")
        cells = []
        for i, text in enumerate(("T", "F")):
            cell = kept.create_dataset(f"{i}", data=np.array([[ord(text)]], np.uint16))
            cell.attrs["MATLAB_class"] = np.bytes_("char")
            cells.append(cell.ref)
        names = file.create_dataset("signals", (1, 2), h5py.ref_dtype)
        names[0] = cells
        names.attrs["MATLAB_class"] = np.bytes_("cell")
        several = file.create_group("RUN")
        several.attrs["MATLAB_class"] = np.bytes_("struct")
        elements = [
            kept.create_dataset(f"run{i}", data=values[None, :])
            for i, values in enumerate((TIME_s, FORCE_lbf))
        ]
        places = several.create_dataset("values", (1, 2), h5py.ref_dtype)
        places[0] = [each.ref for each in elements]
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_hdf5(path: Path) -> None:
    """Write data sets with units, one of them compound, and text."""
    with h5py.File(path, "w") as file:
        rows = np.zeros(TIME_s.size, dtype=[("T", "<f8"), ("note", "S4")])
        rows["T"] = TIME_s
        file.create_dataset("test/clock", data=rows)
        force = file.create_dataset("test/force", data=FORCE_lbf.astype(np.float32))
        force.attrs["units"] = "lbf"
        file.create_dataset("test/words", data=["a", "b"], dtype=h5py.string_dtype())


def write_matlab_objects(path: Path, version: str) -> None:
    """Write a timetable, a table, a date, plain vectors, and an object of another class."""
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # mat-io's
        matio, pandas = (importlib.import_module(name) for name in ("matio", "pandas"))
    rate_s = np.rint(1e9 * TIME_s).astype("timedelta64[ns]")
    timed = pandas.DataFrame({"force": FORCE_lbf, "note": ["x"] * TIME_s.size})
    timed.index = pandas.DatetimeIndex(
        np.datetime64("2026-03-01T12:00", "ns") + rate_s, name="When"
    )
    variables = {
        "t": TIME_s[:, None],
        "F": FORCE_lbf[:, None],
        "LOG": {"runs": timed, "gain": np.arange(3.0)[:, None]},
        "plain": pandas.DataFrame({"T": TIME_s, "force": FORCE_lbf}),
        "span": rate_s[:, None],
        "kinds": pandas.Categorical(["a", "b"]),
    }
    with warnings.catch_warnings(action="ignore", category=UserWarning):  # s, not ns
        matio.save_to_mat(str(path), variables, version=version)
