"""A hand's force, node by node: impedance, mass, strength and muscle by their own equations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from coupled.rig import hand
from coupled.rig.packing import Hand, pack
from tests.support.rigs import K_REPORT, bench

H = 5e-4  # s


def packed(given: Hand, bend: float = K_REPORT) -> tuple[Any, Any]:
    """Return parameters and state of the bench's column with a hand on it."""
    (control,) = pack(bench({"bend_m_per_N": bend}), {"column": given})
    return control["parameters"], control["state"]


def asked(p: Any, s: Any, script: float, held: float, rate: float) -> tuple[float, float]:
    """Return the force that a hand would have at the next node, and its integral's gain, N."""
    gain = hand.command_force(
        p["hand"], s["hand"], p["linkage"], s["linkage"], script, held, rate, H
    )
    return float(s["hand"]["commanded"]), gain


@pytest.mark.parametrize("mass", [0.0, 0.6])
@pytest.mark.parametrize("bend", [0.0, K_REPORT])
def test_an_impedance_holds_its_equation_at_the_node_ahead(bend: float, mass: float) -> None:
    """F = script + u + k·(δ_set − δ) + c·(δ_set' − δ') + I − m·δ'', δ = grip + K·F bent by F."""
    k, c, i = 900.0, 40.0, 300.0
    p, s = packed(Hand(stiffness=k, damping=c, integral=i, mass=mass), bend)
    s["linkage"]["grip"], s["linkage"]["rate"] = 0.02, 0.03
    s["hand"]["force"], s["hand"]["integral"], s["hand"]["muscle"] = 7.0, 2.0, 1.5
    s["hand"]["at"], s["hand"]["moving"] = 0.0199, 0.02
    force, gain = asked(p, s, 4.0, 0.05, 0.1)
    at = 0.02 + bend * force
    rate_error = 0.1 - (0.03 + bend * (force - 7.0) / H)
    accelerated = ((at - 0.0199) / H - 0.02) / H
    wanted = 4.0 + 1.5 + k * (0.05 - at) + c * rate_error + 2.0 - mass * accelerated
    assert force == pytest.approx(wanted, rel=1e-9)
    assert gain == pytest.approx(i * H * (0.05 - at), rel=1e-9)
    hand.hold(p["hand"], s["hand"], p["linkage"], s["linkage"], force, gain, H)
    assert s["hand"]["force"] == force
    assert s["hand"]["integral"] == 2.0 + gain
    if mass:
        assert s["hand"]["at"] == pytest.approx(at, rel=1e-12)
        assert s["hand"]["moving"] == pytest.approx((at - 0.0199) / H, rel=1e-9)


def test_a_hand_without_impedance_pushes_as_its_script_and_muscle_do() -> None:
    p, s = packed(Hand())
    s["hand"]["muscle"] = 1.5
    assert asked(p, s, 4.0, 9.0, 9.0) == (5.5, 0.0)


IMPEDANCES = [Hand(stiffness=50.0), Hand(damping=5.0), Hand(integral=900.0), Hand(mass=0.5)]


@pytest.mark.parametrize("given", IMPEDANCES)
def test_each_gain_alone_is_an_impedance(given: Hand) -> None:
    assert hand.has_impedance(packed(given)[0]["hand"])
    assert not hand.is_scripted(packed(given)[0]["hand"])


def test_a_hand_that_lags_is_scripted_and_one_with_a_limit_is_not() -> None:
    assert hand.is_scripted(packed(Hand(lag_s=0.1))[0]["hand"])
    weak = packed(Hand(strongest=9.0, lasting=3.0))[0]["hand"]
    assert not hand.has_impedance(weak)
    assert not hand.is_scripted(weak)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("force", "lasts_s"), [(150.0, 2.0), (100.0, 2.0), (70.0, 4.0)])
def test_full_strength_lasts_for_the_endurance_and_comes_back_with_rest(
    force: float, lasts_s: float, side: float
) -> None:
    """effort' = (|F| − 40)/(100 − 40): 2 s at 100 N, 4 s at 70 N; back from none by 40/60 a s."""
    p, s = packed(Hand(strongest=100.0, lasting=40.0, endurance_s=2.0))
    h = 0.01

    def goes_on(force_N: float, steps: int) -> list[float]:
        found = []
        for _ in range(steps):
            hand.command_force(
                p["hand"], s["hand"], p["linkage"], s["linkage"], force_N, 0.0, 0.0, h
            )
            found.append(float(s["hand"]["commanded"]))
            hand.hold(p["hand"], s["hand"], p["linkage"], s["linkage"], found[-1], 0.0, h)
        return found

    steps = round(lasts_s / h)
    held = goes_on(side * force, steps + 2)
    assert held[: steps - 1] == pytest.approx(np.full(steps - 1, side * min(force, 100.0)))
    assert held[-1] == side * 40.0
    assert s["hand"]["effort"] == pytest.approx(2.0)
    goes_on(0.0, round(1.5 / h))
    assert s["hand"]["effort"] == pytest.approx(2.0 - 1.5 * 40.0 / 60.0)
    goes_on(0.0, round(2.0 / h))
    assert s["hand"]["effort"] == 0.0


def test_a_muscle_lags_its_command() -> None:
    p, s = packed(Hand(lag_s=0.05))
    s["hand"]["command"] = 10.0
    for _ in range(200):
        hand.move_muscle(p["hand"], s["hand"])
    assert s["hand"]["muscle"] == pytest.approx(10.0 * (1.0 - math.exp(-200 * H / 0.05)), rel=1e-9)
    s["hand"]["command"], s["hand"]["muscle"] = 0.0, 1e-101
    hand.move_muscle(p["hand"], s["hand"])
    assert s["hand"]["muscle"] == 0.0
