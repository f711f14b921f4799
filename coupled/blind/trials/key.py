"""The key of a set of trials, and the seal that proves which key it was.

A key's format has the version of its trials. A seal is stored with the records, and has the
version and the numbers of its set besides the key's hash.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from coupled.blind.trials.deck import KNOWN
from coupled.blind.trials.truth import Truth, truth_from
from coupled.errors import InputError, collected, together
from coupled.files import check_format, read_json, read_text
from coupled.rig.parameters import PLAIN_NAME
from coupled.schema import Lenient, load_toml, quantity, read_as, text_like

FORMATS = {f"coupled blind key {version}": version for version in KNOWN}
SEAL_FORMAT = 1
SEAL = "seal.toml"


class KeptKey(Lenient):
    """The tables of a key's file."""

    seed: int
    salt: str
    records: dict[str, Any] = quantity("", min_length=1)


class KeptSeal(Lenient):
    """The keys of a seal's file."""

    trials: int = 1
    records: int | None = quantity("", None, ge=1)
    rigs: int | None = quantity("", None, ge=0)
    key_sha256: Annotated[str, text_like("[0-9a-f]{64}", "should be the hash of the key")]


@dataclass(frozen=True)
class Key:
    """The truth of every record of a set; `salt` prevents guessing it from its hash."""

    version: int
    seed: int
    salt: str
    records: Mapping[str, Truth]

    def text(self) -> str:
        """Return the text of the key's file."""
        [name] = [name for name, version in FORMATS.items() if version == self.version]
        records = {record: truth.as_dict() for record, truth in self.records.items()}
        table = {"format": name, "salt": self.salt, "seed": self.seed, "records": records}
        return json.dumps(table, indent=1, sort_keys=True) + "\n"


@dataclass(frozen=True)
class Seal:
    """The seal of a set, stored with the records: the key's hash, and the numbers of the set.

    A seal without a format is of version 1, and has None for the numbers.
    """

    key_sha256: str
    version: int = 1
    records: int | None = None
    rigs: int | None = None

    def text(self) -> str:
        """Return the text of the seal's file."""
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
    kept = read_as(KeptKey, table, path)
    truths: dict[str, Truth] = {}
    faults: list[InputError] = []
    for name, entry in kept.records.items():
        with collected(faults):
            if not re.fullmatch(PLAIN_NAME, name):
                raise InputError(path, f"records.{name}", "is no record's name, as r001")
            truths[name] = truth_from(entry, path, f"records.{name}")
    if faults:
        raise together(faults)
    return Key(FORMATS[given], kept.seed, kept.salt, truths)


def read_seal(path: Path) -> Seal:
    """Return the seal of a set. Raises InputError."""
    table = load_toml(path)
    check_format(table.get("format"), SEAL_FORMAT, path, "seal")
    kept = read_as(KeptSeal, table, path)
    if kept.trials not in KNOWN:
        problem = f"is {kept.trials}; this version of coupled has {', '.join(map(str, KNOWN))}"
        raise InputError(path, "trials", problem)
    return Seal(kept.key_sha256, kept.trials, kept.records, kept.rigs)


def check_seal(key: Path, seal: Path) -> None:
    """Refuse a key that is not the sealed one, and a seal whose numbers differ from the key's.

    The seal's `rigs` cannot be checked, since a key has only the rigs of its records.
    """
    sealed = read_seal(seal)
    if sealed.key_sha256 != digest(read_text(key, "the key of coupled blind make is wanted")):
        raise InputError(key, "", f"is not the key that {seal} seals: one of them was changed")
    known = read_key(key)
    for name, said, held in (
        ("trials", sealed.version, known.version),
        ("records", sealed.records, len(known.records)),
    ):
        if said is not None and said != held:
            raise InputError(seal, name, f"is {said}, and the key that it seals has {held}")
