"""What each output of a fit weighs: by the time for which its noise lasts, not by its frames."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.descent import End
from coupled.gap.search.fit import fit_alone
from coupled.gap.search.intervals import cost_of_unit_likelihood
from coupled.gap.signals.output import Output, memory
from coupled.rig.rig import Rig
from tests.support import gaps

FRAMES, LASTS = 2400, 300.0
RATE_Hz = 120.0
BEND = BY_NAME["bend"]
RIG = gaps.nominal_rig(False)


def lasting_noise(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return noise of unit variance with the autocorrelation time `LASTS`, frames."""
    a = (LASTS - 1.0) / (LASTS + 1.0)
    drawn = rng.normal(size=20 * FRAMES)
    return np.asarray(lfilter([np.sqrt(1.0 - a**2)], [1.0, -a], drawn)[-FRAMES:])


def predicted(rig: Rig) -> NDArray[np.float64]:
    """Return a prediction of 1 for each 0.1 mm/N of bend."""
    return np.full(FRAMES, 1e4 * rig.controls["column"].loader.bend)


def test_an_output_whose_noise_lasts_weighs_as_little_as_it_knows() -> None:
    """A white output has the information N, the other N/λ: that of both is the white one's."""
    rng = np.random.default_rng(7)
    missed = held = 0.0
    draws = 60
    for _ in range(draws):
        sure = Output("linkage", "x", 2.0 + rng.normal(size=FRAMES), predicted, 1.0, RATE_Hz)
        vague = Output(
            "linkage", "y", 2.0 + lasting_noise(rng), predicted, 1.0, RATE_Hz, lasts=LASTS
        )
        found = fit_alone(RIG, "column", [sure, vague], [BEND], {"bend.bend_{d}_per_N": 1e-4})
        ((key, value),) = found.values.items()
        missed += (1e4 * value - 2.0) ** 2
        held += found.low[key] <= 2e-4 <= found.high[key]
    known = 1.0 / np.sqrt(FRAMES * (1.0 + 1.0 / LASTS))
    assert np.sqrt(missed / draws) == pytest.approx(known, rel=0.25)
    assert held >= 0.9 * draws


def test_records_of_unequal_length_keep_their_own_memories() -> None:
    """One unit of likelihood costs q·τ of the short smooth record; the long white one has less."""
    rng = np.random.default_rng(8)
    smooth, white = lasting_noise(rng)[:600], rng.normal(size=4 * FRAMES)
    rows = len(smooth) + len(white)
    end = End(np.zeros(1), 0.0, np.concatenate((smooth, white)), np.ones((rows, 1)))
    wanted = float(np.mean(smooth**2)) * memory(smooth)
    assert cost_of_unit_likelihood(end, [len(smooth), len(white)]) == pytest.approx(wanted)
