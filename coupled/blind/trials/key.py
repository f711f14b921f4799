"""The key of a set of trials, and the seal that proves which key it was.

A key's format bears the version of its trials; a seal, which lies with the records, names the
version and the numbers of its set besides the key's hash.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupled.blind.trials.deck import KNOWN
from coupled.blind.trials.truth import Truth, truth_from
from coupled.errors import InputError
from coupled.files import check_format, read_json, read_text
from coupled.schema import MOST_TOML_bytes

FORMATS = {f"coupled blind key {version}": version for version in KNOWN}
SEAL_FORMAT = 1
SEAL = "seal.toml"


@dataclass(frozen=True)
class Key:
    """The truth of every record of a set; `salt` keeps it from being guessed by its hash."""

    version: int
    seed: int
    salt: str
    records: Mapping[str, Truth]

    def text(self) -> str:
        """Return the key as its file has it."""
        [name] = [name for name, version in FORMATS.items() if version == self.version]
        records = {record: truth.as_dict() for record, truth in self.records.items()}
        table = {"format": name, "salt": self.salt, "seed": self.seed, "records": records}
        return json.dumps(table, indent=1, sort_keys=True) + "\n"


@dataclass(frozen=True)
class Seal:
    """What lies with the records: the key's hash, and the numbers that the set was made by.

    A seal from before it had a format is of version 1, and has None for the numbers.
    """

    key_sha256: str
    version: int = 1
    records: int | None = None
    rigs: int | None = None

    def text(self) -> str:
        """Return the seal as its file has it."""
        return (
            "# The hash of the key to these records. Publish it before the key is opened:\n"
            "# diagnoses made meanwhile are then proven to be made without it.\n"
            f"format = {SEAL_FORMAT}\n"
            f"trials = {self.version}\n"
            f"records = {self.records}\n"
            f"rigs = {self.rigs}\n"
            f'key_sha256 = "{self.key_sha256}"\n'
        )


def digest(key: str) -> str:
    """Return the hash of a key's text."""
    return hashlib.sha256(key.encode()).hexdigest()


def read_key(path: Path) -> Key:
    """Return the key of a file. Raises InputError."""
    table = read_json(path, "the key of coupled blind make is wanted")
    given = table.get("format") if isinstance(table, dict) else None
    if not isinstance(given, str) or given not in FORMATS:
        known = " or ".join(map(repr, FORMATS))
        raise InputError(path, "format", f"should be {known}; coupled blind make writes it")
    records = table.get("records")
    if not isinstance(records, dict) or not records:
        raise InputError(path, "records", "is missing or empty")
    truths = {name: _truth(path, name, entry) for name, entry in records.items()}
    try:
        return Key(FORMATS[given], int(table["seed"]), str(table["salt"]), truths)
    except (KeyError, TypeError, ValueError):
        raise InputError(path, "seed", "needs seed and salt, as coupled blind make wrote") from None


def _truth(path: Path, name: str, entry: Any) -> Truth:
    try:
        return truth_from(entry)
    except (KeyError, TypeError, ValueError, AttributeError):
        problem = "is no entry of a key as coupled blind make writes it"
        raise InputError(path, f"records.{name}", problem) from None


def read_seal(path: Path) -> Seal:
    """Return the seal of a set. Raises InputError."""
    text = read_text(path, "the seal of coupled blind make is wanted", MOST_TOML_bytes)
    try:
        table = tomllib.loads(text)
    except ValueError:
        raise InputError(
            path, "", "is not valid TOML; the seal of coupled blind make is wanted"
        ) from None
    check_format(table.get("format"), SEAL_FORMAT, path, "seal")
    version = table.get("trials", 1)
    if version not in KNOWN:
        problem = f"this coupled knows trials of version {', '.join(map(str, KNOWN))}"
        raise InputError(path, "trials", problem)
    sealed = table.get("key_sha256")
    if not isinstance(sealed, str):
        raise InputError(path, "key_sha256", "is missing")
    return Seal(sealed, version, table.get("records"), table.get("rigs"))


def check_seal(key: Path, seal: Path) -> None:
    """Refuse a key that is not the sealed one."""
    sealed = read_seal(seal).key_sha256
    if sealed != digest(read_text(key, "the key of coupled blind make is wanted")):
        raise InputError(key, "", f"is not the key that {seal} seals: one of them was changed")
