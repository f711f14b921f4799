"""Scores of hand-made diagnoses against their known values."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from coupled.blind.trials.answers import Answer, FoundEffect, Interval, read_answers
from coupled.blind.trials.key import Key, Seal, digest, read_key
from coupled.blind.trials.result import Share
from coupled.blind.trials.score import score, share
from coupled.blind.trials.truth import Reading, Sizes, TrueEffect, Truth
from coupled.errors import InputError
from tests.support.commands import coupled, files

Table = dict[str, Any]
FACTOR = {
    "inertia": {"factor": 1.4},
    "viscous_damping": {"factor": 1.2},
    "bend": {"bend_m_per_N": 9e-5},
}
STAGE = {
    "stiffening_bend": "linkage",
    "inertia": "loader",
    "viscous_damping": "loader",
    "bend": "linkage",
    "cogging": "loader",
}
STAGE |= {"stribeck_friction": "loader"}


def truth(category: str, *names: str, ratio: float = 5.0, missing: tuple[str, ...] = ()) -> Truth:
    return Truth(
        category,
        "x",
        effects=tuple(TrueEffect(n, STAGE[n], FACTOR.get(n, {})) for n in names),
        stages=tuple(sorted({STAGE[n] for n in names})),
        missing=missing,
        sizes=Sizes({}, (ratio,), ratio) if names else None,
    )


def diagnosis(verdict: str, *names: str, off: float = 0.0, rivals: Any = (), **more: Any) -> Table:
    effects = []
    for name in names:
        values = {
            key: {"value": v * (1 + off), "low": v * (0.99 + off), "high": v * (1.01 + off)}
            for key, v in FACTOR.get(name, {}).items()
        }
        effects.append(
            {"name": name, "stage": STAGE[name], "probability": 0.9, "parameters": values}
        )
    stages: Table = {stage: {"gap": 1.0, "guilty": False} for stage in ("loader", "linkage")}
    for name in names:
        stages[STAGE[name]]["guilty"] = True
    for stage in more.get("guilty", ()):
        stages[stage]["guilty"] = True
    if "missing" in more:
        stages["surface"] = {"judged": False, "missing": more["missing"]}
    return {
        "verdict": verdict,
        "effects": effects,
        "stages": stages,
        "rivals": list(rivals),
        "shrink": {"closed": more.get("closed", 0.99)},
    }


CASES: list[tuple[Truth, Table | None]] = [
    (truth("single", "inertia"), diagnosis("effect", "inertia")),
    (truth("single", "inertia"), diagnosis("effect", "inertia", off=0.1, closed=0.9)),
    (
        truth("single", "inertia"),
        diagnosis("ambiguous", "viscous_damping", rivals=[["viscous_damping", "inertia"]]),
    ),
    (truth("single", "inertia"), diagnosis("effect", "viscous_damping")),
    (truth("single", "bend", ratio=1.2), diagnosis("no_gap")),
    (truth("single", "bend", ratio=1.2), diagnosis("effect", "inertia")),
    (truth("single", "bend", ratio=1.2), diagnosis("unexplained", guilty=["linkage"])),
    (truth("single", "bend"), None),
    (truth("none"), diagnosis("no_gap")),
    (truth("none"), diagnosis("effect", "bend")),
    (truth("outsider", "cogging"), diagnosis("unexplained", guilty=["loader"])),
    (truth("outsider", "cogging"), diagnosis("effect", "inertia")),
    (truth("pair", "inertia", "bend"), diagnosis("effect", "bend", "inertia")),
    (truth("pair", "inertia", "bend"), diagnosis("effect", "bend")),
    (truth("pair", "inertia", "bend"), diagnosis("unexplained", "bend", "inertia")),
    (
        truth("lacking", "bend", missing=("elevator_rad",)),
        diagnosis("effect", "bend", missing=["elevator_rad"]),
    ),
    (truth("lacking", "bend", missing=("elevator_rad",)), diagnosis("effect", "bend")),
]


@pytest.fixture
def trials(tmp_path: Path) -> Path:
    """Return a folder with key, seal and diagnoses."""
    names = [f"r{i + 1:03d}" for i in range(len(CASES))]
    text = Key(1, 1, "salt", {n: t for n, (t, _) in zip(names, CASES, strict=True)}).text()
    (tmp_path / "set.key.json").write_text(text)
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "seal.toml").write_text(Seal(digest(text), 1, len(CASES), 0).text())
    (tmp_path / "answers").mkdir()
    for name, (_, found) in zip(names, CASES, strict=True):
        if found is not None:
            (tmp_path / "answers" / f"{name}.json").write_text(json.dumps(found))
    return tmp_path


def test_a_score_counts_every_kind_of_trial(trials: Path) -> None:
    found = score(read_answers(trials / "answers", read_key(trials / "set.key.json"))).as_dict()
    shares = {
        (group, name): (value["right"], value["of"])
        for group in found
        if isinstance(found[group], dict)
        for name, value in found[group].items()
        if isinstance(value, dict) and "share" in value
    }
    assert shares == {
        ("clear_singles", "named"): (2, 5),
        ("clear_singles", "named_or_in_the_set"): (3, 5),
        ("clear_singles", "stage"): (4, 5),
        ("clear_singles", "wrong"): (1, 5),
        ("faint_singles", "right"): (0, 3),
        ("faint_singles", "no_gap"): (1, 3),
        ("faint_singles", "undecided"): (1, 3),
        ("faint_singles", "wrong"): (1, 3),
        ("no_gap", "false_alarms"): (1, 2),
        ("outsiders", "unexplained"): (1, 2),
        ("outsiders", "stage"): (2, 2),
        ("outsiders", "false_attributions"): (1, 2),
        ("pairs", "whole"): (1, 3),
        ("pairs", "whole_or_in_the_set"): (1, 3),
        ("pairs", "stages"): (2, 3),
        ("lacking", "lack_said"): (1, 2),
        ("intervals", "covered"): (3, 4),
        ("budget", "within_5_points"): (0, 0),
    }
    assert (found["closed"]["right"], found["closed"]["of"]) == (2, 3)
    assert (found["records"], found["missing"]) == (17, 1)
    probabilities = found["probabilities"]
    true, false = 9, 6  # effects found that are there, and that are not
    assert probabilities["effects"] == true + false - 1
    assert found["effects"]["inertia"]["instead"] == {
        "ambiguous: viscous_damping": 1,
        "effect: viscous_damping": 1,
    }
    assert sum(row["of"] for row in found["power"]) == 8
    assert found["power"][-1]["right"] == 2


RUBS, YIELDS = Reading(("yields",), ("loader",), True), Reading(("zero",), ("sensing",), False)


@pytest.mark.parametrize(
    ("verdict", "names", "rivals", "exact", "stage"),
    [
        ("effect", ("inertia",), (), True, True),
        ("effect", ("yields",), (), True, True),  # the same law, whatever is recorded
        ("effect", ("zero",), (), False, True),  # on this record alone: no reason to be sure
        ("ambiguous", ("zero",), [["zero", "inertia"]], True, True),
        ("ambiguous", ("zero",), [["zero", "yields"]], True, True),
        ("ambiguous", ("zero",), [["zero", "inertia", "bend"]], False, True),
        ("effect", ("inertia", "yields"), (), False, True),
        ("effect", ("bend",), (), False, False),
    ],
)
def test_other_readings_of_a_truth(
    verdict: str, names: tuple[str, ...], rivals: Any, exact: bool, stage: bool
) -> None:
    stages = {"zero": "sensing", "bend": "linkage"}
    found = {name: FoundEffect(0.9, {}) for name in names}
    possible = frozenset(found) | {name for group in rivals for name in group}
    guilty = frozenset(stages.get(name, "loader") for name in names)
    known = replace(truth("single", "inertia"), readings=(RUBS, YIELDS))
    answer = Answer("r", known, verdict, found, possible, guilty, frozenset(), 0.99)
    assert (answer.exact, answer.stage_right) == (exact, stage)


@pytest.mark.parametrize(
    ("friction", "exact"),
    [("coulomb_friction", True), ("presliding_friction", True), ("load_friction", False)],
)
def test_a_reading_goes_by_all_of_its_names(friction: str, exact: bool) -> None:
    """A breakaway that the record does not show is plain friction, and so friction that yields."""
    plain = Reading(("bend", "coulomb_friction"), ("linkage", "loader"), True)
    known = replace(truth("pair", "bend", "stribeck_friction"), readings=(plain,))
    found = {name: FoundEffect(0.9, {}) for name in ("bend", friction)}
    stages = frozenset(("linkage", "loader"))
    answer = Answer("r", known, "effect", found, frozenset(found), stages, frozenset(), 0.99)
    assert answer.exact == exact


def test_a_budgets_shares_are_held_against_the_twins_own() -> None:
    known = replace(
        truth("pair", "inertia", "bend"),
        budget={"loader": {"inertia": 0.9, "bend": 0.0}, "linkage": {"bend": 0.8}},
        readings=(Reading(("bend", "yields"), ("linkage", "loader"), True),),
    )
    for names, loader, right in ((("inertia", "bend"), 0.94, 2), (("yields", "bend"), 0.83, 1)):
        found = {name: FoundEffect(0.9, {}) for name in names}
        shares = {"loader": {names[0]: loader, "noise": 0.02}, "linkage": {"bend": 0.82}}
        stages = frozenset(known.stages)
        answer = Answer(
            "r", known, "effect", found, frozenset(found), stages, frozenset(), 0.99, shares
        )
        held = score([answer]).budget
        assert (held.right, held.of) == (right, 2)


def test_two_effects_that_are_one_by_one_s_name_have_one_share() -> None:
    """A bend beside one that stiffens: the twin has one bend, and one name is given."""
    known = replace(
        truth("pair", "bend", "stiffening_bend"),
        budget={"linkage": {"bend": 0.42, "stiffening_bend": 0.55}},
        readings=(Reading(("stiffening_bend",), ("linkage",), True),),
    )
    found = {"stiffening_bend": FoundEffect(0.9, {})}
    stages = frozenset(known.stages)
    for said, right in ((0.98, 1), (0.55, 0)):
        shares = {"linkage": {"stiffening_bend": said, "noise": 1.0 - said}}
        answer = Answer(
            "r", known, "effect", found, frozenset(found), stages, frozenset(), 0.99, shares
        )
        assert answer.exact
        held = score([answer]).budget
        assert (held.right, held.of) == (right, 1)


def test_brier_and_reliability_by_hand(tmp_path: Path) -> None:
    key = Key(1, 1, "", {"r001": truth("single", "inertia"), "r002": truth("none")})
    for name in key.records:
        (tmp_path / f"{name}.json").write_text(json.dumps(diagnosis("effect", "inertia")))
    found = score(read_answers(tmp_path, key)).probabilities
    assert found.brier == pytest.approx(0.5 * (0.1**2 + 0.9**2))
    [only] = found.bins
    assert only.stated == pytest.approx(0.9)
    assert only.true.share == 0.5


def test_an_interval_is_not_held_against_a_rivals_number_of_the_same_name() -> None:
    """A gauge's zero of -0.40 N was held against an offset of the loader of 0.40 N."""
    found = {"viscous_damping": FoundEffect(0.5, {"factor": Interval(1.1, 1.3)})}
    alike = replace(truth("single", "inertia"), alike=("viscous_damping",))
    nothing: frozenset[str] = frozenset()
    answer = Answer("r001", alike, "ambiguous", found, nothing, nothing, nothing, None)
    assert answer.interval("inertia", "factor") is None
    same = replace(alike, readings=(Reading(("viscous_damping",), ("loader",), True),))
    by_another_name = replace(answer, truth=same).interval("inertia", "factor")
    assert by_another_name == Interval(1.1, 1.3)


def test_the_key_of_another_set_is_refused(trials: Path) -> None:
    """It scored 600 diagnoses of seed 2039 by the key of seed 2038."""
    path = trials / "answers" / "r001.json"
    table = json.loads(path.read_text())
    for rig, refused in (("x", False), ("other", True)):
        path.write_text(json.dumps({**table, "made": {"rig": rig}}))
        if not refused:
            assert read_answers(trials / "answers", read_key(trials / "set.key.json"))
            continue
        with pytest.raises(InputError, match=r"made\.rig: is other, in the key x"):
            read_answers(trials / "answers", read_key(trials / "set.key.json"))


def test_intervals_of_shares_are_exact() -> None:
    # Clopper and Pearson, Biometrika 26, 1934: 0 of n leaves 1 − (α/2)^(1/n).
    assert share(0, 60).high == pytest.approx(1 - 0.025 ** (1 / 60))
    assert share(60, 60).low == pytest.approx(0.025 ** (1 / 60))
    half = share(5, 10)
    assert half.low == pytest.approx(0.1871, abs=1e-4)
    assert half.high == pytest.approx(0.8129, abs=1e-4)
    assert share(0, 0) == Share(0, 0, None, None, None)


def test_the_command_prints_draws_and_writes(trials: Path) -> None:
    words = [
        "blind",
        "score",
        "answers",
        "--key",
        "set.key.json",
        "--json",
        "s.json",
        "--figure",
        "s.png",
    ]
    done = coupled(trials, *words)
    assert done.returncode == 0, done.stderr
    assert "false alarms" in done.stdout
    assert "without a diagnosis: 1 of 17" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert json.loads((trials / "s.json").read_text())["records"] == 17
    assert (trials / "s.png").stat().st_size > 10_000


def test_a_changed_key_or_a_bad_diagnosis_scores_nothing(trials: Path) -> None:
    before = files(trials)
    words = ["blind", "score", "answers", "--key", "set.key.json", "--json", "s.json"]
    (trials / "answers" / "r001.json").write_text('{"verdict": "perhaps"}')
    done = coupled(trials, *words)
    assert done.returncode == 2
    assert "verdict" in done.stderr
    key = (trials / "set.key.json").read_text()
    (trials / "set.key.json").write_text(key.replace("1.4", "1.5"))
    done = coupled(trials, *words)
    assert done.returncode == 2
    assert "is not the key" in done.stderr
    assert files(trials) == before


def test_an_invalid_diagnosis_is_refused(trials: Path, tmp_path: Path) -> None:
    key = read_key(trials / "set.key.json")
    (tmp_path / "empty").mkdir()
    for folder, word in ((tmp_path / "none", "no folder"), (tmp_path / "empty", "no diagnosis")):
        with pytest.raises(InputError, match=word):
            read_answers(folder, key)
    for text in (
        "{",
        '{"verdict": "effect", "effects": [{}], "stages": {}}',
        '{"verdict": "effect"}',
        '{"verdict": "no_gap", "format": 4, "effects": [], "stages": {}}',
    ):
        (trials / "answers" / "r001.json").write_text(text)
        with pytest.raises(InputError):
            read_answers(trials / "answers", key)


def test_the_seal_is_the_hash_of_the_key() -> None:
    text = Key(1, 1, "s", {}).text()
    assert hashlib.sha256(text.encode()).hexdigest() in Seal(digest(text)).text()


@pytest.mark.parametrize(("control", "exact"), [("wheel", True), ("pedals", False)])
def test_of_a_whole_aircraft_an_effect_counts_on_its_own_control_alone(
    tmp_path: Path, control: str, exact: bool
) -> None:
    effects = (
        TrueEffect("roll_damping", "airframe", {"factor": 0.7}),
        TrueEffect("wheel.inertia", "wheel.loader", {"factor": 1.4}),
    )
    both = Truth("pair", "c172p", effects=effects, stages=("airframe", "wheel.loader"))
    number = {"factor": {"value": 1.4, "low": 1.3, "high": 1.5}}
    found = diagnosis("effect", "inertia", rivals=[["inertia", "viscous_damping"]])
    found["effects"] = [
        {"name": "roll_damping", "stage": "airframe", "probability": 0.9, "parameters": {}},
        {
            **{"name": "inertia", "stage": f"{control}.loader", "probability": 0.9},
            **{"control": control, "parameters": number},
        },
    ]
    found["stages"] = {name: {"guilty": True} for name in ("airframe", f"{control}.loader")}
    (tmp_path / "r001.json").write_text(json.dumps(found))
    (answer,) = read_answers(tmp_path, Key(5, 1, "salt", {"r001": both}))
    assert (answer.exact, answer.stage_right) == (exact, exact)
    assert f"{control}.viscous_damping" in answer.possible
    held = answer.interval("wheel.inertia", "factor")
    assert (held is not None and held.holds(1.4)) == exact
