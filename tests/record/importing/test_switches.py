"""Columns of true and false, or of named states: no channel of a quantity is read from them."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import pytest
from mcap.writer import Writer
from nptdms import ChannelObject, TdmsWriter
from scipy import io as scipy_io

from coupled.errors import InputError
from coupled.record.importing.convert import import_log
from coupled.record.importing.suggest.propose import propose
from tests.support.logs import TIME_s, imported, text
from tests.support.readhere import in_process

ON = np.sin(3.0 * TIME_s) > 0.0
CHANNEL = {"quantity": '[channels.column_force_N]\nunit = "N"', "own": "[channels.on]\nown = true"}


@pytest.fixture(autouse=True)
def here() -> Iterator[None]:
    with in_process():
        yield


def write_parquet(path: Path) -> None:
    pl.DataFrame({"t": TIME_s, "force": ON}).write_parquet(path)


def write_json(path: Path) -> None:
    path.write_text(json.dumps({"t": TIME_s.tolist(), "force": ON.tolist()}))


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["t"], file["force"] = TIME_s, ON


def write_matlab_7_3(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["t"], file["force"] = TIME_s, ON.astype(np.uint8)
        file["force"].attrs["MATLAB_class"] = np.bytes_("logical")


def write_matlab(path: Path) -> None:
    scipy_io.savemat(path, {"t": TIME_s, "force": ON})


def write_tdms(path: Path) -> None:
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject("g", "t", TIME_s), ChannelObject("g", "force", ON)])


def write_mcap(path: Path) -> None:
    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        channel = writer.register_channel("", "json", 0)
        for time_s, on in zip(TIME_s, ON, strict=True):
            data = json.dumps({"t": time_s, "force": bool(on)}).encode()
            writer.add_message(channel, log_time=0, data=data, publish_time=0)
        writer.finish()


def write_ulog(path: Path) -> None:
    def block(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), block(b"B", bytes(40))]
    parts.append(block(b"F", b"g:uint64_t timestamp;bool force;"))
    parts.append(block(b"A", struct.pack("<BH", 0, 0) + b"g"))
    rows = zip(TIME_s, ON, strict=True)
    parts += [block(b"D", struct.pack("<HQ?", 0, round(1e6 * t), on)) for t, on in rows]
    path.write_bytes(b"".join(parts))


WRITERS: dict[str, tuple[Callable[[Path], None], str, str]] = {
    "log.parquet": (write_parquet, "t", ""),
    "log.json": (write_json, "t", ""),
    "log.h5": (write_hdf5, "t", ""),
    "log.mat": (write_matlab, "t", ""),
    "v7.3.mat": (write_matlab_7_3, "t", ""),
    "log.tdms": (write_tdms, "t", ""),
    "log.mcap": (write_mcap, "t", "."),
    "log.ulg": (write_ulog, "timestamp", "g."),
}


@pytest.mark.parametrize("name", WRITERS)
def test_true_and_false_are_no_quantity_but_a_channel_of_ones_own(
    tmp_path: Path, name: str
) -> None:
    write, time, before = WRITERS[name]
    write(tmp_path / name)
    log_map = f'[clock]\nfrom = "{before}{time}"\n{{channel}}\nfrom = "{before}force"\n'
    (tmp_path / "map.toml").write_text(log_map.format(channel=CHANNEL["quantity"]))
    with pytest.raises(InputError, match=f"{name}: {before}force: holds true and false"):
        import_log(tmp_path / name, tmp_path / "map.toml")
    (tmp_path / "map.toml").write_text(log_map.format(channel=CHANNEL["own"]))
    record, _ = import_log(tmp_path / name, tmp_path / "map.toml")
    np.testing.assert_array_equal(record["on"], ON)
    with pytest.raises(InputError, match="none of its columns holds numbers that change"):
        propose([tmp_path / name])


def test_states_of_an_hdf5_enumeration_are_named(tmp_path: Path) -> None:
    states = h5py.enum_dtype({"off": 0, "on": 1, "failed": 2}, basetype="i1")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = TIME_s
        file.create_dataset("force", data=ON.astype("i1"), dtype=states)
    log_map = f'[clock]\nfrom = "t"\nunit = "s"\n{CHANNEL["quantity"]}\nfrom = "force"'
    (tmp_path / "map.toml").write_text(log_map)
    with pytest.raises(InputError, match=r"log\.h5: force: holds states by name, .*off, on"):
        import_log(tmp_path / "log.h5", tmp_path / "map.toml")


def test_a_channel_of_two_values_is_doubted(tmp_path: Path) -> None:
    _, account = imported(tmp_path, text(force=ON.astype(float)))
    assert "only two values: a switch?" in account.channels["column_force_N"].doubts
    assert "only two values: a switch?" not in account.channels["column_computed_m"].doubts
