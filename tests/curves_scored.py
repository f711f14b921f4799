"""The curves reported for sealed blind records, against their key.

    python -m tests.curves_scored out/blind out/blind.key.json
    python -m tests.curves_scored out/blind out/blind.key.json out/diagnoses

Diagnoses every record with a fault outside the library, and `OTHERS` records each of single effects
and without a gap. With the folder of their diagnoses, the search is limited to the effects named
there and in the key, which takes a tenth of the time. Prints a row a kind of fault: the curve that
describes its law, and how many records have that curve, another curve, and none. `closed` is the
least share of the gap closed on held-out stretches.
"""

from __future__ import annotations

import json
import sys
import tomllib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupled.gap.diagnose import findings
from coupled.gap.findings.diagnosis import PartDiagnosis
from coupled.gap.parts import parts_of
from coupled.gap.prepare import prepare
from coupled.gap.search.histories import search
from coupled.record.record import read_record
from coupled.rig.rigfile import read_rig

OTHERS = 20
ENOUGH = 0.8  # share of the gap that a right curve should close
# By kind of fault, the curve of a rig that describes it; the other kinds are no function of one
# signal of a stage before the airframe, or (`gradient_steps`) have more steps than a curve's nodes.
LAWS = {
    "bend_uneven": "loader.bend_curve",
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


def named(diagnoses: Path | None, name: str, filed: dict[str, Any]) -> set[str] | None:
    """Return the effects named in a record's diagnosis and in its key; None without a folder."""
    if diagnoses is None:
        return None
    found = json.loads((diagnoses / f"{name}.json").read_text(encoding="utf-8"))
    groups = [one["name"] for one in found["effects"]], *found["rivals"]
    return {one for group in groups for one in group} | {one["name"] for one in filed["effects"]}


def scored(folder: Path, key: dict[str, Any], diagnoses: Path | None) -> dict[str, list[Scored]]:
    """Return the records' curves by kind of fault, and tell each on the standard error."""
    rigs = tomllib.loads((folder / "records.toml").read_text(encoding="utf-8"))
    found, left = defaultdict[str, list[Scored]](list), {"single": OTHERS, "none": OTHERS}
    for name, filed in key["records"].items():
        kind = filed["class"]
        if kind == "outsider":
            kind = filed["effects"][0]["name"]
        elif left.get(kind, 0) == 0:
            continue
        else:
            left[kind] -= 1
        curves = [
            curve
            for one in diagnosed(folder, name, rigs[name], named(diagnoses, name, filed))
            for curve in one.curves
        ]
        closed = {one.key.split(".", 2)[2]: one.closed for one in curves}
        found[kind].append(Scored(name, LAWS.get(kind, ""), closed))
        print(f"{name} {kind}: {closed or 'no curve'}", file=sys.stderr, flush=True)
    return found


def table(found: dict[str, list[Scored]]) -> list[str]:
    """Return the lines of the table."""
    lines = [
        "fault| curve of its law| right| another| none| closed",
        "---| ---| ---| ---| ---| ---",
    ]
    for kind in sorted(found, key=lambda one: (one not in LAWS, one in ("single", "none"), one)):
        rows, asked = found[kind], LAWS.get(kind, "")
        none = sum(not one.closed for one in rows)
        right = sum(one.right for one in rows)
        shares = [one.closed[asked] for one in rows if asked in one.closed]
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


def main(records: str, key: str, diagnoses: str | None = None) -> None:
    """Print the table of a folder of sealed records."""
    opened = json.loads(Path(key).read_text(encoding="utf-8"))
    print("\n".join(table(scored(Path(records), opened, Path(diagnoses) if diagnoses else None))))


if __name__ == "__main__":
    main(*sys.argv[1:])
