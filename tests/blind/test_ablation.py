"""The tool that measures what a rule of the diagnosis is worth."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from scipy.stats import binomtest

from coupled.blind.trials.key import Key
from coupled.blind.trials.truth import Sizes, TrueEffect, Truth
from coupled.gap.batch import jobs
from coupled.record.record import write_record
from coupled.rig.rigwrite import rig_text
from tests.support.ablated import newcombe, row, run
from tests.support.gaps import made, nominal_rig
from tests.support.rules import RULES, Rule, idle

ADDING = Rule("adding", "search.beam:_fit_neighbours", idle, "sets with one effect more")
FACTOR = 1.4


def test_each_rule_has_its_place() -> None:
    assert len({rule.name for rule in RULES}) == len(RULES)
    for rule in RULES:
        owner, name = rule.owner()
        is_function = callable(vars(owner)[name]) or isinstance(vars(owner)[name], property)
        assert callable(rule.off) == is_function, rule.name


def test_the_interval_of_a_paired_difference() -> None:
    """Uncorrelated shares of one half: √2 times the half width of Wilson's interval."""
    low, high = newcombe(10, 10, 10, 10)
    end = binomtest(20, 40).proportion_ci(method="wilson").high - 0.5
    assert (low, high) == pytest.approx((-math.sqrt(2.0) * end, math.sqrt(2.0) * end))
    low, high = newcombe(80, 12, 2, 6)
    assert 0.0 < low < 0.1 < high
    assert newcombe(80, 2, 12, 6) == pytest.approx((-high, -low))
    low, high = newcombe(90, 0, 0, 10)  # the same answers, all of them paired
    assert low < 0.0 < high < 0.05


@pytest.mark.slow
def test_an_ablation_counts_what_is_lost_without_a_rule(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = nominal_rig(flown=False)
    inertia = TrueEffect("inertia", "loader", {"factor": FACTOR})
    truths = {
        "r001": Truth("none", "axis"),
        "r002": Truth("single", "axis", (inertia,), ("loader",), sizes=Sizes({}, (9.0,), 9.0)),
    }
    for folder in ("records", "rigs"):
        (tmp_path / folder).mkdir()
    (tmp_path / "rigs" / "axis.toml").write_text(rig_text(rig))
    for number, name in enumerate(truths):
        values = {"inertia": {"factor": FACTOR}} if number else {}
        record = made(tmp_path, rig, values, seed=number)
        write_record(record, tmp_path / "records" / f"{name}.csv")
    (tmp_path / "records.toml").write_text("".join(f'{name} = "axis"\n' for name in truths))
    todo, key, out = jobs(tmp_path, tmp_path / "out"), Key(4, 1, "salt", truths), tmp_path / "out"
    rules = [ADDING, next(rule for rule in RULES if rule.name == "stated_most")]
    run(todo, rules, out)
    assert capsys.readouterr().err.count("without adding") == 1  # it does not act on a healthy rig
    adding, stated = (row(rule, key, todo, out).split("|") for rule in rules)
    assert adding[:7] == ["adding", "1", "1", "2", "2", "1", "50.0"]
    assert stated[:7] == ["stated_most", "2", "0", "2", "2", "2", "0.0"]
    assert float(stated[8]) < 0.0  # a right effect is stated to be surer
    run(todo, rules, out)
    assert not capsys.readouterr().err  # all answers are kept
    other = replace(todo[0], rig=todo[0].rig.with_name("other.toml"))
    other.rig.write_text(rig_text(rig))
    assert row(ADDING, key, [other, todo[1]], out) == "adding: no record has been diagnosed"
