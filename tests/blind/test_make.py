"""Trials written: the same bytes for a seed, taken up where they stopped, sealed."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from coupled.blind.trials import deck as decks
from coupled.blind.trials.deck import DEFAULT, KNOWN, VERSIONS, read_deck
from coupled.blind.trials.key import Seal, check_seal, digest, read_key, read_seal
from coupled.blind.trials.make import make
from coupled.blind.trials.rigs import rig_pool
from coupled.blind.trials.trial import SHARES, Plan, plans
from coupled.blind.trials.truth import truth_from
from coupled.blind.twin.effects import EFFECTS
from coupled.blind.twin.kinds import Kind
from coupled.blind.twin.outsiders import OUTSIDERS
from coupled.errors import InputError
from coupled.gap.chain import AIRFRAME
from coupled.gap.effects.airframe import AIRFRAME as AIRFRAMES
from coupled.gap.effects.library import BY_NAME
from coupled.gap.stages.airframe import airframe_outputs
from coupled.record.channels import CONTROL_NAMES
from coupled.record.record import read_record
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text
from coupled.schema import load_toml
from tests.support.commands import coupled, files
from tests.support.processes import begun, kill
from tests.support.twin import WITHOUT_TWIN

RECORDS, SEED = 3, 3
OF_COLUMNS = [version for version in KNOWN if read_deck(version).whole is None]
# Effects of the airframe that are newer than the newest version of the trials.
NEWER = {"pitching_moment", "lift_offset", "fuel", "yawing_moment", "side_force"}


def quiet(label: str, done: int, total: int) -> None:
    """Show nothing."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trials") / "set"
    make(folder, folder.with_name("set.key.json"), SEED, RECORDS, 2, quiet, workers=2)
    return folder


@pytest.fixture
def grown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Add a shipped rig, an effect and a fault outside the library."""
    shipped = tmp_path / "grown" / "aircraft"
    shutil.copytree(aircraft_folder(), shipped)
    text = (shipped / "bench" / "bench.toml").read_text()
    (shipped / "bench" / "another.toml").write_text(text.replace('"bench"', '"another"', 1))
    monkeypatch.setattr("coupled.resources._shipped", lambda kind: shipped.parent / kind)
    assert "another" in shipped_rigs()
    first, other = EFFECTS[0], OUTSIDERS[0]
    more = Kind("another", first.stage, first.least, first.most, first.install)
    beyond = Kind("beyond", other.stage, other.least, other.most, other.install)
    monkeypatch.setattr(decks, "EFFECTS", (more, *EFFECTS))
    monkeypatch.setattr(decks, "OUTSIDERS", (beyond, *OUTSIDERS))


def drawn(version: int, seed: int, records: int, rigs: int) -> tuple[list[Plan], list[str]]:
    """Return what a set of a version draws before anything is flown."""
    deck = read_deck(version)
    pool = rig_pool(deck.rigs, seed, rigs)
    planned = plans(np.random.default_rng([seed, 1]), records, deck)
    return planned, [rig_text(rig) for rig in pool.values()]


@pytest.mark.slow
def test_a_set_is_whole_and_gives_nothing_away(made: Path) -> None:
    listed = load_toml(made / "records.toml")
    key = read_key(made.with_name("set.key.json"))
    assert list(listed) == [f"r{i + 1:03d}" for i in range(RECORDS)] == sorted(key.records)
    for name, rig in listed.items():
        truth = key.records[name]
        record = read_record(made / "records" / f"{name}.csv")
        nominal = read_rig(made / "rigs" / f"{rig}.toml")
        assert truth.rig == rig == nominal.name
        assert truth.conditions is not None
        assert len(record) / nominal.frame_rate == pytest.approx(truth.conditions.duration_s)
        assert 20.0 <= truth.conditions.duration_s <= 60.0
        if AIRFRAME in truth.gap:  # the key's gaps are those of the file
            gap = max(output.gap(nominal) for output in airframe_outputs(nominal, record))
            assert gap == pytest.approx(truth.gap[AIRFRAME], rel=0.02)
    public = "".join(path.read_text() for path in made.rglob("*.toml"))
    assert key.salt not in public
    assert not made.with_name("set.key.json.parts").exists()


@pytest.mark.slow
def test_a_key_reads_back_as_it_was_written(made: Path) -> None:
    path = made.with_name("set.key.json")
    key = read_key(path)
    assert (key.version, key.seed) == (DEFAULT, SEED)
    assert key.text() == path.read_text()
    for truth in key.records.values():
        assert truth_from(json.loads(json.dumps(truth.as_dict())), path) == truth


@pytest.mark.slow
def test_the_seal_knows_its_key(made: Path, tmp_path: Path) -> None:
    key = made.with_name("set.key.json")
    check_seal(key, made / "seal.toml")
    other = tmp_path / "key.json"
    other.write_text(key.read_text().replace('"class": "', '"class":  "', 1))
    with pytest.raises(InputError, match="is not the key"):
        check_seal(other, made / "seal.toml")


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_whatever_is_shipped_and_after_a_stop(
    made: Path, tmp_path: Path, grown: None
) -> None:
    again, key = tmp_path / "set", tmp_path / "set.key.json"

    def stop(label: str, done: int, total: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(again, key, SEED, RECORDS, 2, stop, workers=1)
    assert not key.exists()
    for seed, records, rigs in ((SEED + 1, RECORDS, 2), (SEED, RECORDS, 3), (SEED, 4, 2)):
        with pytest.raises(InputError, match="unfinished make of 3 records and 2 rigs"):
            make(again, key, seed, records, rigs, quiet)
    make(again, key, None, RECORDS, 2, quiet, workers=1)  # takes up the seed too
    assert key.read_bytes() == made.with_name("set.key.json").read_bytes()
    assert files(again) == files(made)
    for name in files(made):
        assert (again / name).read_bytes() == (made / name).read_bytes(), name


@pytest.mark.parametrize(
    ("version", "plans_are"),
    [
        (1, "310f811c6c9ca4106aa41d0d99bb831d61abb29f17bd157e11afe68abc58eaaf"),
        (3, "9344992930de43cd1d77cdde8b1c8daf00b14fca4f6ffdebcbea42ee37420d6b"),
        (
            4,
            "9344992930de43cd1d77cdde8b1c8daf00b14fca4f6ffdebcbea42ee37420d6b",
        ),  # record for record
    ],
)
def test_each_version_draws_the_same_trials_as_when_it_was_frozen(
    grown: None, version: int, plans_are: str
) -> None:
    # Of the draws of seed 8 by the sources of which each version's first score is.
    planned, texts = drawn(version, 8, 400, 3)
    said = repr([(plan.category, plan.names) for plan in planned])
    assert hashlib.sha256(said.encode()).hexdigest() == plans_are
    assert len(texts) == 24
    digest_of_rigs = hashlib.sha256("".join(texts).encode()).hexdigest()
    assert digest_of_rigs == "b0317ea8e786518566b1668128427498092f356912d0812fddc91123d174eb3a"


@pytest.mark.parametrize("version", OF_COLUMNS)
def test_a_deck_is_whole(version: int) -> None:
    deck = read_deck(version)
    files_of_rigs = {p.stem for p in (VERSIONS / "v1" / "rigs").glob("*.toml")}
    assert set(deck.rigs) == files_of_rigs
    for name, rig in deck.rigs.items():
        assert rig.name == name
        assert set(rig.controls) == {"column"}
    names = [kind.name for kind in (*deck.effects, *deck.outsiders)]
    assert len(names) == len(set(names))


def test_the_newest_decks_have_every_effect_of_the_library() -> None:
    """A travel's stops, a missing servo and an imposed motion are in no deck.

    Nor are effects that are newer than the newest version, which is frozen.
    """
    whole = read_deck(DEFAULT).whole
    assert whole is not None
    known = {kind.name for kind in read_deck(max(OF_COLUMNS)).effects} | {*whole.airframe}
    every = set(BY_NAME) - (WITHOUT_TWIN - {one.name for one in AIRFRAMES})
    assert every - known == {"travel", "no_servo", *NEWER}


def test_the_deck_of_whole_aircraft_has_three_sizes_of_each_effect_on_four_models() -> None:
    deck = read_deck(DEFAULT)
    assert deck.whole is not None and len(deck.rigs) == 4
    assert {*deck.whole.airframe} == {one.name for one in AIRFRAMES} - NEWER
    for name, sizes in (*deck.whole.airframe.items(), *deck.whole.control.items()):
        parameter = BY_NAME[name].free[0]
        assert len(set(sizes)) == 3 and all(parameter.low < abs(s) < 1e3 for s in sizes), name
    for rig in deck.rigs.values():
        assert {*deck.whole.force_N[rig.name]} == {*rig.controls} == {*CONTROL_NAMES}
    planned = plans(np.random.default_rng(1), 200, deck)
    counts = Counter(plan.category for plan in planned)
    assert counts == {"none": 20, "single": 120, "pair": 60}
    singles = Counter(plan.names[0] for plan in planned if plan.names)
    assert set(singles) == {*deck.whole.airframe}
    assert max(singles.values()) - min(singles.values()) <= 2
    beside = {plan.names[1] for plan in planned if plan.category == "pair"}
    assert beside <= {*deck.whole.control}


@pytest.mark.slow
def test_a_finished_make_may_be_called_again(made: Path) -> None:
    key = made.with_name("set.key.json")
    before = {name: (made / name).read_bytes() for name in files(made)}
    words = ("blind", "make", str(made), "--seed", str(SEED), "--records", str(RECORDS))
    parts = made.with_name("set.key.json.parts")
    parts.mkdir()  # as one that was killed while it cleared up
    (parts / "make.json").write_text("{}")
    done = coupled(made.parent, *words, "--rigs", "2")
    assert done.returncode == 0, done.stderr
    assert "finished already" in done.stdout
    assert not parts.exists()
    for seed, records, rigs, version in (
        (SEED + 1, RECORDS, 2, DEFAULT),
        (SEED, RECORDS + 1, 2, DEFAULT),
        (SEED, RECORDS, 1, DEFAULT),
        *((SEED, RECORDS, 2, other) for other in KNOWN if other != DEFAULT),
    ):
        finished = f"a finished set of 3 records and 2 rigs of version {DEFAULT}"
        with pytest.raises(InputError, match=finished):
            make(made, key, seed, records, rigs, quiet, version=version)
    with pytest.raises(InputError, match="whose key is not"):
        make(made, made / "another.json", SEED, RECORDS, 2, quiet)
    assert {name: (made / name).read_bytes() for name in files(made)} == before
    again = make(made, key, None, RECORDS, 2, quiet)
    assert again.before
    assert again.numbers.seed == SEED


@pytest.mark.slow
def test_a_killed_make_goes_on(made: Path, tmp_path: Path) -> None:
    words = ("blind", "make", "set", "--seed", str(SEED), "--records", str(RECORDS), "--rigs", "2")
    folder = tmp_path / "set" / "records"
    process = begun(tmp_path, *words, until=lambda: any(folder.glob("r*.csv")))
    kill(process)
    assert not (tmp_path / "set" / "seal.toml").exists()
    done = coupled(tmp_path, *words, "-j", "2")
    assert done.returncode == 0, done.stderr
    assert files(tmp_path / "set") == files(made)
    for name in files(made):
        assert (tmp_path / "set" / name).read_bytes() == (made / name).read_bytes(), name


def test_an_unknown_version_is_refused(tmp_path: Path) -> None:
    done = coupled(tmp_path, "blind", "make", "set", "--trials", "99")
    assert done.returncode == 2
    assert "there is no version 99" in done.stderr
    assert files(tmp_path) == set()


def test_a_seal_of_another_format_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "seal.toml"
    sealed = Seal(digest("{}"), 1, 3, 2)
    path.write_text(sealed.text())
    assert read_seal(path) == sealed
    path.write_text(sealed.text().replace("format = 1", "format = 9"))
    with pytest.raises(InputError, match="format"):
        read_seal(path)
    path.write_text(sealed.text().replace("trials = 1", "trials = 99"))
    with pytest.raises(InputError, match="trials"):
        read_seal(path)
    path.write_text(f'key_sha256 = "{digest("{}")}"\n')  # as coupled 0.1.0 wrote it
    assert read_seal(path) == Seal(digest("{}"), 1, None, None)


def test_plans_keep_the_shares() -> None:
    planned = plans(np.random.default_rng(1), 300, read_deck(1))
    counts = Counter(plan.category for plan in planned)
    assert len(planned) == 300
    for kind, share in SHARES.items():
        assert counts[kind] == pytest.approx(300 * share, abs=2)
    singles = Counter(plan.names[0] for plan in planned if plan.category == "single")
    assert set(singles) == {kind.name for kind in read_deck(1).effects}
    assert max(singles.values()) - min(singles.values()) <= 2
    assert all(len(set(plan.names)) == 2 for plan in planned if plan.category == "pair")


@pytest.mark.slow
def test_a_folder_or_key_that_is_there_is_refused(made: Path, tmp_path: Path) -> None:
    key = made.with_name("set.key.json")
    before = key.read_bytes()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("")
    for folder in (str(made), "full"):
        done = coupled(tmp_path, "blind", "make", folder, "--seed", "1", "--records", "1")
        assert done.returncode == 2
        assert "is not empty" in done.stderr
    done = coupled(tmp_path, "blind", "make", "new", "--key", str(key), "--records", "1")
    assert done.returncode == 2
    assert "never overwritten" in " ".join(done.stderr.split())
    assert key.read_bytes() == before
    assert files(tmp_path) == {"full/mine.txt"}


FIRST = '"format": "coupled blind key 1", "seed": 1, "salt": "00"'


@pytest.mark.slow
def test_an_invalid_key_is_refused(made: Path, tmp_path: Path) -> None:
    for text, word in (
        ("{", "not JSON"),
        ("{}", "format"),
        ('{"format": "coupled blind key 99", "records": {}}', "coupled blind key 1"),
        (f"{{{FIRST}}}", "records"),
        (f'{{{FIRST}, "records": {{"r001": {{}}}}}}', "r001"),
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
