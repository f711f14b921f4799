"""The true share of each effect of a trial in its stages' gaps, by simulation without it.

The budget of a diagnosis divides the power of a stage's residual (docs/diagnosis.md). Here the twin
is simulated with every subset of its effects and the same noise, and an effect's share is its
Shapley value. The rig's other properties, nuisance parameters and presliding, are not effects.
Noise is the residual of the rig without any effect, up to the noise floor: the rest of it is from
these properties.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from coupled.blind.trials.measure import outputs_of
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.budget import shapley_weights
from coupled.gap.signals.output import Output
from coupled.record.record import Record
from coupled.rig.rig import Rig

Subset = frozenset[str]


def true_shares(
    rig: Rig, records: Mapping[Subset, Record], stages: Sequence[str], *, apart: bool = False
) -> dict[str, dict[str, float]]:
    """Return {stage: {effect: its share of the residual's power}}.

    `rig` is the reference of the residuals: the nominal one, or the one built. `records` are the
    twin's, by its effects: all subsets of them. With `apart`, a stage is divided among its effects
    that show there; another effect that only changes its input stays.
    """
    flown = "airframe" in stages
    outputs = {had: outputs_of(rig, record, flown) for had, record in records.items()}
    return shares_of_outputs(rig, outputs, stages, apart=apart)


def shares_of_outputs(
    rig: Rig,
    outputs: Mapping[Subset, Sequence[Output]],
    stages: Sequence[str],
    *,
    apart: bool = False,
) -> dict[str, dict[str, float]]:
    """Return `true_shares` from the outputs of each record."""
    every = max(outputs, key=len)
    found = {}
    for stage in stages:
        judged = judged_outputs(stage, outputs[every], rig, every)
        if judged:
            powers = {had: _power(judged, made, rig) for had, made in outputs.items()}
            shown = effects_shown(judged, every) if apart else every
            others = every - shown
            found[stage] = share_power(
                shown, {had - others: power for had, power in powers.items() if others <= had}
            )
    return found


def judged_outputs(
    stage: str, outputs: Sequence[Output], rig: Rig, effects: Subset
) -> list[Output]:
    """Return the outputs whose power is divided: those with a gap.

    They are the stage's own, or for a stage without any those in which its effects show.
    """
    here = [BY_NAME[name] for name in effects if name in BY_NAME]
    shown = {output for effect in here if effect.stage == stage for output in effect.shows_in}
    names = STAGE_OF[stage].outputs or shown
    own = [output for output in outputs if output.stage in names]
    wide = [output for output in own if output.gap(rig) > output.limit]
    return wide or sorted(own, key=lambda output: -output.gap(rig))[:1]


def effects_shown(judged: Sequence[Output], effects: Subset) -> Subset:
    """Return the effects that show in some outputs; all of them if none does."""
    seen = {output.stage for output in judged}
    shown = {name for name in effects if name in BY_NAME and seen & {*BY_NAME[name].shows_in}}
    return frozenset(shown) or effects


def _power(judged: Sequence[Output], made: Sequence[Output], rig: Rig) -> float:
    """Return a record's residual power in some outputs, over their floors² with all effects."""
    known = {(output.stage, output.channel): output for output in made}
    total = 0.0
    for output in judged:
        other = known[output.stage, output.channel]
        total += (other.gap(rig) * other.floor / output.floor) ** 2
    return total / len(judged)


def share_power(every: Subset, powers: Mapping[Subset, float]) -> dict[str, float]:
    """Return each effect's share of the power with all effects, and that of noise.

    Noise is the power without any effect, at most one floor².
    """
    names = sorted(every)
    explained = [
        frozenset(name for i, name in enumerate(names) if subset & 1 << i)
        for subset in range(2 ** len(names))
    ]
    left = np.array([powers[every - known] for known in explained])
    without = powers[frozenset()]
    whole = powers[every] - without + min(without, 1.0)
    held = shapley_weights(len(names)) @ left
    return {name: float(share / whole) for name, share in zip(names, held, strict=True)}
