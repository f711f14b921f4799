"""A folder of sealed trials: records, nominal rigs, the seal; and the key in another place."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from coupled.blind.trials.deck import DEFAULT, Deck, read_deck
from coupled.blind.trials.key import SEAL, Key, Seal, digest, read_key, read_seal
from coupled.blind.trials.rigs import rig_pool
from coupled.blind.trials.trial import Plan, draw_trial, plans
from coupled.blind.trials.truth import Truth, truth_from
from coupled.blind.twin.setting import csv_text
from coupled.errors import InputError
from coupled.files import check_targets, named, read_json, read_text, write_text
from coupled.parallel import as_done, cores, executor
from coupled.rig.rig import Rig
from coupled.rig.rigwrite import rig_text
from coupled.schema import Lenient, quantity, read_as

Progress = Callable[[str, int, int], None]
RECORDS, RIGS, LIST, NOTE = "records", "rigs", "records.toml", "make.json"
UNREADABLE = "is no note of an unfinished make; delete its folder, and make anew"
AHEAD = 4  # records in the queue of each worker


@dataclass(frozen=True)
class Numbers:
    """The numbers of a set: equal numbers give equal bytes."""

    seed: int
    records: int
    rigs: int
    version: int = DEFAULT

    def like(self, other: Numbers) -> bool:
        """Tell whether the other differs at most in its seed."""
        return replace(self, seed=other.seed) == other

    def __str__(self) -> str:
        """Return the numbers that are not secret."""
        return f"{self.records} records and {self.rigs} rigs of version {self.version}"


class KeptNumbers(Lenient):
    """The numbers of an unfinished make in its note."""

    seed: int = quantity("", ge=0)
    records: int = quantity("", ge=1)
    rigs: int = quantity("", ge=0)
    version: int = DEFAULT


@dataclass(frozen=True)
class Places:
    """The paths of a set: the folder of its records, and the file of its key."""

    folder: Path
    key: Path

    @property
    def parts(self) -> Path:
        """The folder of an unfinished make's notes."""
        return named(self.key).with_name(self.key.name + ".parts")


@dataclass(frozen=True)
class Made:
    """A finished set; `before`: an earlier call had finished it."""

    numbers: Numbers
    before: bool


def make(
    folder: Path,
    key: Path,
    seed: int | None,
    records: int,
    rigs: int,
    progress: Progress,
    *,
    version: int = DEFAULT,
    workers: int = 0,
    cluster: str = "",
) -> Made:
    """Write a set of trials into `folder` and their key to `key`.

    The records of an interrupted make of the same numbers are kept, and the rest is made. The same
    seed gives the same bytes with any number of workers (0: one for each core), or from a dask
    `cluster`; by default the seed is random, and written to the key only. Raises InputError for a
    folder with anything else, including a set of other numbers.
    """
    places = Places(folder, key)
    read_deck(version)
    asked = Numbers(secrets.randbits(62) if seed is None else seed, records, rigs, version)
    done = _finished(places, asked, seed is None)
    if done is not None:
        _clear(places)
        return Made(done, before=True)
    numbers = _begin(places, asked, seed is None)
    with executor(cores(workers), cluster) as pool:
        _make(places, numbers, progress, pool, AHEAD * cores(workers))
    return Made(numbers, before=False)


def _make(
    places: Places, numbers: Numbers, progress: Progress, workers: Executor, ahead: int
) -> None:
    deck, pool = drawn(numbers)
    for name, rig in pool.items():
        remark = "The nominal rig: what a record's real one is held against"
        write_text(places.folder / RIGS / f"{name}.toml", rig_text(rig, remark))
    todo = plans(np.random.default_rng([numbers.seed, 1]), numbers.records, deck)
    names = [record_name(i) for i in range(numbers.records)]
    truths: dict[str, Truth] = {}
    progress("records", 0, numbers.records)
    for name, truth in _trials(places, numbers, todo, workers, ahead):
        truths[name] = truth
        progress(f"{name} made", len(truths), numbers.records)
    listed = "".join(f'{name} = "{truths[name].rig}"\n' for name in names)
    write_text(places.folder / LIST, "# record = rig file (rigs/NAME.toml)\n" + listed)
    salt = np.random.default_rng([numbers.seed, 2]).bytes(32).hex()
    text = Key(numbers.version, numbers.seed, salt, truths).text()
    write_text(places.key, text)
    seal = Seal(digest(text), numbers.version, numbers.records, numbers.rigs)
    write_text(places.folder / SEAL, seal.text())
    _clear(places)


def _trials(
    places: Places, numbers: Numbers, todo: list[Plan], workers: Executor, ahead: int
) -> Iterator[tuple[str, Truth]]:
    """Yield each record's name and truth, once both are written; existing ones are kept."""
    lacking = []
    for i, plan in enumerate(todo):
        name = record_name(i)
        path, note = places.folder / RECORDS / f"{name}.csv", places.parts / f"{name}.json"
        if path.is_file() and note.is_file():
            yield name, truth_from(read_json(note, UNREADABLE), note)
        else:
            lacking.append((numbers, i, plan))
    for i, truth, text in as_done(workers, make_one, lacking, ahead):
        name = record_name(i)
        write_text(places.folder / RECORDS / f"{name}.csv", text)
        write_text(places.parts / f"{name}.json", json.dumps(truth.as_dict(), sort_keys=True))
        yield name, truth


def record_name(i: int) -> str:
    """Return the name of a set's record, counted from 0."""
    return f"r{i + 1:03d}"


def make_one(numbers: Numbers, i: int, plan: Plan) -> tuple[int, Truth, str]:
    """Return a record's number and truth, and the record as CSV."""
    deck, pool = drawn(numbers)
    seed = (numbers.seed, 3, i)
    trial = draw_trial(np.random.default_rng(seed), plan, deck, pool)
    return i, replace(trial.truth, seed=seed), csv_text(trial.record)


@lru_cache(maxsize=1)
def drawn(numbers: Numbers) -> tuple[Deck, Mapping[str, Rig]]:
    """Return the deck of a set and its rigs, cached in each worker."""
    deck = read_deck(numbers.version)
    others = numbers.rigs if deck.whole is None else 0
    return deck, rig_pool(deck.rigs, numbers.seed, others)


def _finished(places: Places, asked: Numbers, any_seed: bool) -> Numbers | None:
    """Return the numbers of a finished set at these paths, None if there is none.

    Refuses a finished set of other numbers, and one without its key.
    """
    seal_file = places.folder / SEAL
    if not seal_file.is_file():
        return None
    seal = read_seal(seal_file)
    if seal.records is None or seal.rigs is None:
        problem = "contains trials of an older version, whose seal lacks records and rigs"
        raise InputError(places.folder, "", f"{problem}; give a new folder")
    if not places.key.is_file():
        problem = f"holds a finished set, whose key is not {places.key}"
        raise InputError(places.folder, "", f"{problem}; give --key, or a new folder")
    if digest(read_text(places.key, "the key of coupled blind make is wanted")) != seal.key_sha256:
        raise InputError(places.key, "", f"is not the key that {seal_file} seals")
    made = Numbers(read_key(places.key).seed, seal.records, seal.rigs, seal.version)
    if not made.like(asked) or not (any_seed or made == asked):
        other = f"{made}" if not made.like(asked) else f"{made}, by another seed"
        raise InputError(
            places.folder, "", f"is not empty: it holds a finished set of {other}; give a new one"
        )
    return made


def _begin(places: Places, asked: Numbers, any_seed: bool) -> Numbers:
    """Check the paths, and return the numbers: those of an unfinished make, or those requested."""
    note = places.parts / NOTE
    if note.is_file():
        kept = read_as(KeptNumbers, read_json(note, UNREADABLE), note)
        begun = Numbers(kept.seed, kept.records, kept.rigs, kept.version)
        if not begun.like(asked) or not (any_seed or begun == asked):
            raise InputError(
                places.folder,
                "",
                f"holds an unfinished make of {begun}; finish it with the same numbers,"
                " or give another folder",
            )
        return begun
    if places.folder.is_dir() and any(places.folder.iterdir()):
        raise InputError(places.folder, "", "is not empty; give a new folder")
    if places.key.exists():
        raise InputError(places.key, "--key", "is there already; a key is never overwritten")
    check_targets([places.key, places.folder / SEAL], made=places.folder)
    write_text(note, json.dumps(asdict(asked)))
    return asked


def _clear(places: Places) -> None:
    """Remove the notes of an unfinished make, the one that identifies it last."""
    if not places.parts.is_dir():
        return
    for part in sorted(places.parts.iterdir(), key=lambda part: part.name == NOTE):
        part.unlink()
    places.parts.rmdir()
