"""Blind keys and answers, rig and run files, damaged in structured ways: a result, or one line."""

from __future__ import annotations

import copy
import json
import random
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import tomlkit

import coupled
from coupled.blind.trials.answers import read_answers
from coupled.blind.trials.key import check_seal, digest, read_key
from coupled.blind.trials.score import score
from coupled.flight.runfile import manoeuvres_from_table
from coupled.gap.findings.result import diagnosis_from
from coupled.resources import shipped_rigs, shipped_runs
from coupled.rig.rigfile import read_rig, rig_from_table
from tests.support.wrong import PLAIN, damaged, unexpected

CASES = Path(__file__).parents[1] / "data" / "cases" / "robust"
SET = CASES / "key"


def ends(work: Callable[[], Any]) -> str:
    """Return how what is done ends, where it is neither a result nor a line."""
    try:
        work()
    except Exception as error:
        return unexpected(error)
    return ""


def scored(folder: Path, key: Any, answer: Any, seal: str | None = None) -> str:
    """Score a key and an answer as the command does, JSON and all; return a traceback's line."""
    text = json.dumps(key)
    (folder / "key.json").write_text(text)
    sealed = f'format = 1\ntrials = 4\nkey_sha256 = "{digest(text)}"\n' if seal is None else seal
    (folder / "seal.toml").write_text(sealed)
    (folder / "ans").mkdir(exist_ok=True)
    (folder / "ans" / "r001.json").write_text(json.dumps(answer))

    def work() -> None:
        check_seal(folder / "key.json", folder / "seal.toml")
        found = score(read_answers(folder / "ans", read_key(folder / "key.json"))).as_dict()
        json.dumps(found, allow_nan=False)

    return ends(work)


def sound() -> tuple[Any, Any]:
    """Return a key of one record, and its answer."""
    return json.loads((SET / "key.json").read_text()), json.loads((SET / "r001.json").read_text())


def wrong_keys(folder: Path, count: int, seed: int) -> list[str]:
    rng, found = random.Random(seed), []
    for number in range(count):
        key, answer = sound()
        if number % 2:
            key = damaged(key, rng)
        else:
            answer = damaged(answer, rng)
        if said := scored(folder, key, answer):
            found.append(f"{number}: {said}")
    return found


def wrong_seals(folder: Path, count: int, seed: int) -> list[str]:
    rng, found = random.Random(seed), []
    values = tuple(value for value in PLAIN if value is not None)
    for number in range(count):
        key, answer = sound()
        table: dict[str, Any] = {"format": 1, "trials": 4, "records": 1, "rigs": 0}
        table["key_sha256"] = digest(json.dumps(key))
        wrong = damaged(table, rng, values)
        try:
            text = tomlkit.dumps(wrong) if isinstance(wrong, dict) else str(wrong)
        except (ValueError, TypeError):
            continue
        if said := scored(folder, key, answer, text):
            found.append(f"{number}: {said}")
    return found


def wrong_rigs(count: int, seed: int) -> list[str]:
    rng, found = random.Random(seed), []
    tables = [tomllib.loads(path.read_text()) for path in shipped_rigs().values()]
    for number in range(count):
        table = damaged(rng.choice(tables), rng)
        if not isinstance(table, dict):
            continue
        if said := ends(partial(rig_from_table, table, Path("rig.toml"))):
            found.append(f"{number}: {said}")
    return found


def wrong_runs(count: int, seed: int) -> list[str]:
    rng, found = random.Random(seed), []
    tables = [tomllib.loads(path.read_text()) for path in shipped_runs().values()]
    for number in range(count):
        table = damaged(rng.choice(tables), rng)
        if not isinstance(table, dict):
            continue
        if said := ends(partial(manoeuvres_from_table, table, Path("run.toml"))):
            found.append(f"{number}: {said}")
    return found


def test_the_sound_key_is_scored(tmp_path: Path) -> None:
    key, answer = sound()
    assert scored(tmp_path, key, answer) == ""
    assert score(read_answers(tmp_path / "ans", read_key(tmp_path / "key.json"))).records == 1


def test_a_few_damaged_files_end_in_a_line(tmp_path: Path) -> None:
    assert wrong_keys(tmp_path, 150, seed=1) == []
    assert wrong_seals(tmp_path, 60, seed=2) == []
    assert wrong_rigs(60, seed=3) == []
    assert wrong_runs(30, seed=4) == []


@pytest.mark.slow
def test_many_damaged_files_end_in_a_line(tmp_path: Path) -> None:
    assert wrong_keys(tmp_path, 2000, seed=11) == []
    assert wrong_seals(tmp_path, 400, seed=12) == []
    assert wrong_rigs(1000, seed=13) == []
    assert wrong_runs(600, seed=14) == []


BROKEN_KEY = {
    "an infinite seed": (("records", "r001", "seed"), [float("inf")], "records.r001.seed.0"),
    "effects that are text": (("records", "r001", "effects"), "", "records.r001.effects"),
    "no effect of a single": (("records", "r001", "effects"), [], "records.r001.effects"),
    "a budget that is a number": (
        ("records", "r001", "budget"),
        {"linkage": 1},
        "records.r001.budget.linkage",
    ),
    "a class that is none": (("records", "r001", "class"), "singel", "records.r001.class"),
    "no salt": (("salt",), None, "salt"),
    "a record's name that leads elsewhere": (("records",), {"../x": {}}, "records.../x"),
}


@pytest.mark.parametrize("what", BROKEN_KEY)
def test_a_broken_key_names_its_place(tmp_path: Path, what: str) -> None:
    path, value, place = BROKEN_KEY[what]
    key, _ = sound()
    holder = key
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    (tmp_path / "key.json").write_text(json.dumps(key))
    with pytest.raises(coupled.InputError) as caught:
        read_key(tmp_path / "key.json")
    assert caught.value.key == place


BROKEN_ANSWER = {
    "a probability beyond all numbers": ("effects", 0, "probability", 10**400),
    "a probability above 1": ("effects", 0, "probability", 1.5),
    "a share that is text": ("budget", "linkage", "noise", "x"),
    "an infinite end": ("effects", 0, "parameters", {"factor": {"low": float("-inf")}}),
}


@pytest.mark.parametrize("what", BROKEN_ANSWER)
def test_a_broken_answer_names_its_place(what: str) -> None:
    first, second, third, value = BROKEN_ANSWER[what]
    _, answer = sound()
    answer = copy.deepcopy(answer)
    answer[first][second][third] = value
    with pytest.raises(coupled.InputError) as caught:
        diagnosis_from(answer, "r001.json")
    assert caught.value.key.startswith(f"{first}.{second}.{third}")


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("trials = 1", "trials: is 1, and the key that it seals has 4"),
        ("records = 2", "records: is 2, and the key that it seals has 1"),
        ("records = []", "records: "),
        ('rigs = "../x"', "rigs: "),
    ],
)
def test_a_seal_is_held_against_its_key(tmp_path: Path, line: str, says: str) -> None:
    text = (SET / "key.json").read_text()
    (tmp_path / "key.json").write_text(text)
    numbers = {"trials": "trials = 4", "records": "records = 1", "rigs": "rigs = 0"}
    numbers[line.split(maxsplit=1)[0]] = line
    seal = "\n".join(["format = 1", *numbers.values(), f'key_sha256 = "{digest(text)}"'])
    (tmp_path / "seal.toml").write_text(seal + "\n")
    with pytest.raises(coupled.InputError) as caught:
        check_seal(tmp_path / "key.json", tmp_path / "seal.toml")
    assert says in str(caught.value)


@pytest.mark.parametrize("name", ["\0", "a" * 300, "a\nb", "no/such"])
def test_a_model_folder_that_no_file_can_have_is_one_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / "rig.toml"
    table = tomlkit.loads(shipped_rigs()["t37"].read_text())
    table["flight"]["model_folder"] = name
    path.write_text(tomlkit.dumps(table))
    with pytest.raises(coupled.InputError, match=r"flight\.model_folder: ") as caught:
        read_rig(path)
    assert not unexpected(caught.value)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"name": "a/b"}, "name: should be letters, digits, dots, dashes and underscores"),
        ({"noise": 3}, "noise: should be a table, is 3"),
        ({"controls": {"column": {"schedule": 1}}}, "controls.column.schedule: should be a table"),
    ],
)
def test_a_fault_is_described_in_plain_words(table: dict[str, Any], says: str) -> None:
    whole = {**tomllib.loads(shipped_rigs()["bench"].read_text()), **table}
    with pytest.raises(coupled.InputError) as caught:
        rig_from_table(whole, "rig.toml")
    lines = [str(one) for one in caught.value.every]
    assert any(says in line for line in lines), lines
    assert not any(word in line for line in lines for word in ("pattern", "dictionary", "^["))
