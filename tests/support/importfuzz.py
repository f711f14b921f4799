"""Random logs, maps and tables for each reader, and the permitted outcomes of an import.

A case is made of a known motion. A variation that changes nothing must be read right; a fault in
its rows must be refused, or read right; damaged bytes must be refused, or read as whole numbers
in order. Nothing may raise but InputError. A case is made anew from its reader, seed and number.

    python -m tests.support.importfuzz [CASES] [SEED] [READER ...]

prints the counts for each reader. Each block of cases runs in a process of its own, since the
compiled reader of a format may crash or never end on damaged bytes, as it may in an import.
"""

from __future__ import annotations

import io
import json
import os
import signal
import struct
import sys
import tempfile
import tomllib
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
import polars as pl
from asammdf import MDF, Signal
from mcap.writer import Writer
from nptdms import ChannelObject, TdmsWriter
from numpy.typing import NDArray
from scipy import io as scipy_io

from coupled.errors import InputError
from coupled.parallel import limit_memory
from coupled.record.importing.convert import import_log
from coupled.record.importing.suggest.propose import propose
from tests.support.readhere import in_process

Floats = NDArray[np.float64]
RIGHT, EITHER, ANY = "right", "either", "any"
SEED = 35
LONGEST_s = 20
BLOCK = 50
TOLERANCE = 5e-3  # of the amplitude: what PCHIP leads over, and rounding; a frame late is 3e-2
RATE_Hz = 60.0
FORCE_N, PLACE_m, SPEED = 40.0, 0.03, 2.0


@dataclass(frozen=True)
class Motion:
    """Rows of a log as written: the stamp, the force in N, the position in m.

    `when_s` is when the row was taken in truth. It is logged as well, as a height, so that an
    import shows which rows it took and where it put them.
    """

    time_s: Floats
    force_N: Floats
    place_m: Floats
    when_s: Floats
    clock: tuple[str, ...] = ()

    @property
    def columns(self) -> dict[str, Floats]:
        """The columns by their names."""
        return {"T": self.time_s, "F": self.force_N, "X": self.place_m, "W": self.when_s}

    def taken(self, rows: Any, *clock: str) -> Motion:
        """Return some of the rows, in the order given."""
        time_s, force_N, place_m, when_s = (each[rows] for each in self.columns.values())
        return Motion(time_s, force_N, place_m, when_s, clock)


@dataclass(frozen=True)
class Case:
    """A log with its map and the permitted outcomes; `rows` is its number of frames."""

    name: str
    content: bytes
    log_map: str
    expected: str
    rows: int = 0


def moved(rng: np.random.Generator) -> Motion:
    """Return a motion of 1 to 3 s."""
    rows = int(rng.integers(60, 180))
    origin_s = float(rng.choice([0.0, 12.5, 1e6]))
    when_s = np.arange(rows) / RATE_Hz
    return Motion(origin_s + when_s, *_signals(when_s), when_s)


def _signals(time_s: Floats) -> tuple[Floats, Floats]:
    wave = np.sin(SPEED * time_s + 0.4)
    return FORCE_N * wave, PLACE_m * wave


def with_a_fault(rng: np.random.Generator, motion: Motion) -> Motion:
    """Return rows with a typical fault of loggers, with or without the key for it in the map."""
    fault = FAULTS[int(rng.integers(len(FAULTS)))]
    return fault(rng, motion)


def _swapped(rng: np.random.Generator, motion: Motion) -> Motion:
    rows, place = np.arange(motion.time_s.size), int(rng.integers(1, motion.time_s.size - 4))
    rows[place : place + 3] = rng.permutation(rows[place : place + 3])
    return motion.taken(rows, *_maybe(rng, "sort = true"))


def _turned(rng: np.random.Generator, motion: Motion) -> Motion:
    return motion.taken(slice(None, None, -1), *_maybe(rng, "sort = true"))


def _doubled(rng: np.random.Generator, motion: Motion) -> Motion:
    place = int(rng.integers(motion.time_s.size))
    rows = np.insert(np.arange(motion.time_s.size), place, place)
    return motion.taken(rows, *_maybe(rng, "drop_duplicates = true"))


def _lost(rng: np.random.Generator, motion: Motion) -> Motion:
    place, count = int(rng.integers(3, motion.time_s.size - 9)), int(rng.integers(1, 6))
    rows = np.delete(np.arange(motion.time_s.size), slice(place, place + count))
    return motion.taken(rows)


def _restarted(rng: np.random.Generator, motion: Motion) -> Motion:
    place = int(rng.integers(5, motion.time_s.size - 5))
    time_s = motion.time_s.copy()
    time_s[place:] -= time_s[place] - time_s[0] - float(rng.choice([0.0, 0.004]))
    remedy = _maybe(rng, "sort = true", "drop_duplicates = true", "wraps_at = 3")
    return replace(motion, time_s=time_s, clock=remedy)


def _stale(rng: np.random.Generator, motion: Motion) -> Motion:
    time_s = motion.time_s.copy()
    time_s[0] += float(rng.choice([-1e3, -1.0, 1.0, 1e3]))
    return replace(motion, time_s=time_s, clock=_maybe(rng, "sort = true"))


def _wrapped(rng: np.random.Generator, motion: Motion) -> Motion:
    since_s = motion.when_s
    period_s = float(since_s[-1] * rng.uniform(1.1, 3.0))
    late_s = float(rng.uniform(0.0, period_s))
    time_s = np.mod(since_s + late_s, period_s)
    # Rows of which none lies across the wrap keep their order.
    remedy = _maybe(rng, f"wraps_at = {period_s!r}", "sort = true")
    return replace(motion, time_s=time_s, clock=remedy)


def _holed(rng: np.random.Generator, motion: Motion) -> Motion:
    force_N = motion.force_N.copy()
    place, count = int(rng.integers(force_N.size)), int(rng.integers(1, 5))
    force_N[place : place + count] = np.nan
    return replace(motion, force_N=force_N)


def _unreal(rng: np.random.Generator, motion: Motion) -> Motion:
    force_N = motion.force_N.copy()
    force_N[int(rng.integers(force_N.size))] = float(rng.choice([np.inf, -np.inf, 1e300, 1e15]))
    return replace(motion, force_N=force_N)


def _timeless(rng: np.random.Generator, motion: Motion) -> Motion:
    time_s = motion.time_s.copy()
    time_s[int(rng.integers(time_s.size))] = float(rng.choice([np.nan, np.inf, 1e300]))
    return replace(motion, time_s=time_s)


def _short(rng: np.random.Generator, motion: Motion) -> Motion:
    return motion.taken(slice(0, int(rng.integers(0, 4))))


FAULTS = (
    *(_swapped, _turned, _doubled, _lost, _restarted, _stale, _wrapped),
    *(_holed, _unreal, _timeless, _short),
)


def _maybe(rng: np.random.Generator, *remedies: str) -> tuple[str, ...]:
    chosen = int(rng.integers(len(remedies) + 1))
    return () if chosen == len(remedies) else (remedies[chosen],)


def mapped(motion: Motion, names: Sequence[str], layout: str = "", more: str = "") -> str:
    """Return the map of a log with these column names: stamp, force, position, true time."""
    time, force, place, when = names
    clock = "\n".join(motion.clock)
    return (
        f'{layout}\n[clock]\nfrom = {json.dumps(time)}\nunit = "s"\n{clock}\n'
        f'[channels.column_force_N]\nfrom = {json.dumps(force)}\nunit = "N"\n{more}\n'
        f'[channels.column_computed_m]\nfrom = {json.dumps(place)}\nunit = "m"\n'
        f'[channels.altitude_m]\nfrom = {json.dumps(when)}\nunit = "m"\n'
    )


def damaged(rng: np.random.Generator, content: bytes) -> bytes:
    """Return bytes that are cut, reversed, overwritten or inserted."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        place = int(rng.integers(len(data) + 1)) if data else 0
        length = int(rng.choice([1, 4, 64, 1000]))
        noise = rng.integers(0, 256, length, dtype=np.uint8).tobytes()
        way = int(rng.integers(5))
        if way == 0:
            del data[place:]
        elif way == 1:
            data[place : place + length] = noise[: len(data[place : place + length])]
        elif way == 2:
            data[place : place + length] = bytes(len(data[place : place + length]))
        elif way == 3:
            data[place:place] = noise
        else:
            data[place : place + length] = b""
    return bytes(data)


# The readers: each writes a motion, in a form of many, and says how its map names it.

Written = tuple[str, bytes, str]  # the file's name, its content, the map


def write_csv(rng: np.random.Generator, motion: Motion) -> Written:
    delimiter = str(rng.choice([",", ";", "\t", " ", "|"]))
    comma = delimiter != "," and rng.random() < 0.3
    end = str(rng.choice(["\n", "\r\n"]))
    names, columns = list(motion.columns), list(motion.columns.values())
    order = rng.permutation(len(names))
    double = rng.random() < 0.2  # the force is there twice, the second the right one
    rows = []
    for row in zip(*columns, strict=True):
        cells = [f"{row[i]:.12g}" for i in order] + (["7"] if double else [])
        cells = [cell.replace(".", ",") if comma else cell for cell in cells]
        cells = ["" if cell == "nan" and delimiter != " " else cell for cell in cells]
        rows.append(delimiter.join([cells[-1], *cells[:-1]] if double else cells))
    head = [names[i] for i in order]
    head = ["F", *head] if double else head
    text = end.join([delimiter.join(head), *rows]) + (end if rng.random() < 0.5 else "")
    layout = f"[log]\ndelimiter = {json.dumps(delimiter)}\n"
    layout += 'decimal = ","\n' if comma else ""
    encoding = str(rng.choice(["utf-8", "utf-8-sig", "utf-16", "latin-1"]))
    if encoding in ("utf-16", "latin-1"):
        layout += f'encoding = "{encoding}"\n'
    if rng.random() < 0.3:
        text = f"# made{end}{end}{text}"
        layout += 'comment = "#"\n'
    log_map = mapped(motion, ("T", "F#2" if double else "F", "X", "W"), layout)
    return "log.csv", text.encode(encoding), log_map


COMPRESSIONS: tuple[Literal["zstd", "snappy", "uncompressed"], ...] = (
    "zstd",
    "snappy",
    "uncompressed",
)


def write_parquet(rng: np.random.Generator, motion: Motion) -> Written:
    table: dict[str, Any] = dict(motion.columns)
    more = ""
    rows = motion.time_s.size
    if rng.random() < 0.3:
        table["F"] = [[0.0, each] for each in motion.force_N]
        more = "element = 2"
        if rng.random() < 0.5:
            table["names"] = [["idle", "hand"]] * rows
            more = 'element = "hand"'
    if rng.random() < 0.3:
        table["day"] = [[["a"]]] * rows
        table["when"] = np.full(rows, np.datetime64("2026-01-01", "us"))
    frame = pl.DataFrame(table)
    if rng.random() < 0.2:
        frame = frame.with_columns(pl.col("X").cast(pl.Float32))
    buffer = io.BytesIO()
    frame.write_parquet(buffer, compression=COMPRESSIONS[int(rng.integers(3))])
    return "log.parquet", buffer.getvalue(), mapped(motion, tuple(motion.columns), more=more)


def write_mat5(rng: np.random.Generator, motion: Motion) -> Written:
    buffer = io.BytesIO()
    columns = motion.columns
    if rng.random() < 0.3:
        shaped = {name: values.reshape(-1, 1) for name, values in columns.items()}
    else:
        shaped = {name: values.reshape(1, -1) for name, values in columns.items()}
    way = int(rng.integers(4))
    layout, names = "", list(columns)
    if way == 0:
        scipy_io.savemat(buffer, shaped, format="4")
    elif way == 1:
        matrix = np.column_stack(list(columns.values()))
        words = np.array(names, dtype=object)
        scipy_io.savemat(buffer, {"data": matrix, "signals": words})
        layout = '[log]\nmatrix = "data"\n'
    elif way == 2:
        other = {"note": "a b", "cell": np.array([1, "x"], dtype=object), "i": np.arange(5)}
        scipy_io.savemat(buffer, {"LOG": shaped, **other}, do_compression=True)
        names = [f"LOG.{name}" for name in names]
    else:
        scipy_io.savemat(buffer, shaped, do_compression=bool(rng.integers(2)))
    return "log.mat", buffer.getvalue(), mapped(motion, names, layout)


def write_mat73(rng: np.random.Generator, motion: Motion) -> Written:
    buffer, names = io.BytesIO(), list(motion.columns)
    with h5py.File(buffer, "w", userblock_size=512) as file:
        place: Any = file
        if rng.random() < 0.4:
            place = file.create_group("LOG")
            place.attrs["MATLAB_class"] = np.bytes_("struct")
            names = [f"LOG.{name}" for name in names]
        for name, values in motion.columns.items():
            vector = place.create_dataset(name, data=values.reshape(1, -1))
            vector.attrs["MATLAB_class"] = np.bytes_("double")
        if rng.random() < 0.4:  # an object, of which only references are here
            words = np.array([[0xDD000000, 2, 1, 1, 1, 1]], np.uint32)
            item = file.create_dataset("table", data=words)
            item.attrs["MATLAB_class"] = np.bytes_("timetable")
            item.attrs["MATLAB_object_decode"] = np.int32(3)
    content = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    return "log.mat", content + buffer.getvalue()[128:], mapped(motion, names)


def write_hdf5(rng: np.random.Generator, motion: Motion) -> Written:
    buffer, names = io.BytesIO(), [f"a.{name}" for name in motion.columns]
    columns = motion.columns
    with h5py.File(buffer, "w") as file:
        if rng.random() < 0.4:
            rows = np.zeros(motion.time_s.size, dtype=[(name, "<f8") for name in columns])
            for name, values in columns.items():
                rows[name] = values
            file.create_dataset("a", data=rows)
        else:
            for name, values in columns.items():
                packed = values.size > 1 and rng.random() < 0.5
                file.create_dataset(
                    f"a/{name}", data=values, compression="gzip" if packed else None
                )
        file.create_dataset("words", data=["a", "b"], dtype=h5py.string_dtype())
        file["loop"] = h5py.SoftLink("/")
        if rng.random() < 0.3:
            file["a_"] = h5py.ExternalLink("other.h5", "/x")
    return "log.h5", buffer.getvalue(), mapped(motion, names)


def write_mdf(rng: np.random.Generator, motion: Motion) -> Written:
    counts = np.where(np.isfinite(motion.force_N), 100.0 * motion.force_N, 0.0)
    whole = np.abs(counts).max(initial=0.0) < 1e9 and np.isfinite(motion.force_N).all()
    linear = {"a": 0.01, "b": 0.0}
    conversions: list[dict[str, Any] | None] = [
        linear,
        {"val_0": 32767, "text_0": b"SNA", "default_addr": linear},
        {"P1": 0.0, "P2": 0.02, "P3": 0.0, "P4": 0.0, "P5": 0.0, "P6": 2.0},
        {"raw_0": -9e3, "raw_1": 9e3, "phys_0": -90.0, "phys_1": 90.0, "interpolation": True},
    ]
    raw = np.rint(counts).astype(np.int32) if whole else motion.force_N
    conversion = conversions[int(rng.integers(len(conversions)))] if whole else None
    with MDF(version="4.10") as mdf:
        signals = [
            Signal(raw, motion.time_s, name="F", unit="N", conversion=conversion),
            Signal(motion.place_m, motion.time_s, name="X", unit="m"),
            Signal(motion.when_s, motion.time_s, name="W", unit="m"),
        ]
        if rng.random() < 0.4:
            for signal in signals:
                mdf.append([signal])
            time = "1.time"
        else:
            mdf.append(signals)
            time = "time"
        buffer = io.BytesIO()
        mdf.save(buffer, overwrite=True, compression=int(rng.integers(3)))
    return "log.mf4", buffer.getvalue(), mapped(motion, (time, "F", "X", "W"))


def write_tdms(rng: np.random.Generator, motion: Motion) -> Written:
    scale: dict[str, Any] = {}
    raw = motion.force_N
    if rng.random() < 0.5:
        kind = str(rng.choice(["Linear", "Reciprocal", "Polynomial"]))
        scale = {
            "NI_Number_Of_Scales": 1,
            "NI_Scaling_Status": "unscaled",
            "NI_Scale[0]_Scale_Type": kind,
            "NI_Scale[0]_Linear_Slope": 0.5,
            "NI_Scale[0]_Linear_Y_Intercept": 3.0,
            "NI_Scale[0]_Polynomial_Coefficients_Size": 2,
            "NI_Scale[0]_Polynomial_Coefficients[0]": 3.0,
            "NI_Scale[0]_Polynomial_Coefficients[1]": 0.5,
        }
        raw = 2.0 * (motion.force_N - 3.0)
    objects = [
        ChannelObject("g", "T", motion.time_s),
        ChannelObject("g", "F", raw, scale),
        ChannelObject("g", "X", motion.place_m),
        ChannelObject("g", "W", motion.when_s),
    ]
    buffer = io.BytesIO()
    with TdmsWriter(buffer) as writer:
        half = motion.time_s.size // 2
        if rng.random() < 0.4 and half:
            for part in (slice(None, half), slice(half, None)):
                writer.write_segment(
                    [ChannelObject(o.group, o.channel, o.data[part], o.properties) for o in objects]
                )
        else:
            writer.write_segment(objects)
    return "log.tdms", buffer.getvalue(), mapped(motion, tuple(motion.columns))


def write_mcap(rng: np.random.Generator, motion: Motion) -> Written:
    buffer = io.BytesIO()
    writer: Any = Writer(buffer)
    writer.start()
    schema = writer.register_schema("joints", "jsonschema", b"{}")
    topic = writer.register_channel("/j", "json", schema)
    named = rng.random() < 0.6
    turns = rng.random() < 0.5
    rows = zip(*motion.columns.values(), strict=True)
    for i, (time_s, force_N, place_m, when_s) in enumerate(rows):
        joints = [["hand", force_N, place_m], ["idle", 7.0, 0.2]]
        if turns and i % 7 > 3:
            joints.reverse()
        names, forces, places = (list(each) for each in zip(*joints, strict=True))
        row = {"t": time_s, "when": when_s, "name": names, "effort": forces, "position": places}
        writer.add_message(topic, 1000 * i, json.dumps(row).encode(), 1000 * i)
    writer.finish()
    word = "hand" if named else "0"
    log_map = mapped(motion, ("/j.t", f"/j.effort[{word}]", f"/j.position[{word}]", "/j.when"))
    return "log.mcap", buffer.getvalue(), log_map


def write_ulog(rng: np.random.Generator, motion: Motion) -> Written:
    del rng

    def block(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), block(b"B", bytes(40))]
    parts.append(block(b"F", b"r:uint64_t timestamp;double t;double[3] d;"))
    parts.append(block(b"A", struct.pack("<BH", 0, 0) + b"r"))
    for i, row in enumerate(zip(*motion.columns.values(), strict=True)):
        parts.append(block(b"D", struct.pack("<HQ4d", 0, 1000 * i, *row)))
    return "log.ulg", b"".join(parts), mapped(motion, ("r.t", "r.d[0]", "r.d[1]", "r.d[2]"))


WRITERS: dict[str, Callable[[np.random.Generator, Motion], Written]] = {
    "csv": write_csv,
    "parquet": write_parquet,
    "matlab v5": write_mat5,
    "matlab v7.3": write_mat73,
    "hdf5": write_hdf5,
    "mdf": write_mdf,
    "tdms": write_tdms,
    "mcap": write_mcap,
    "ulog": write_ulog,
}
READERS = (*WRITERS, "map", "suggest")


def make_case(reader: str, seed: int, number: int) -> Case:
    """Return a case of a reader: in turn valid, with a fault, damaged."""
    rng = np.random.default_rng([seed, list(WRITERS).index(reader), number])
    motion = moved(rng)
    kind = number % 3
    if kind == 1:
        motion = with_a_fault(rng, motion)
    if rng.random() < 0.5:
        motion = replace(motion, clock=(*motion.clock, f"frame_rate_Hz = {RATE_Hz:g}"))
    name, content, log_map = WRITERS[reader](rng, motion)
    expected = (RIGHT, EITHER, ANY)[kind]
    if kind == 0 and ("Reciprocal" in str(content) or "[0]" in log_map):
        expected = EITHER  # may be refused: a scale that is not known, an order that changes
    if kind == 2:
        content = damaged(rng, content)
    frames = round(float(np.ptp(motion.when_s)) * RATE_Hz) + 1 if motion.when_s.size else 0
    return Case(name, content, log_map, expected, frames)


# Maps: a good one with a key that is put in, left out or given another value.

_KEYS = {
    "[log]": "delimiter decimal comment skip_rows header units_row missing encoding matrix names "
    "format",
    "[clock]": "from unit rate_Hz frame_rate_Hz start_s end_s date longest_gap_rows wraps_at sort "
    "drop_rows drop_duplicates",
    "[channels": "from unit sign scale offset delay_s element sign_bit wraps_at unwrap log "
    "longest_gap_rows",
}
_GOOD = {
    **dict.fromkeys(
        ("sort", "drop_duplicates", "header", "units_row", "unwrap"), ("true", "false")
    ),
    **dict.fromkeys(("scale", "offset"), ("2", "0.5", "-3.0", "1e-9")),
    **dict.fromkeys(("delay_s", "start_s"), ("0", "0.05", "0.3")),
    **dict.fromkeys(("longest_gap_rows", "skip_rows"), ("0", "1", "7")),
    **{"unit": ('"s"', '"ms"', '"N"', '"lbf"', '"m"', '"mm"', '"ft"'), "sign": ("1", "-1")},
    **{"from": ('"T"', '"F"', '"X"', '"W"'), "end_s": ("0.4", "0.8", "9"), "log": ('"log.csv"',)},
    **{"frame_rate_Hz": ("30", "60", "61.5", "120"), "rate_Hz": ("60", "50")},
    **{"wraps_at": ("100", "1e7", "65536"), "sign_bit": ("10",), "comment": ('"#"',)},
    **{"drop_rows": ("[2]", '["2-4", 9]', "[3, 8]"), "missing": ('["a", "-1"]',)},
    **{"encoding": ('"utf-8"', '"latin-1"'), "format": ('"csv"',), "names": ('["a", "b"]',)},
}
_ANY_KEY = (*" ".join(_KEYS.values()).split(), "nonsense", "")
_VALUES = (
    *("0", "1", "-1", "2", "1e3", "1e300", "-0.0", "nan", "inf", "true", "false", '""', '"?"'),
    *('"T"', '"F"', '"X"', '"s"', '"N"', '"m"', '"lbf/in"', '";"', '","', '"iso"', '"%Y"'),
    *("[]", "[1]", '["a"]', '["2-4"]', "[[1]]", "{a = 1}", "1979-05-27", '"utf-16"', '"csv"'),
    *('"mdf"', '"\\u0000"', '"' + "x" * 300 + '"', "9" * 400, '"3-2"', '"1-99999999999"'),
)


def make_map(seed: int, number: int) -> Case:
    """Return a good log with a map that is changed at random."""
    rng = np.random.default_rng([seed, 100, number])
    motion = moved(rng)
    rows = zip(*motion.columns.values(), strict=True)
    text = "\n".join(["T,F,X,W", *(",".join(f"{cell:.12g}" for cell in row) for row in rows)])
    lines = mapped(motion, tuple(motion.columns), "[log]\nheader = true").split("\n")
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        place, way = int(rng.integers(len(lines))), int(rng.integers(8))
        above = [line for line in lines[: place + 1] if line[:1] == "["]
        section = above[-1] if above else ""
        own = next((keys for start, keys in _KEYS.items() if section.startswith(start)), "from")
        key = str(rng.choice(own.split() if rng.random() < 0.8 else _ANY_KEY))
        value = str(rng.choice(_GOOD.get(key, _VALUES) if rng.random() < 0.7 else _VALUES))
        if way == 0:
            lines[place] = f"{key} = {value}"
        elif way == 1 and "=" in lines[place]:
            lines[place] = lines[place].partition("=")[0] + f"= {value}"
        elif way == 2:
            del lines[place]
        else:
            lines.insert(place + 1, f"{key} = {value}")
    return Case("log.csv", text.encode(), "\n".join(lines), ANY)


# --suggest: tables whose columns have names and cells of all kinds.

_NAMES = (
    *("time", "t", "Time (ms)", "timestamp", "date", "clock", "stick force", "FORCE_LB", "F [N]"),
    *(
        "column encoder [mm]",
        "grip",
        "Grip LVDT (in)",
        "Act Pos",
        "position",
        "pos_m",
        "pedal load",
    ),
    *("wheel angle", "q_deg_s", "QBAR", "alt", "theta", "Nz", "torque_Nm", "", "x", "elevator_deg"),
    *("force", "force", "column_force_N", "column_computed_m", "heading", "°", "a\nb", "#", "?"),
)


def make_table(seed: int, number: int) -> tuple[str, bytes]:
    """Return a table of columns with names and cells of all kinds, as CSV or Parquet."""
    rng = np.random.default_rng([seed, 101, number])
    rows = int(rng.choice([0, 1, 2, 3, 5, 40, 200]))
    time_s = np.arange(rows) / RATE_Hz
    wave = np.sin(SPEED * time_s)
    day = np.datetime64("2026-01-01T12:00:00", "us")
    makers: list[Callable[[], Any]] = [
        lambda: time_s,
        lambda: time_s[::-1],
        lambda: 1e3 * time_s,
        lambda: np.zeros(rows),
        lambda: 40.0 * wave,
        lambda: -0.03 * wave,
        lambda: np.rint(1000 * wave).astype(np.int64),
        lambda: np.full(rows, np.nan),
        lambda: np.where(rng.random(rows) < 0.2, np.nan, wave),
        lambda: np.where(rng.random(rows) < 0.1, np.inf, 1e308 * wave),
        lambda: ["x"] * rows,
        lambda: [None] * rows,
        lambda: [f"2026-01-01 12:00:{s:09.6f}" for s in time_s % 60],
        lambda: ["2026-01-01"] * rows,
        lambda: [f"{v:.3f}".replace(".", ",") for v in wave],
        lambda: day + (1e6 * time_s).astype("timedelta64[us]"),
        lambda: np.full(rows, day),
        lambda: np.full(rows, np.datetime64("2026-01-01", "D")),
        lambda: [[v, 2.0] for v in wave],
        lambda: [[[v]] for v in wave],
        lambda: [["a", "b"]] * rows,
        lambda: [[]] * rows,
        lambda: ["[0.1, 0.2]"] * rows,
        lambda: ["[]"] * rows,
        lambda: [b"\x00"] * rows,
        lambda: rng.random(rows) < 0.5,
        lambda: np.full(rows, 2**63, dtype=np.uint64),
    ]
    chosen = [str(rng.choice(_NAMES)) for _ in range(int(rng.integers(1, 7)))]
    columns = [makers[int(rng.integers(len(makers)))]() for _ in chosen]
    if rng.random() < 0.5:
        named = {f"{name}{'' if name not in chosen[:i] else i}": column
                 for i, (name, column) in enumerate(zip(chosen, columns, strict=True))}  # fmt: skip
        buffer = io.BytesIO()
        pl.DataFrame(named, strict=False).write_parquet(buffer)
        return "log.parquet", buffer.getvalue()
    delimiter = str(rng.choice([",", ";", "\t"]))
    lines = [delimiter.join(chosen)]
    lines += [delimiter.join(str(column[i]) for column in columns) for i in range(rows)]
    content = "\n".join(lines).encode()
    return "log.csv", damaged(rng, content) if rng.random() < 0.2 else content


# The outcome of a case.


def outcome(reader: str, seed: int, number: int, folder: Path) -> str:
    """Return the outcome of an import: right, read or refused; raises for any other."""
    with in_process(), warnings.catch_warnings(action="error"):
        if reader == "suggest":
            return _suggested(*make_table(seed, number), folder)
        with warnings.catch_warnings(action="ignore"):  # of the libraries that write
            case = make_map(seed, number) if reader == "map" else make_case(reader, seed, number)
        return _imported(case, folder)


def _imported(case: Case, folder: Path) -> str:
    (folder / case.name).write_bytes(case.content)
    (folder / "map.toml").write_text(case.log_map, encoding="utf-8")
    try:
        record, _ = import_log(folder / case.name, folder / "map.toml")
    except InputError as error:
        _check_line(error)
        assert case.expected != RIGHT, f"refused: {error}"
        return "refused"
    assert np.isfinite(record.data).all()
    assert (np.diff(record.time_s) > 0.0).all()
    if case.expected == ANY:
        return "read"
    assert len(record) == case.rows, f"{len(record)} of {case.rows} frames"
    when_s = record["altitude_m"]
    late_s = np.max(np.abs(when_s - when_s[0] - record.time_s))
    assert late_s < 0.1 / RATE_Hz, f"a row stands {late_s:.3g} s off"
    expected = _signals(when_s)
    for name, values, most in zip(
        ("column_force_N", "column_computed_m"), expected, (FORCE_N, PLACE_m), strict=True
    ):
        off = float(np.max(np.abs(record[name] - values))) / most
        assert off < TOLERANCE, f"{name} is off by {off:.3g} of its amplitude"
    return "right"


def _check_line(error: InputError) -> None:
    for one in error.every:
        text = str(one)
        assert "\n" not in text and len(text) < 4000 and text.isprintable(), text


def _suggested(name: str, content: bytes, folder: Path) -> str:
    (folder / name).write_bytes(content)
    try:
        proposal = propose([folder / name])
    except InputError as error:
        _check_line(error)
        return "refused"
    table = tomllib.loads(proposal.text)
    asked = sum(value == "?" for value in _leaves(table))
    assert asked == len(proposal.questions)
    (folder / "map.toml").write_text(proposal.text, encoding="utf-8")
    try:
        import_log(folder / name, folder / "map.toml")
    except InputError as error:
        _check_line(error)
        return "proposed"
    assert not asked, "a map with a question was imported"
    return "read"


def _leaves(table: Any) -> Iterator[object]:
    for value in table.values() if isinstance(table, dict) else []:
        if isinstance(value, dict):
            yield from _leaves(value)
        else:
            yield value


# Blocks of cases, each in a process of its own.


def run(reader: str, cases: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Return the count of each outcome of a reader's cases, and a line for each fault."""
    counts, faults, number = Counter[str](), list[str](), 0
    while number < cases:
        done, last = _block(reader, seed, number, min(BLOCK, cases - number))
        for what, line in done:
            counts[what] += 1
            faults += [line] if what == "fault" else []
        number += len(done)
        if last:  # the process ended before its block did
            counts["ended"] += 1
            faults += [] if reader in CONTAINED else [f"{reader} {seed} {number}: {last}"]
            number += 1
    return counts, faults


CONTAINED = frozenset(WRITERS) - {"csv"}  # read in a process of its own: its end is one line


def _block(reader: str, seed: int, first: int, count: int) -> tuple[list[tuple[str, str]], str]:
    """Return the outcomes of some cases, and how the process ended, if early."""
    reading_end, writing_end = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(reading_end)
        _work(reader, seed, first, count, writing_end)
        os._exit(0)
    os.close(writing_end)
    with os.fdopen(reading_end, encoding="utf-8") as pipe:
        done = [tuple(json.loads(line)) for line in pipe]
    _, status = os.waitpid(process, 0)
    return done, f"ended by {status}" if status else ""


def _work(reader: str, seed: int, first: int, count: int, pipe: int) -> None:
    limit_memory()
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    with os.fdopen(pipe, "w", encoding="utf-8") as out:
        for number in range(first, first + count):
            with tempfile.TemporaryDirectory() as folder:
                signal.alarm(LONGEST_s)
                try:
                    done = outcome(reader, seed, number, Path(folder)), ""
                except BaseException as error:
                    what = f"{type(error).__name__}: {str(error)[:300]}"
                    done = "fault", f"{reader} {seed} {number}: {what}"
                signal.alarm(0)
            out.write(json.dumps(done) + "\n")
            out.flush()


def main(words: Sequence[str]) -> int:
    """Print the counts of each reader and the faults; return the number of faults."""
    numbers = [int(word) for word in words if word.isdigit()]
    cases, seed = (numbers + [len(READERS) * 100, SEED][len(numbers) :])[:2]
    chosen = [word for word in words if word in READERS] or list(READERS)
    every = 0
    for reader in chosen:
        counts, faults = run(reader, -(-cases // len(chosen)), seed)
        said = ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
        print(f"{reader}: {sum(counts.values())} cases: {said}", flush=True)
        for fault in faults[:20]:
            print("   ", fault, flush=True)
        every += len(faults)
    return every


if __name__ == "__main__":
    sys.exit(min(main(sys.argv[1:]), 1))
