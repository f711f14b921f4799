"""Compare two versions by their answers to opened trials: `python -m tests.searches A B KEY`.

A and B are folders that `coupled diagnose FOLDER --output A` wrote with either version, KEY is the
key of the trials. Printed are the records that only one of them has right, by kind, with McNemar's
exact p-value.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

from scipy.stats import binomtest

from coupled.blind.trials.answers import read_answers
from coupled.blind.trials.key import read_key
from tests.support.trials import is_right


def compare(first: Path, second: Path, key_file: Path) -> None:
    """Print by kind how many records only one of two folders of answers has right."""
    key = read_key(key_file)
    alone, total = Counter[tuple[str, int]](), Counter[str]()
    pairs = zip(read_answers(first, key), read_answers(second, key), strict=True)
    for one, other in pairs:
        kind = one.truth.category
        total[kind] += 1
        if is_right(one) != is_right(other):
            alone[kind, 0 if is_right(one) else 1] += 1
    for kind, count in sorted(total.items()):
        a, b = alone[kind, 0], alone[kind, 1]
        p = binomtest(a, a + b).pvalue if a + b else 1.0
        print(f"{kind:10} {count:4}  right by A alone {a}, by B alone {b}, p = {p:.2g}")


if __name__ == "__main__":
    compare(*map(Path, sys.argv[1:4]))
