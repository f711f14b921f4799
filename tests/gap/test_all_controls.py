"""All controls in one diagnosis: its parts, its verdict, and the answer for one of them alone."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coupled as package
from coupled.errors import InputError
from coupled.gap.batch import Job, Row
from coupled.gap.chain import Part
from coupled.gap.diagnose import _airframe_first, diagnose, parts_of
from coupled.gap.findings.budget import shapley_subsets
from coupled.gap.findings.diagnosis import Diagnosis, verdict_of_all
from coupled.gap.findings.result import Findings, Verdict
from coupled.gap.thresholds import MOST_PLAYERS
from coupled.record.channels import CONTROL_NAMES, ControlName
from coupled.record.record import Record, write_record
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.airframes import noisy
from tests.support.commands import coupled
from tests.support.threecontrols import flown

BEND = "controls.wheel.loader.bend_rad_per_N"
WORN = {BEND: 2e-3, "flight.elevator_effectiveness": 0.8}
PEDALS_N = 160.0
JET_N = {"column": 110.0, "wheel": 70.0, "pedals": 200.0}  # beyond breakout and friction
SHORT_s = 12.0


@cache
def cessna() -> Rig:
    return noisy(package.load_rig("c172p"))


@cache
def short(*changes: tuple[str, float]) -> Record:
    return flown(cessna(), dict(changes), SHORT_s, pedals=PEDALS_N)


TOLD: list[str] = []  # tasks of the diagnoses


@cache
def whole(*changes: tuple[str, float]) -> Diagnosis:
    records = {"r": short(*changes)}
    return diagnose(cessna(), records, tell=lambda what, done, total: TOLD.append(what))


def without(record: Record, *starts: str) -> Record:
    names = [name for name in record.channels if not name.startswith(starts)]
    return Record(tuple(names), np.column_stack([record[name] for name in names]))


def at_rest(record: Record, *controls: str, force: bool = False) -> Record:
    """Return a record in which controls have noise alone in place of their motion."""
    rng, data = np.random.default_rng(5), record.data.copy()
    for i, name in enumerate(record.channels):
        if name.startswith(controls) and not (force and "_force_N" in name):
            data[:, i] = rng.normal(0.0, 1e-5, len(record))
    return Record(record.channels, data)


def found_parts(record: Record, control: ControlName | None = None) -> tuple[list[Part], Any]:
    parts, held = parts_of(cessna(), {"r": record}, control)
    return list(parts), held


def test_each_moving_control_is_a_part_and_the_airframe_another() -> None:
    apart = [Part(name, airframe=False) for name in CONTROL_NAMES]
    assert found_parts(short()) == ([*apart, Part("column", own=False)], ())
    still = at_rest(short(), "pedals")
    assert found_parts(still) == ([*apart[:2], Part("column", own=False)], ())
    assert found_parts(short(), "wheel") == ([Part("wheel")], ())


def test_one_moving_control_is_judged_with_the_airframe() -> None:
    assert found_parts(at_rest(short(), "column", "pedals")) == ([Part("wheel")], ())
    assert found_parts(without(short(), "column", "wheel")) == ([Part("pedals")], ())
    # None moves: the first is then refused, or not judged, with the reason.
    assert found_parts(at_rest(short(), *CONTROL_NAMES)) == ([Part("column")], ())


@pytest.mark.slow
def test_a_control_that_a_force_does_not_move_is_named() -> None:
    held = at_rest(short(), "pedals", force=True)
    said = ("The pedals are not judged: no record moves them.",)
    assert found_parts(held)[1] == said
    found = diagnose(cessna(), {"r": at_rest(held, "column")})
    assert found.controls == ("wheel",)
    assert found.left_out == said
    assert found.summary.endswith(said[0])


def test_a_control_whose_force_alone_is_recorded_is_not_judged() -> None:
    """Its force is recorded for the crosstalk into the others."""
    alone = without(short(), *(f"wheel_{rest}" for rest in ("comp", "defl", "est", "grad", "mod")))
    assert "wheel_force_N" in alone.channels
    named = {part.name for part in found_parts(alone)[0]}
    assert named == {"column", "pedals", "airframe"}
    lacking = without(short(), "wheel_defl", "wheel_est", "wheel_grad", "wheel_mod", "dynamic")
    assert found_parts(lacking)[1] == ("The wheel is not judged: the records lack its channels.",)


def test_an_airframe_that_cannot_be_judged_is_listed_once_with_what_it_lacks() -> None:
    record = without(short(), "pitch_rate", "elevator")
    assert found_parts(record)[0] == [
        Part("column"),
        *(Part(name, airframe=False) for name in ("wheel", "pedals")),
    ]


def test_records_may_move_one_control_each() -> None:
    records: dict[str, Record] = {
        name: at_rest(short(), *({*CONTROL_NAMES} - {name})) for name in CONTROL_NAMES
    }
    parts, _ = parts_of(cessna(), records, None)
    assert {part: list(ours) for part, ours in parts.items()} == {
        **{Part(name, airframe=False): [name] for name in CONTROL_NAMES},
        Part("column", own=False): list(CONTROL_NAMES),
    }


def test_a_bench_has_no_airframe() -> None:
    bench = cessna().changed({"flight": None, "noise": {}})
    parts, _ = parts_of(bench, {"r": short()}, None)
    assert list(parts) == [Part(name, airframe=False) for name in CONTROL_NAMES]


@pytest.mark.parametrize(
    ("parts", "verdict"),
    [
        ("no_gap no_gap", "no_gap"),
        ("no_gap effect!", "effect"),
        ("effect! mostly!", "mostly"),
        ("effect! ambiguous!", "ambiguous"),
        ("ambiguous! unexplained! effect!", "unexplained"),
        # A part whose noise floor may hide a gap does not change what is known of another.
        ("ambiguous effect!", "effect"),
        ("ambiguous no_gap", "ambiguous"),
        # A control that breakout and friction hold does not move: it is not judged.
        ("still no_gap", "no_gap"),
        ("still effect! no_gap", "effect"),
        ("still ambiguous no_gap", "ambiguous"),
        ("still still", "ambiguous"),
    ],
)
def test_no_part_hides_an_unexplained_one(parts: str, verdict: Verdict) -> None:
    """A faulty part is marked by !."""

    def part(word: str) -> SimpleNamespace:
        stage = SimpleNamespace(hidden=SimpleNamespace(still=word == "still"))
        plain = word.rstrip("!").replace("still", "ambiguous")
        hidden = (stage,) if word in ("still", "ambiguous") else ()
        return SimpleNamespace(verdict=plain, guilty=("x",) if "!" in word else (), stages=hidden)

    each = [part(word) for word in parts.split()]
    assert verdict_of_all(cast("list[Findings]", each)) == verdict
    assert verdict_of_all(cast("list[Findings]", each[::-1])) == verdict


def test_a_healthy_record_of_three_controls_has_no_gap() -> None:
    found = whole()
    assert (found.verdict, found.controls) == ("no_gap", CONTROL_NAMES)
    words = "No gap in the column, wheel, pedals and airframe: every stage that could be judged"
    assert found.summary == f"{words} stays within its noise."
    table = found.as_dict()
    assert (table["format"], table["controls"]) == (3, list(CONTROL_NAMES))
    stages = [f"{name}.{stage}" for name in CONTROL_NAMES for stage in ("loader", "linkage")]
    assert {*stages, "airframe"} <= table["stages"].keys()
    assert "column.airframe" not in table["stages"]
    for stage in ("column.linkage", "wheel.linkage", "pedals.linkage", "airframe"):
        assert found.stage(stage).gap == pytest.approx(1.0, abs=0.15)
    json.dumps(table)


@pytest.mark.slow
def test_a_control_that_its_breakout_holds_is_not_judged_and_hides_no_gap() -> None:
    """It was *ambiguous*: nothing of its loader shows, as of a control that no one touches."""
    rig = noisy(package.load_rig("737"))
    record = flown(rig, {}, SHORT_s, **JET_N | {"column": 20.0})
    found = diagnose(rig, {"r": record})
    assert found.verdict == "no_gap"
    assert "the loader is not judged, as column_computed_m shows little but noise" in found.summary
    assert "No gap in the wheel, pedals and airframe" in found.summary
    assert diagnose(rig, {"r": record}, "column").verdict == "ambiguous"


@pytest.mark.slow
def test_the_effects_of_two_parts_are_those_of_each_alone() -> None:
    found = whole(*WORN.items())
    assert found.verdict == "effect"
    assert [stage.name for stage in found.stages][:2] == ["wheel.linkage", "airframe"]
    assert found.guilty == ("wheel.linkage", "airframe")
    named = {effect.label: effect.control for effect in found.effects}
    assert named == {"wheel bend": "wheel", "elevator effectiveness": None}
    for name, true in WORN.items():
        assert found.improved[name] == pytest.approx(true, rel=0.02)
    alone = diagnose(cessna(), {"r": short(*WORN.items())}, "wheel")
    sizes = {effect.name: effect.parameters[0] for effect in alone.effects}
    for effect in found.effects:
        # A fit ends where a step would gain less than the data can show: far within its interval.
        size = sizes[effect.name]
        assert size.low is not None and size.high is not None
        assert effect.value == pytest.approx(size.value, abs=0.01 * (size.high - size.low))
    for stage in ("linkage", "surface", "airframe"):
        name = stage if stage == "airframe" else f"wheel.{stage}"
        assert found.stage(name).gap == pytest.approx(alone.stage(stage).gap, rel=1e-6)


@pytest.mark.slow
def test_the_json_names_the_control_of_each_effect() -> None:
    table = whole(*WORN.items()).as_dict()
    assert [(one["name"], one["control"]) for one in table["in_flight"]] == [
        ("elevator_effectiveness", None),
        ("bend", "wheel"),
    ]
    assert {(one["name"], one["stage"], one["control"]) for one in table["effects"]} == {
        ("bend", "linkage", "wheel"),
        ("elevator_effectiveness", "airframe", None),
    }
    assert set(table["budget"]) == set(table["budget_95"]) == {"wheel.linkage", "airframe"}
    shown = {"column_deflection_m", "wheel_deflection_rad", "pedals_deflection_m", "rudder_rad"}
    assert shown <= table["closed_loop"].keys()
    again = table["closed_loop"]["wheel_deflection_rad"]
    assert again["after"] < 0.5 * again["before"]
    row = Row.of(table, cast("Job", SimpleNamespace(name="r", rig=Path("c172p.toml"), out="r")))
    assert set(row.effects) == {"wheel.bend", "elevator_effectiveness"}


@pytest.mark.slow
def test_a_summary_names_the_part_of_each_gap() -> None:
    said = whole(*WORN.items()).summary
    assert "Wheel: Bend, 6.09e-4 → 0.002" in said
    assert "Airframe: Elevator effectiveness, 1 → 0.8" in said
    assert "No gap in the column and pedals" in said
    assert said.endswith("Correct elevator effectiveness first.")


@pytest.mark.slow
def test_to_polars_has_the_control_of_each_effect() -> None:
    frame = whole(*WORN.items()).to_polars()
    assert dict(zip(frame["effect"], frame["control"], strict=True)) == {
        "bend": "wheel",
        "elevator_effectiveness": None,
    }


def test_progress_names_the_part() -> None:
    whole(*WORN.items())
    named = {one.partition(":")[0] for one in TOLD}
    assert {"wheel", "airframe"} <= named <= {*CONTROL_NAMES, "airframe"}


def test_first_and_last_give_the_shares_of_a_sum_of_many_actions() -> None:
    """The power of a sum of actions is a quadratic form, of which Shapley's shares are known."""
    players = MOST_PLAYERS + 2
    actions = np.random.default_rng(2).normal(size=(players, 40))
    subsets, weights = shapley_subsets(players)
    left = [
        sum((actions[i] for i in range(players) if not s >> i & 1), np.zeros(40)) for s in subsets
    ]
    power = np.array([float(one @ one) for one in left])
    assert weights @ power == pytest.approx(actions @ actions.sum(axis=0))
    assert len(subsets) == 2 * players + 2


def test_a_control_that_the_rig_lacks_is_refused() -> None:
    bare = package.load_rig("report-column").changed({"flight": None, "noise": {}})
    with pytest.raises(InputError, match="the rig has no pedals"):
        diagnose(bare, {"r": short()}, "pedals")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size_N"), [("c172p", {}), ("t37", {}), ("737", JET_N), ("b747", JET_N)]
)
def test_healthy_records_of_the_shipped_rigs_have_no_gap(
    name: str, size_N: dict[str, float]
) -> None:
    rig = noisy(package.load_rig(name))
    found = diagnose(rig, {"r": flown(rig, {}, **{"pedals": PEDALS_N, **size_N})})
    assert (found.verdict, found.controls) == ("no_gap", CONTROL_NAMES), found.summary


def test_the_controls_are_given_the_aircraft_that_was_found() -> None:
    """The trim positions of the surfaces depend on it, so the airframe is searched first."""
    heavy = cessna().changed({"flight.mass": 1.1})
    given: dict[str, Any] = {}

    def work(part: Part, flight: Any) -> Rig:
        given[part.name] = flight
        return heavy

    parts = [Part("column", airframe=False), Part("wheel", airframe=False)]
    air = Part("column", own=False)
    assert list(_airframe_first([*parts, air], work, lambda rig: rig)) == [air, *parts]
    assert given == {"airframe": None, "column": heavy.flight, "wheel": heavy.flight}


@pytest.mark.slow
def test_a_late_clock_of_the_motion_is_of_no_control() -> None:
    found = diagnose(cessna(), {"r": short(("flight.motion_stamp_s", 0.1))})
    (effect,) = found.effects
    assert (effect.name, effect.stage, effect.control) == ("motion_skew", "sensing", None)
    assert "sensing" in found.guilty


@pytest.mark.slow
def test_another_weight_is_not_put_down_to_the_surfaces() -> None:
    """The heavier aircraft trims at another elevator, which is no fault of the rigging."""
    record = flown(cessna(), {"flight.mass": 1.1}, pedals=PEDALS_N)
    found = diagnose(cessna(), {"r": record})
    assert [effect.label for effect in found.effects] == ["mass"]
    assert found.guilty == ("airframe",)


@pytest.mark.slow
def test_beside_healthy_records_each_part_has_its_own_reference() -> None:
    healthy = {str(i): flown(cessna(), {}, SHORT_s, pedals=float(i)) for i in range(3)}
    found = diagnose(cessna(), {"r": short(*WORN.items())}, healthy=healthy)
    assert {"wheel.linkage", "airframe"} <= {*found.guilty}
    assert set(found.as_dict()["healthy"]) == {"column", "wheel", "airframe"}
    assert "No healthy record moves the pedals" in found.summary


@pytest.mark.slow
def test_the_command_judges_all_controls_and_writes_their_rig(tmp_path: Path) -> None:
    write_record(short(*WORN.items()), tmp_path / "r.csv")
    cessna().save(tmp_path / "rig.toml")
    written = ("--json", "r.json", "--improve", "new.toml", "--plots", "p", "--report", "r.html")
    done = coupled(tmp_path, "diagnose", "r.csv", "--rig", "rig.toml", *written)
    assert done.returncode == 0, done.stderr
    table = json.loads((tmp_path / "r.json").read_text())
    assert table["controls"] == list(CONTROL_NAMES)
    assert "wheel bend" in done.stdout
    improved = read_rig(tmp_path / "new.toml")
    for name, true in WORN.items():
        assert improved[name] == pytest.approx(true, rel=0.02)
    figures = {
        f"{part}-{name}.png"
        for part in ("wheel", "airframe")
        for name in ("ladder", "stages", "signature")
    }
    assert {file.name for file in (tmp_path / "p").iterdir()} == figures
    assert "Figures: airframe" in (tmp_path / "r.html").read_text(encoding="utf-8")
    one = coupled(
        tmp_path, "diagnose", "r.csv", "--rig", "rig.toml", "--control", "column", "--json", "-"
    )
    assert json.loads(one.stdout)["controls"] == ["column"]


@pytest.mark.slow
def test_a_fault_of_a_control_is_found_in_a_minute_beside_one_of_the_aircraft() -> None:
    """With all candidates fitted at once the wheel's bend was not found, beside a gap of 8."""
    record = flown(cessna(), WORN, 60.0, pedals=PEDALS_N)
    found = diagnose(cessna(), {"r": record})
    assert found.verdict == "effect"
    assert {effect.name for effect in found.effects} == {"bend", "elevator_effectiveness"}
