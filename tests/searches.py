"""Compare two searches for effects on opened blind trials: `python -m tests.searches FOLDER KEY`.

Each record is diagnosed by the search that diagnoses use, and by the one over sets of effects
(`coupled.gap.beam`). Printed are the records that only one of them has right, by kind, with
McNemar's exact p-value. FOLDER is that of `coupled blind make`, KEY its key.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

from coupled.api.records import read_record
from coupled.api.rigs import load_rig
from coupled.blind.trials.answers import Answer, read_answers
from coupled.blind.trials.key import read_key
from coupled.files import read_text, toml_tables
from coupled.gap.beam.beam import search_sets
from coupled.gap.diagnose import diagnose
from coupled.gap.refuted import search_unrefuted

SEARCHES = {"rules": search_unrefuted, "sets": search_sets}


def _diagnose(task: tuple[str, str, Path, Path]) -> None:
    search, record, rig, folder = task
    target = folder / search / f"{Path(record).stem}.json"
    if not target.exists():
        records = {Path(record).stem: read_record(record)}
        found = diagnose(load_rig(str(rig)), records, workers=1, search=SEARCHES[search])
        target.write_text(json.dumps(_short(found)), encoding="utf-8")


def _short(found: Any) -> dict[str, Any]:
    """Return what a score reads of a diagnosis, without flights that take long."""
    return {
        "format": 2,
        "verdict": found.verdict,
        "stages": {stage.name: stage.as_dict() for stage in found.stages},
        "effects": [effect.as_dict() for effect in found.effects],
        "rivals": [list(group) for group in found.rivals],
        "budget": {one.stage: one.as_dict() for one in found.budget},
        "shrink": found.shrink.as_dict(),
        "next_test": "",
    }


def is_right(answer: Answer) -> bool:
    """Tell whether an answer is right by its record's kind."""
    wanted = {"none": "no_gap", "outsider": "unexplained"}.get(answer.truth.category)
    return answer.exact if wanted is None else answer.verdict == wanted


def compare(folder: Path, key_file: Path, workers: int = 2) -> None:
    """Diagnose a folder of trials by both searches, and print where they differ."""
    out = folder / "searches"
    for search in SEARCHES:
        (out / search).mkdir(parents=True, exist_ok=True)
    listed = toml_tables(read_text(folder / "records.toml", "records.toml"))
    tasks = [
        (search, str(folder / "records" / f"{name}.csv"), folder / "rigs" / f"{rig}.toml", out)
        for name, rig in listed.items()
        for search in SEARCHES
    ]
    with ProcessPoolExecutor(workers) as pool:
        list(pool.map(_diagnose, tasks))
    key = read_key(key_file)
    answers = {name: read_answers(out / name, key) for name in SEARCHES}
    alone, total = Counter[tuple[str, str]](), Counter[str]()
    for rules, sets in zip(answers["rules"], answers["sets"], strict=True):
        kind = rules.truth.category
        total[kind] += 1
        if is_right(rules) != is_right(sets):
            alone[kind, "rules" if is_right(rules) else "sets"] += 1
    for kind, count in sorted(total.items()):
        one, other = alone[kind, "rules"], alone[kind, "sets"]
        p = binomtest(one, one + other).pvalue if one + other else 1.0
        print(
            f"{kind:10} {count:4}  right by rules alone {one}, by sets alone {other}, p = {p:.2g}"
        )


if __name__ == "__main__":
    compare(Path(sys.argv[1]), Path(sys.argv[2]))
