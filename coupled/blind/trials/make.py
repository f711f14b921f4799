"""A folder of sealed trials: records, nominal rigs, the seal; and the key apart."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from coupled.blind.trials.key import SEAL, key_text, seal_text
from coupled.blind.trials.rigs import DRAWN, random_rig, shipped_pool
from coupled.blind.trials.trial import Plan, draw_trial, plans
from coupled.blind.twin.setting import csv_text
from coupled.errors import InputError
from coupled.files import check_target, write_text
from coupled.rig.rig import Rig
from coupled.rig.rigwrite import rig_text

Progress = Callable[[str, int, int], None]
RECORDS = "records"


def make(
    folder: Path, key: Path, seed: int | None, records: int, rigs: int, progress: Progress
) -> None:
    """Write a set of trials into `folder` and their key to `key`.

    What an interrupted make of the same numbers has written is kept, and the rest is made. The
    same seed gives the same bytes; without one it is drawn, and stands in the key alone.
    """
    parts = key.with_name(key.name + ".parts")
    seed = _begin(folder, key, parts, seed, records, rigs)
    pool = rig_pool(seed, rigs)
    for name, rig in pool.items():
        remark = "The nominal rig: what a record's real one is held against"
        write_text(folder / "rigs" / f"{name}.toml", rig_text(rig, remark))
    names = [f"r{i + 1:03d}" for i in range(records)]
    todo = plans(np.random.default_rng([seed, 1]), records)
    truths = {}
    for i, (name, plan) in enumerate(zip(names, todo, strict=True)):
        progress(f"{name} of {names[-1]}", i, records)
        truths[name] = _one(folder, parts, name, [seed, 3, i], plan, pool)
    listed = "".join(f'{name} = "{truths[name]["rig"]}"\n' for name in names)
    write_text(folder / "records.toml", "# record = rig file (rigs/NAME.toml)\n" + listed)
    salt = np.random.default_rng([seed, 2]).bytes(32).hex()
    text = key_text(salt, seed, truths)
    write_text(key, text)
    write_text(folder / SEAL, seal_text(text))
    for part in parts.iterdir():
        part.unlink()
    parts.rmdir()


def rig_pool(seed: int, rigs: int) -> dict[str, Rig]:
    """Return the shipped rigs in their variants and `rigs` others drawn from the seed."""
    pool = shipped_pool()
    rng = np.random.default_rng([seed, 0])
    for i in range(rigs):
        name = f"{DRAWN}{i + 1:02d}"
        pool[name] = random_rig(rng, name)
    return pool


def _begin(folder: Path, key: Path, parts: Path, seed: int | None, records: int, rigs: int) -> int:
    """Check the target and return the seed: that of an interrupted make, given, or drawn."""
    note = parts / "make.json"
    if note.is_file():
        begun = _read(note)
        wanted = (begun["seed"] if seed is None else seed, records, rigs)
        if wanted != (begun["seed"], begun["records"], begun["rigs"]):
            raise InputError(
                folder,
                "",
                f"holds an unfinished make of {begun['records']} records and {begun['rigs']}"
                " rigs; finish it with the same numbers, or give another folder",
            )
        return int(begun["seed"])
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(folder, "", "is not empty; give a new folder")
    if key.exists():
        raise InputError(key, "--key", "is there already; a key is never overwritten")
    check_target(key)
    check_target(folder / SEAL)
    chosen = secrets.randbits(62) if seed is None else seed
    write_text(note, json.dumps({"seed": chosen, "records": records, "rigs": rigs}))
    return chosen


def _one(
    folder: Path, parts: Path, name: str, seed: list[int], plan: Plan, pool: Mapping[str, Rig]
) -> dict[str, Any]:
    """Return a record's truth, once record and truth are written; those that are, are kept."""
    path, note = folder / RECORDS / f"{name}.csv", parts / f"{name}.json"
    if path.is_file() and note.is_file():
        return _read(note)
    trial = draw_trial(np.random.default_rng(seed), plan, pool)
    truth = {**trial.truth, "seed": seed}
    write_text(path, csv_text(trial.record))
    write_text(note, json.dumps(truth, sort_keys=True))
    return truth


def _read(note: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(note.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise InputError(note, "", "cannot be read back; delete it, and make anew") from None
    return found
