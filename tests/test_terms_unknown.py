"""A rig file with a term that its aircraft lacks: each command names the file and the key."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled import load_rig
from coupled.authority.maps import feel
from coupled.errors import InputError
from coupled.resources import shipped_rigs
from tests.support.commands import ROOT, coupled

KEY = "flight.terms.aero/coefficient/NOPE"
LOG = ROOT / "tests" / "data" / "JSBout.csv"


@pytest.fixture
def filed(tmp_path: Path) -> Path:
    """A Cessna's rig file, named otherwise than the rig."""
    text = shipped_rigs()["c172p"].read_text(encoding="utf-8")
    file = tmp_path / "mine.toml"
    file.write_text(f'{text}\n[flight.terms]\n"aero/coefficient/NOPE" = 0.5\n', encoding="utf-8")
    return file


def test_a_diagnosis_and_a_new_run_name_the_rig_file(tmp_path: Path, filed: Path) -> None:
    assert coupled(tmp_path, "import", str(LOG), "-o", "record.csv").returncode == 0
    for words in (("diagnose", "record.csv", "--rig"), ("new", "run", "r.toml", "--rig")):
        done = coupled(tmp_path, *words, filed.name)
        assert done.returncode == 2
        assert done.stderr.startswith(f"error: {filed.name}: {KEY}: c172p has no aerodynamic")
    assert not (tmp_path / "r.toml").exists()


def test_a_map_does_not_take_it_for_an_aircraft_without_trim(filed: Path) -> None:
    with pytest.raises(InputError) as fault:
        feel(load_rig(filed), filed, lambda what, done, total: None)
    assert (fault.value.file, fault.value.key) == (str(filed), KEY)
