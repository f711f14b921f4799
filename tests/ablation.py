"""What each rule of the diagnosis is worth: the same opened trials, with the rule and without it.

    python -m tests.ablation out/blind out/blind.key.json
    python -m tests.ablation out/blind out/blind.key.json --without needed last_swaps --records 50
    python -m tests.ablation --list

RECORDS is the folder of `coupled blind make`, KEY its key. A row a rule is printed:

    acts        records in which the rule changes a result on the way; elsewhere the answer is the
                same without it, and the record is not diagnosed again
    changed     records whose verdict, effects or alternatives differ without the rule
    with, without    right records; right is what `tests.searches` counts
    loss        share of right records that is lost without the rule, in percentage points, with
                the 95 % interval of a difference of paired shares (Newcombe, Statist. Med. 17,
                1998, method 10)
    Brier       increase of the Brier score without the rule, a record, times 100, with the 95 %
                interval of the paired difference (Student)
    CPU         seconds that a record takes less without the rule, mean of those where it acts

A rule goes if both intervals include zero. A rule is switched off by a patch of one place within
this process. Answers are kept in `--output`, so that an interrupted run goes on; they are made
again after any change of the package. After a change of a rule in `tests/support/rules.py`, delete
its folder there.

Fits and signatures are computed once a record, and used again where a run without a rule asks for
the same; their time counts as if they were computed again.
"""

from __future__ import annotations

import argparse
import difflib
import random
from collections.abc import Sequence
from pathlib import Path

from coupled.blind.trials.key import read_key
from coupled.errors import InputError
from coupled.gap.batch import jobs
from tests.support.ablated import HEAD, row, run
from tests.support.rules import RULES

NAMES = [rule.name for rule in RULES]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.ablation",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("records", type=Path, nargs="?")
    parser.add_argument("key", type=Path, nargs="?")
    parser.add_argument("--without", nargs="+", metavar="RULE", help="these rules (default: all)")
    parser.add_argument("--records", dest="count", type=int, help="so many records (default: all)")
    parser.add_argument("--seed", type=int, default=1, help="of the records' order (default: 1)")
    parser.add_argument("--output", type=Path, default=Path("out/ablation"), help="kept answers")
    parser.add_argument("--table", action="store_true", help="only print the kept answers' table")
    parser.add_argument("--list", action="store_true", help="print the rules")
    given = parser.parse_args(arguments)
    if given.list:
        print("\n".join(f"{rule.name}: {rule.what} ({rule.place})" for rule in RULES))
        return
    if given.records is None or given.key is None:
        parser.error("RECORDS and KEY are missing: the folder and the key of coupled blind make")
    if given.count is not None and given.count < 1:
        parser.error(f"--records: should be at least 1, not {given.count}")
    for name in given.without or ():
        if name not in NAMES:
            near = difflib.get_close_matches(name, NAMES, 1)
            hint = f"did you mean {near[0]}?" if near else "see --list"
            parser.error(f"--without: there is no rule {name!r}; {hint}")
    rules = [rule for rule in RULES if given.without is None or rule.name in given.without]
    try:
        key, todo = read_key(given.key), jobs(given.records, given.output)
        for job in todo:
            if job.name not in key.records:
                problem = "is missing: give this set's key"
                raise InputError(given.key, f"records.{job.name}", problem)
    except InputError as error:
        parser.exit(2, f"{error}\n")
    random.Random(given.seed).shuffle(todo)
    todo = todo[: given.count]
    if not given.table:
        run(todo, rules, given.output)
    print(HEAD)
    for rule in rules:
        print(row(rule, key, todo, given.output), flush=True)


if __name__ == "__main__":
    main()
