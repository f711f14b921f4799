"""The blind score that README and docs/scores.md quote is the one in docs/blind-score.json.

After a new score, `coupled blind score … --json docs/blind-score.json`, set `SCORED` and `SINCE`
here and give `python -m tests.test_score_quoted`: it draws docs/blind-score.png from that file and
writes the README's sentence and the table of docs/scores.md anew.
"""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from coupled.blind.trials.result import (
    ByEffect,
    ClearSingles,
    FaintSingles,
    Intervals,
    Outsiders,
    Pairs,
    Power,
    Probabilities,
    Reliability,
    Score,
    Share,
)
from coupled.cli.tables import print_table
from coupled.plots.saving import save
from coupled.plots.trials import draw_score
from coupled.tables.trials import score_table
from tests.support.commands import ROOT

# Whose diagnoses the file scores.
SCORED = "the version a75060e9 of 29 November 2026"
SINCE = "No threshold was tuned on these records; all but one were scored once."
JSON, FIGURE = ROOT / "docs" / "blind-score.json", ROOT / "docs" / "blind-score.png"
README, TABLE = ROOT / "README.md", ROOT / "docs" / "scores.md"
NOT_SCORED = Share(0, 0, None, None, None)  # by an older version
COUNTS = {0: "none", 1: "one", 2: "two", 3: "three", 4: "four", 5: "five"}


def score_of(table: Mapping[str, Any]) -> Score:
    """Return the score of its JSON."""

    def share(row: Mapping[str, Any]) -> Share:
        return Share(**{key: row[key] for key in ("right", "of", "share", "low", "high")})

    def shares(kind: Any, rows: Mapping[str, Any]) -> Any:
        return kind(**{name: share(row) for name, row in rows.items()})

    stated, held = table["probabilities"], table["intervals"]
    return Score(
        records=table["records"],
        missing=table["missing"],
        clear_singles=shares(ClearSingles, table["clear_singles"]),
        faint_singles=shares(FaintSingles, table["faint_singles"]),
        false_alarms=share(table["no_gap"]["false_alarms"]),
        outsiders=shares(Outsiders, table["outsiders"]),
        pairs=shares(Pairs, table["pairs"]),
        lack_said=share(table["lacking"]["lack_said"]),
        intervals=Intervals(share(held["covered"]), held["without_interval"]),
        budget=share(table["budget"]["within_5_points"]) if "budget" in table else NOT_SCORED,
        closed=share(table["closed"]),
        probabilities=Probabilities(
            stated["brier"],
            stated["effects"],
            tuple(Reliability(row["stated"], share(row)) for row in stated["bins"]),
        ),
        power=tuple(
            Power(row["from"], row["ratio"], row["wrong"], share(row)) for row in table["power"]
        ),
        effects={name: ByEffect(**row) for name, row in table["effects"].items()},
    )


def kept() -> Score:
    return score_of(json.loads(JSON.read_text(encoding="utf-8")))


def sentence(score: Score) -> str:
    """Return the README's paragraph on a score."""

    def percent(found: Share) -> str:
        assert found.share is not None
        return f"{100.0 * found.share:.0f} %"

    def count(found: Share) -> str:
        return f"{COUNTS.get(found.right, found.right)} of {found.of}"

    clear, outside = score.clear_singles, score.outsiders.unexplained
    return (
        f"The diagnosis, in {SCORED}, was scored on {score.records} sealed records of an"
        " independent twin (`coupled blind`), with different friction and noise and with faults"
        " outside the library. Of single effects that double their stage's residual,"
        f" {percent(clear.named)} were identified, {percent(clear.stage)} located at the right"
        f" stage, and {percent(clear.wrong)} misidentified with certainty, as were"
        f" {count(score.faint_singles.wrong)} weaker ones. Of pairs,"
        f" {percent(score.pairs.whole)} were identified completely. There were false alarms in"
        f" {count(score.false_alarms)} records without an effect. {percent(outside)} of"
        f" {outside.of} faults outside the library were reported as unexplained, and"
        f" {percent(score.intervals.covered)} of the 95 % intervals included the true value."
        f" {SINCE} [Table and misses](docs/scores.md)."
    )


def table(score: Score) -> str:
    """Return the shares as the command prints them on a terminal of 80 columns."""
    console = Console(width=80, no_color=True, color_system=None)
    with console.capture() as caught:
        print_table(console, score_table(score))
    shares = caught.get()
    return "\n".join(line.rstrip() for line in shares.splitlines())


def marked(name: str, text: str) -> re.Match[str]:
    found = re.search(rf"(?<=<!-- {name} -->\n).*?(?=\n<!-- end -->)", text, re.S)
    assert found is not None
    return found


def test_the_readme_quotes_the_score_that_is_kept() -> None:
    quoted = marked("blind score", README.read_text(encoding="utf-8")).group()
    assert " ".join(quoted.split()) == sentence(kept())


def test_the_table_is_of_the_score_that_is_kept() -> None:
    quoted = marked("blind table", TABLE.read_text(encoding="utf-8")).group()
    assert quoted == f"```text\n{table(kept())}\n```"


def test_a_score_is_the_same_after_its_json() -> None:
    score = kept()
    again = json.loads(json.dumps(score.as_dict()))
    assert score_of(again) == score
    file = json.loads(JSON.read_text(encoding="utf-8"))
    assert {key: again[key] for key in file} == file


def test_the_figure_is_drawn_from_the_json(tmp_path: Path) -> None:
    figure = draw_score(kept())
    save(figure, tmp_path / "score.png")
    assert (tmp_path / "score.png").stat().st_size > 10_000
    power, _ = figure.axes
    [named] = [line for line in power.lines if line.get_label() == "named"]
    shares = np.array([row.named.share for row in kept().power], dtype=float)
    np.testing.assert_array_equal(np.asarray(named.get_ydata(), dtype=float), shares)


def main() -> None:
    """Draw the figure and write the quotations anew."""
    score = kept()
    save(draw_score(score), FIGURE)
    whole = sentence(score).replace(" %", "\0%")  # a number stays with its sign
    wrapped = "\n".join(textwrap.wrap(whole, 110, break_on_hyphens=False)).replace("\0", " ")
    written = {README: ("blind score", wrapped)}
    written[TABLE] = ("blind table", f"```text\n{table(score)}\n```")
    for page, (name, quoted) in written.items():
        text = page.read_text(encoding="utf-8")
        place = marked(name, text)
        page.write_text(text[: place.start()] + quoted + text[place.end() :], encoding="utf-8")


if __name__ == "__main__":
    main()
