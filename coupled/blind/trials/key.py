"""The key of a set of trials, and the seal that proves which key it was."""

from __future__ import annotations

import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any

from coupled.errors import InputError

FORMAT = "coupled blind key 1"
SEAL = "seal.toml"


def key_text(salt: str, seed: int, truths: dict[str, Any]) -> str:
    """Return a key's text: the truth of every record, and a salt so that it cannot be guessed."""
    key = {"format": FORMAT, "salt": salt, "seed": seed, "records": truths}
    return json.dumps(key, indent=1, sort_keys=True) + "\n"


def seal_text(key: str) -> str:
    """Return the seal of a key: its hash and nothing else of it."""
    digest = hashlib.sha256(key.encode()).hexdigest()
    return (
        "# The hash of the key to these records. Publish it before the key is opened:\n"
        "# diagnoses made meanwhile are then proven to be made without it.\n"
        f'key_sha256 = "{digest}"\n'
    )


def read_key(path: Path) -> dict[str, Any]:
    """Return a key's table, once it is one. Raises InputError."""
    try:
        key = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise InputError(path, "", "is not JSON; the key of coupled blind make is wanted") from None
    if not isinstance(key, dict) or key.get("format") != FORMAT:
        raise InputError(path, "format", f"should be {FORMAT!r}; coupled blind make writes it")
    if not isinstance(key.get("records"), dict) or not key["records"]:
        raise InputError(path, "records", "is missing or empty")
    return key


def check_seal(key: Path, seal: Path) -> None:
    """Refuse a key that is not the sealed one."""
    try:
        sealed = tomllib.loads(seal.read_text(encoding="utf-8")).get("key_sha256")
    except OSError as error:
        raise InputError(seal, "", f"cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise InputError(
            seal, "", "is not valid TOML; the seal of coupled blind make is wanted"
        ) from None
    if sealed != hashlib.sha256(key.read_bytes()).hexdigest():
        raise InputError(key, "", f"is not the key that {seal} seals: one of them was changed")
