"""Valid inputs of every command, and bytes changed at random in one of them."""

from __future__ import annotations

import hashlib
import io
import json
import re
from pathlib import Path

import numpy as np
import polars as pl
from scipy import io as scipy_io

from coupled.record.channels import record_channels
from tests.support.logs import GOOD, MAP
from tests.support.readings import CSV

ROOT = Path(__file__).parents[2]
RUN = """name = "short"
card = "A short pull."
rig = "rig.toml"
duration_s = 0.5
configurations = ["rigid"]

[pilot.column]
kind = "table"
file = "force.csv"

[[expect]]
channel = "column_force_N"
take = "greatest"
most = 100.0
"""
SWEEP = """name = "s"
run = "run.toml"
configurations = ["rigid"]
keep = ["loss"]

[[vary]]
key = "rig.controls.column.loader.bend_m_per_N"
values = [1e-6]
"""
TRUTH: dict[str, object] = {
    **{"class": "none", "rig": "t37", "effects": [], "stages": [], "gap": {}, "missing": []}
}
# Words that an author, or an attacker, may write instead of a number or a name.
WORDS: tuple[bytes, ...] = (
    *(
        b"nan",
        b"inf",
        b"-1e308",
        b"1e-320",
        b"0",
        b"-0.0",
        b"true",
        b"[]",
        b"{}",
        b'""',
        b"9" * 400,
    ),
    *(
        b"1979-05-27",
        b"[[",
        b"]",
        b"{",
        b'"',
        b"'''",
        b"\x00",
        b"\xff\xfe",
        b"\x1b[2J",
        b"\n\n",
        b",",
    ),
    *(
        b"../evil",
        b"a" * 3000,
        b"a." * 150,
        b"\xe2\x80\xae",
        b"null",
        b"[null]",
        b"1e400",
        b"=",
        b"#",
    ),
)


def write_inputs(folder: Path) -> None:
    """Write the valid input files of the commands of `cases`."""
    for name, content in _inputs().items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)


def _inputs() -> dict[str, bytes]:
    rows = 40
    names = record_channels(["column"], flown=True)
    random = np.random.default_rng(1).standard_normal((rows, len(names)))
    random[:, 0] = np.arange(rows) / 60.0
    record = pl.DataFrame(random, schema=list(names), orient="row")
    parquet, log_parquet, mat = io.BytesIO(), io.BytesIO(), io.BytesIO()
    record.write_parquet(parquet)
    log = pl.read_csv(GOOD.encode())
    log.write_parquet(log_parquet)
    scipy_io.savemat(mat, {name: log[name].to_numpy() for name in log.columns}, do_compression=True)
    key = {"format": "coupled blind key 1", "salt": "s", "seed": 1, "records": {"r001": TRUTH}}
    sealed = json.dumps(key).encode()
    return {
        "rig.toml": (ROOT / "aircraft/T37/report-column.toml").read_bytes(),
        "run.toml": RUN.encode(),
        "force.csv": b"time_s,column_force_N\n0,0\n0.1,20\n0.4,30\n",
        "sweep.toml": SWEEP.encode(),
        "record.csv": record.write_csv().encode(),
        "record.parquet": parquet.getvalue(),
        "record.manifest.json": b'{"format": 1, "rows": 40}',
        "readings.csv": CSV.encode(),
        "log.csv": GOOD.encode()[:4000].rsplit(b"\n", 1)[0],
        "log.parquet": log_parquet.getvalue(),
        "log.mat": mat.getvalue(),
        "map.toml": MAP.encode(),
        "key.json": sealed,
        "seal.toml": f'key_sha256 = "{hashlib.sha256(sealed).hexdigest()}"\n'.encode(),
        "answers/r001.json": b'{"verdict": "no_gap", "effects": [], "stages": {}, "shrink": {}}',
        "many/records.toml": b'r1 = "t37"\nr2 = "b747"\n',
    }


COMMANDS: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = (
    (("fly", "run.toml", "-o", "o.csv"), ("run.toml", "rig.toml", "force.csv")),
    (("check", "run.toml"), ("run.toml",)),
    (("plot", "record.csv", "--figure", "o.png"), ("record.csv", "record.manifest.json")),
    (("plot", "record.parquet", "--figure", "o.png"), ("record.parquet",)),
    (("calibrate", "readings.csv"), ("readings.csv",)),
    (("bench", "--rig", "rig.toml", "-o", "b.csv"), ("rig.toml",)),
    (("import", "log.csv", "--map", "map.toml", "-o", "o.csv"), ("log.csv", "map.toml")),
    (("import", "log.parquet", "--map", "map.toml", "-o", "o.csv"), ("log.parquet",)),
    (("import", "log.mat", "--map", "map.toml", "-o", "o.csv"), ("log.mat",)),
    (("sweep", "sweep.toml", "--folder", "swept", "-j", "1"), ("sweep.toml",)),
    (
        ("blind", "score", "answers", "--key", "key.json", "--seal", "seal.toml"),
        ("key.json", "seal.toml", "answers/r001.json"),
    ),
    (("diagnose", "many", "--output", "diagnoses"), ("many/records.toml",)),
)


def cases() -> list[tuple[tuple[str, ...], str]]:
    """Return (command, the file of it to change) of every command that reads files."""
    return [(words, name) for words, names in COMMANDS for name in names]


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """Return bytes changed in one to three places: words, lines, bits, lengths."""
    for _ in range(int(random.integers(1, 4))):
        content = _once(content, random)
    return content


def _once(content: bytes, random: np.random.Generator) -> bytes:
    place = int(random.integers(0, len(content) + 1))
    word = WORDS[int(random.integers(len(WORDS)))]
    kind = int(random.integers(0, 8))
    if kind == 0:
        changed = content[:place] + word + content[place:]
    elif kind == 1:
        changed = content[:place]
    elif kind == 2:
        changed = content[:place] + random.bytes(1) + content[place + 1 :]
    elif kind == 3:  # a line twice, or gone
        lines = content.split(b"\n")
        row = int(random.integers(len(lines)))
        lines[row : row + 1] = [] if random.random() < 0.5 else [lines[row], lines[row]]
        changed = b"\n".join(lines)
    elif kind == 4:  # a stretch of another place
        start = int(random.integers(0, len(content) + 1))
        changed = content[:place] + content[start : start + 40] + content[place + 40 :]
    else:  # a value or a name
        parts = list(re.finditer(rb"[^\s,=\[\]\"':{}]+", content))
        if not parts:
            return word
        part = parts[int(random.integers(len(parts)))]
        changed = content[: part.start()] + word + content[part.end() :]
    return changed
