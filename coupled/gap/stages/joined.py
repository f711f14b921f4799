"""Where no output judges the linkage alone: which effects show in the loader's output instead."""

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

    Effects that show in none of them are left out.
    """
    if any(output.in_series for output in outputs):
        return _in_series(effects, any(output.stage == "linkage" for output in outputs))
    if readers[0].moved:
        return under_motion(effects, readers[0].imposed)
    return list(effects)


def _in_series(effects: Sequence[Effect], separate: bool) -> list[Effect]:
    """Return effects for loader and linkage in series; the linkage's show in the loader's output.

    `separate` where other records have δc, and judge the linkage alone as well. Effects of the
    sensor of δc are left out where none has it.
    """

    def shown(effect: Effect) -> Effect:
        if "linkage" not in effect.shows_in:
            return effect
        others = [name for name in effect.shows_in if name != "linkage" or separate]
        return replace(effect, outputs=tuple(dict.fromkeys((*others, "loader"))))

    return [shown(effect) for effect in effects if separate or not effect.of_sensor]
