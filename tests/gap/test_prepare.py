"""What is decided of records before they are searched."""

from __future__ import annotations

from pathlib import Path

from coupled.gap.chain import Part
from coupled.gap.prepare import prepare
from tests.support.gaps import made, nominal_rig


def test_the_outputs_of_the_last_rigs_are_kept(tmp_path: Path) -> None:
    """A search goes back and forth between a few rigs, and each takes as long to prepare again."""
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {}, 31).between(0.0, 12.0)
    case = prepare(rig, {"r": record}, Part("column")).case
    assert case.outputs_with_noise_of is not None
    rigs = [rig.changed({"controls.column.loader.friction_N": friction}) for friction in (1.0, 2.0)]
    first, second = map(case.outputs_with_noise_of, rigs)
    assert case.outputs_with_noise_of(rigs[0]) is first
    assert case.outputs_with_noise_of(rigs[1]) is second
