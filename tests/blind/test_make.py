"""Trials written: the same bytes for a seed, taken up where they stopped, sealed."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from coupled.blind.trials.key import check_seal, read_key
from coupled.blind.trials.make import make
from coupled.blind.trials.measure import stage_gaps
from coupled.blind.trials.trial import SHARES, plans
from coupled.blind.twin.effects import EFFECTS
from coupled.errors import InputError
from coupled.record.record import read_record
from coupled.rig.rigfile import read_rig
from coupled.schema import load_toml
from tests.test_cli import coupled, files

RECORDS, SEED = 3, 3


def quiet(label: str, done: int, total: int) -> None:
    """Show nothing."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trials") / "set"
    make(folder, folder.with_name("set.key.json"), SEED, RECORDS, 2, quiet)
    return folder


def test_a_set_is_whole_and_tells_nothing(made: Path) -> None:
    listed = load_toml(made / "records.toml")
    key = read_key(made.with_name("set.key.json"))
    assert list(listed) == [f"r{i + 1:03d}" for i in range(RECORDS)] == sorted(key["records"])
    for name, rig in listed.items():
        truth = key["records"][name]
        record = read_record(made / "records" / f"{name}.csv")
        nominal = read_rig(made / "rigs" / f"{rig}.toml")
        assert truth["rig"] == rig == nominal.name
        assert 20.0 <= len(record) / nominal.frame_rate <= 60.0
        if not truth["missing"]:  # the key's gaps are those of the file
            gaps = stage_gaps(nominal, record)
            assert gaps == pytest.approx(truth["gap"], rel=1e-9)
    told = "".join(path.read_text() for path in made.rglob("*.toml"))
    assert str(key["salt"]) not in told
    assert not made.with_name("set.key.json.parts").exists()


def test_the_seal_knows_its_key(made: Path, tmp_path: Path) -> None:
    key = made.with_name("set.key.json")
    check_seal(key, made / "seal.toml")
    other = tmp_path / "key.json"
    other.write_text(key.read_text().replace('"class": "', '"class":  "', 1))
    with pytest.raises(InputError, match="is not the key"):
        check_seal(other, made / "seal.toml")


def test_the_same_seed_gives_the_same_bytes_also_after_a_stop(made: Path, tmp_path: Path) -> None:
    again, key = tmp_path / "set", tmp_path / "set.key.json"

    def stop(label: str, done: int, total: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(again, key, SEED, RECORDS, 2, stop)
    assert not key.exists()
    with pytest.raises(InputError, match="unfinished make"):
        make(again, key, SEED + 1, RECORDS, 2, quiet)
    make(again, key, None, RECORDS, 2, quiet)  # takes up the seed too
    assert key.read_bytes() == made.with_name("set.key.json").read_bytes()
    assert files(again) == files(made)
    for name in files(made):
        assert (again / name).read_bytes() == (made / name).read_bytes(), name


def test_plans_keep_the_shares() -> None:
    drawn = plans(np.random.default_rng(1), 300)
    counts = Counter(plan.kind for plan in drawn)
    assert len(drawn) == 300
    for kind, share in SHARES.items():
        assert counts[kind] == pytest.approx(300 * share, abs=2)
    singles = Counter(plan.names[0] for plan in drawn if plan.kind == "single")
    assert set(singles) == {kind.name for kind in EFFECTS}
    assert max(singles.values()) - min(singles.values()) <= 2
    assert all(len(set(plan.names)) == 2 for plan in drawn if plan.kind == "pair")


def test_a_folder_or_key_that_is_there_is_refused(made: Path, tmp_path: Path) -> None:
    key = made.with_name("set.key.json")
    before = key.read_bytes()
    done = coupled(tmp_path, "blind", "make", str(made), "--seed", "1", "--records", "1")
    assert done.returncode == 2
    assert "is not empty" in done.stderr
    done = coupled(tmp_path, "blind", "make", "new", "--key", str(key), "--records", "1")
    assert done.returncode == 2
    assert "never overwritten" in " ".join(done.stderr.split())
    assert key.read_bytes() == before
    assert files(tmp_path) == set()


def test_a_key_that_is_none_is_refused(made: Path, tmp_path: Path) -> None:
    for text, word in (
        ("{", "not JSON"),
        ("{}", "format"),
        ('{"format": "coupled blind key 1"}', "records"),
    ):
        path = tmp_path / "key.json"
        path.write_text(text)
        with pytest.raises(InputError, match=word):
            read_key(path)
    with pytest.raises(InputError, match="cannot be read"):
        check_seal(made.with_name("set.key.json"), tmp_path / "none.toml")
    shutil.copy(made / "seal.toml", tmp_path / "seal.toml")
    (tmp_path / "seal.toml").write_text("= 1")
    with pytest.raises(InputError, match="not valid TOML"):
        check_seal(made.with_name("set.key.json"), tmp_path / "seal.toml")
    assert json.loads(made.with_name("set.key.json").read_text())["seed"] == SEED
