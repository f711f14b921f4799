"""The curves reported for sealed blind records, against their key.

    python -m tests.curves_scored score out/blind out/blind.key.json
    python -m tests.curves_scored score out/blind out/blind.key.json --diagnoses out/diagnoses
    python -m tests.curves_scored make 2063 out/dealt

`make` deals records of faults outside the library, of a seed, with their key in the folder: each
law of one signal once, `MORE` of them again, `FREE` others, drawn from the deck.

`score` diagnoses every record with a fault outside the library, and `OTHERS` records each of single
effects and without a gap. Answers are written to `curves.json` in the folder as they come; the same
command resumes. With the folder of their diagnoses, the search is limited to the effects named
there and in the key, which takes a tenth of the time. Prints a row a kind of fault: the curve that
describes its law, and how many records have that curve, another curve, and none. `closed` is the
least share of the gap closed on held-out stretches.
"""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from coupled.blind.trials.deck import read_deck
from coupled.blind.trials.make import record_name
from coupled.blind.trials.rigs import rig_pool
from coupled.blind.trials.trial import Plan, draw_trial
from coupled.blind.twin.setting import csv_text
from coupled.gap.diagnose import findings, parts_of
from coupled.gap.findings.diagnosis import PartDiagnosis
from coupled.gap.prepare import prepare
from coupled.gap.search.histories import search
from coupled.record.record import read_record
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text

OTHERS = 20
DEAL = 4  # version of the trials
MORE, FREE, RIGS = 2, 4, 24
ENOUGH = 0.8  # share of the gap that a right curve should close
# By kind of fault, the curve of a rig that describes it; the other kinds are no function of one
# signal of a stage before the airframe, or (`gradient_steps`) have more steps than a curve's nodes.
LAWS = {
    "bend_uneven": "sensing.grip_load_curve",
    "cogging": "loader.force_curve",
    "dead_zone": "rigging.command_curve",
    "load_friction": "loader.load_curve",
    "quadratic_damping": "loader.friction_curve",
    "transducer_square": "sensing.grip_curve",
    "uneven_gain": "rigging.command_curve",
    "wrong_knot": "schedule.gradient_curve",
}


@dataclass(frozen=True)
class Scored:
    """The curves of a record, by key of the control, and their shares closed."""

    record: str
    asked: str
    closed: dict[str, float]

    @property
    def right(self) -> bool:
        """Whether the curve is that of the law, and of a record without one there is none."""
        return set(self.closed) == ({self.asked} if self.asked else set())


def diagnosed(folder: Path, name: str, rig: str, among: set[str] | None) -> list[PartDiagnosis]:
    """Return the diagnoses of a record's parts, with the effects of these names, or with all."""
    nominal = read_rig(folder / "rigs" / f"{rig}.toml")
    record = read_record(folder / "records" / f"{name}.csv")
    parts, _ = parts_of(nominal, {name: record}, None)
    found = []
    for part, records in parts.items():
        made = prepare(nominal, records, part)
        library = [one for one in made.library if among is None or one.name in among]
        found.append(findings(made, *search(made.case, library)))
    return found


def law_of(kind: str, filed: dict[str, Any], nominal: Rig) -> str:
    """Return the curve that describes the law of a record; empty if it is none of one signal.

    A structure that bends with the force in both directions has a bend. Beyond, no rig bends so,
    and the law is one of the reading.
    """
    if kind == "bend_uneven":
        uneven = abs(filed["effects"][0]["parameters"]["uneven_m_per_N"])
        if uneven <= nominal.controls["column"].loader.least_bend:
            return "loader.bend_curve"
    return LAWS.get(kind, "")


def named(diagnoses: Path | None, name: str, filed: dict[str, Any]) -> set[str] | None:
    """Return the effects named in a record's diagnosis and in its key; None without a folder."""
    if diagnoses is None:
        return None
    found = json.loads((diagnoses / f"{name}.json").read_text(encoding="utf-8"))
    groups = [one["name"] for one in found["effects"]], *found["rivals"]
    return {one for group in groups for one in group} | {one["name"] for one in filed["effects"]}


def scored(folder: Path, key: dict[str, Any], diagnoses: Path | None) -> dict[str, list[Scored]]:
    """Return the records' curves by kind of fault, and tell each on the standard error.

    The folder's file of answers is read first, and written after each record.
    """
    path = folder / "curves.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    rigs = tomllib.loads((folder / "records.toml").read_text(encoding="utf-8"))
    rows, left = defaultdict[str, list[Scored]](list), {"single": OTHERS, "none": OTHERS}
    for name, filed in key["records"].items():
        kind = filed["class"]
        if kind == "outsider":
            kind = filed["effects"][0]["name"]
        elif left.get(kind, 0) == 0:
            continue
        else:
            left[kind] -= 1
        if name not in known:
            found = diagnosed(folder, name, rigs[name], named(diagnoses, name, filed))
            curves = [curve for one in found for curve in one.curves]
            known[name] = {one.key.split(".", 2)[2]: one.closed for one in curves}
            path.write_text(json.dumps(known), encoding="utf-8")
        closed = known[name]
        asked = law_of(kind, filed, read_rig(folder / "rigs" / f"{rigs[name]}.toml"))
        rows[kind].append(Scored(name, asked, closed))
        print(f"{name} {kind}: {closed or 'no curve'}", file=sys.stderr, flush=True)
    return rows


def table(found: dict[str, list[Scored]]) -> list[str]:
    """Return the lines of the table."""
    lines = [
        "fault| curve of its law| right| another| none| closed",
        "---| ---| ---| ---| ---| ---",
    ]
    for kind in sorted(found, key=lambda one: (one not in LAWS, one in ("single", "none"), one)):
        rows = found[kind]
        asked = " or ".join(sorted({one.asked for one in rows}))
        none = sum(not one.closed for one in rows)
        right = sum(one.right for one in rows)
        shares = [one.closed[one.asked] for one in rows if one.asked in one.closed]
        closed = f"{100 * min(shares):.0f} %" if shares else ""
        another = len(rows) - none - (right if asked else 0)
        lines.append(f"{kind}| {asked}| {right} of {len(rows)}| {another}| {none}| {closed}")
    laws = [one for rows in found.values() for one in rows if one.asked]
    enough = sum(one.right and one.closed[one.asked] >= ENOUGH for one in laws)
    right = sum(one.right for one in laws)
    lines += [
        "",
        f"Of {len(laws)} laws of one signal {right} have the right curve,"
        f" {enough} with {100 * ENOUGH:.0f} % of the gap closed.",
    ]
    return lines


def deal(seed: int, folder: Path) -> None:
    """Write a set of outsiders of a seed: records, rigs and key."""
    deck = read_deck(DEAL)
    pool = rig_pool(deck.rigs, seed, RIGS)
    rng = np.random.default_rng([seed, 1])
    known = [one.name for one in deck.outsiders if one.stage != "airframe"]
    laws, others = [one for one in known if one in LAWS], [one for one in known if one not in LAWS]
    dealt = [*laws, *rng.choice(laws, MORE).tolist(), *rng.choice(others, FREE, False).tolist()]
    for part in ("records", "rigs"):
        (folder / part).mkdir(parents=True)
    for name, rig in pool.items():
        (folder / "rigs" / f"{name}.toml").write_text(rig_text(rig, "nominal"), encoding="utf-8")
    key, listed = dict[str, Any](), ""
    for i, kind in enumerate(rng.permutation(dealt).tolist()):
        name = record_name(i)
        made = draw_trial(
            np.random.default_rng([seed, 3, i]), Plan("outsider", (kind,)), deck, pool
        )
        (folder / "records" / f"{name}.csv").write_text(csv_text(made.record), encoding="utf-8")
        key[name] = made.truth.as_dict()
        listed += f'{name} = "{made.truth.rig}"\n'
        print(f"{name} made", file=sys.stderr, flush=True)
    (folder / "records.toml").write_text(listed, encoding="utf-8")
    (folder / "key.json").write_text(json.dumps({"records": key}), encoding="utf-8")


def main() -> None:
    """Print the table of a folder of sealed records, or deal a set."""
    parser = argparse.ArgumentParser(prog="python -m tests.curves_scored", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    commands = parser.add_subparsers(required=True, dest="command")
    one = commands.add_parser("score", help="score records against their key")
    one.add_argument("folder", type=Path)
    one.add_argument("key", type=Path)
    one.add_argument("--diagnoses", type=Path)
    one = commands.add_parser("make", help="deal records of a seed")
    one.add_argument("seed", type=int)
    one.add_argument("folder", type=Path)
    given = parser.parse_args()
    if given.command == "make":
        deal(given.seed, given.folder)
        return
    opened = json.loads(given.key.read_text(encoding="utf-8"))
    print("\n".join(table(scored(given.folder, opened, given.diagnoses))))


if __name__ == "__main__":
    main()
