"""Dry friction that differs with the direction of motion, or grows with the force carried."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.rig.packing import pack
from tests.support.rigs import bench, push

Floats = NDArray[np.float64]
K = 560.0
PLAIN: dict[str, Any] = {"bend_m_per_N": 0.0, "controls.column.compensation.gradient": False}
SOFT: dict[str, Any] = {"friction_stiffness_N_per_m": 2e5}


def slowly(t: Floats) -> Floats:
    """Return a force that goes to 40 N, to −40 N and back in half a minute."""
    return 40.0 * np.interp(t, [0.0, 8.0, 24.0, 32.0], [0.0, 1.0, -1.0, 0.0])


def lost(changes: dict[str, Any]) -> tuple[Floats, Floats, Floats]:
    """Return F, and what of it friction takes while the control moves up, and down, N."""
    moved = push(bench({**PLAIN, **changes}), slowly, 32.0, K)
    force = slowly(np.arange(len(moved)) / 2000.0)
    rate = np.gradient(moved) * 2000.0
    taken = force - K * moved - 75.0 * rate
    up, down = rate > 5e-3, rate < -5e-3
    return force, np.where(up, taken, np.nan), np.where(down, -taken, np.nan)


@pytest.mark.parametrize("contact", [{}, SOFT], ids=["rigid", "yields"])
def test_each_direction_has_a_friction_of_its_own(contact: dict[str, Any]) -> None:
    _, up, down = lost({"friction_N": 1.0, "friction_pull_N": 3.0, **contact})
    assert np.nanmedian(up) == pytest.approx(4.0, rel=2e-3)
    assert np.nanmedian(down) == pytest.approx(1.0, rel=5e-3)
    _, up, down = lost({"friction_push_N": 2.0, **contact})
    assert np.nanmedian(up) == pytest.approx(0.0, abs=0.02)
    assert np.nanmedian(down) == pytest.approx(2.0, rel=5e-3)


@pytest.mark.parametrize("contact", [{}, SOFT], ids=["rigid", "yields"])
def test_friction_grows_with_the_force_carried(contact: dict[str, Any]) -> None:
    """F − φ·|F| = K·x on the way up, F + φ·|F| = K·x on the way down."""
    force, up, down = lost({"friction_by_load": 0.1, **contact})
    for taken, carried in ((up, force > 15.0), (up, force < -15.0), (down, force > 15.0)):
        seen = carried & np.isfinite(taken)
        assert np.count_nonzero(seen) > 1000
        assert np.median(taken[seen] / np.abs(force[seen])) == pytest.approx(0.1, rel=5e-3)


def test_uneven_friction_is_even_friction_and_a_constant_force() -> None:
    """So the record of one is a record of the other two, however the control is moved."""

    def force(t: Floats) -> Floats:
        return 25.0 * np.sin(2.0 * np.pi * (0.2 + 0.2 * t) * t)

    uneven = push(bench({**PLAIN, "friction_pull_N": 5.0, "friction_push_N": 2.0}), force, 4.0, K)
    even = push(bench({**PLAIN, "friction_N": 3.5, "offset_N": -1.5}), force, 4.0, K)
    np.testing.assert_allclose(uneven, even, atol=1e-12)


def test_friction_holds_from_rest_by_the_direction_of_the_force() -> None:
    rig = bench({**PLAIN, "friction_N": 1.0, "breakaway_N": 2.0, "friction_push_N": 3.0})
    for force, moves in ((1.9, False), (2.1, True), (-4.9, False), (-5.1, True)):
        assert bool(push(rig, force, 1.0, K)[-1] != 0.0) is moves


def test_neutral_there_is_no_friction() -> None:
    packed = pack(bench(PLAIN))[0]["parameters"]["friction"]
    assert (packed["dry"], packed["rigid"], packed["varies"]) == (0, 0, 0)
