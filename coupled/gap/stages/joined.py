"""The outputs in which effects show in records without an output of the linkage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect
from coupled.gap.signals.output import Output
from coupled.gap.stages.imposed import under_motion
from coupled.gap.stages.stages import Reader


def as_judged(
    effects: Sequence[Effect], readers: Sequence[Reader], outputs: Sequence[Output]
) -> list[Effect]:
    """Return effects with the outputs in which they show in these records.

    Effects that show in no output are left out.
    """
    if any(output.in_series for output in outputs):
        return _in_series(effects, any(output.stage == "linkage" for output in outputs))
    if readers[0].moved:
        return under_motion(effects, readers[0].imposed)
    return list(effects)


def _in_series(effects: Sequence[Effect], separate: bool) -> list[Effect]:
    """Return effects for loader and linkage in series; those of the linkage show in the loader.

    `separate`: other records have δc, and judge the linkage separately as well. Otherwise effects
    of the sensor of δc are left out.
    """

    def shown(effect: Effect) -> Effect:
        if "linkage" not in effect.shows_in:
            return effect
        others = [name for name in effect.shows_in if name != "linkage" or separate]
        return replace(effect, outputs=tuple(dict.fromkeys((*others, "loader"))))

    return [shown(effect) for effect in effects if separate or not effect.of_sensor]
