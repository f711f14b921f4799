"""The mains' hum in δc as read, as the loader's residual shows it: where a fit starts."""

from __future__ import annotations

import math
from collections.abc import Sequence

from coupled.gap.noise.lines import lines_in, tone_of
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import HUM_FROM_Hz
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig


def hums(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return amplitude in d, frequency in Hz and phase in rad of the hum that shows most, if any.

    By the first record: of the others each has a phase of its own (`sensed`).
    """
    ours = [output for output in outputs if output.stage == "loader"]
    if not ours:
        return []
    first = ours[0]
    for line in lines_in(first.residual(rig) * first.floor):
        seen_Hz = line.turn * first.frame_rate_Hz / (2.0 * math.pi)
        tone_Hz = tone_of(seen_Hz, first.frame_rate_Hz)
        if tone_Hz < HUM_FROM_Hz:
            continue
        turns = tone_Hz / first.frame_rate_Hz * 2.0 * math.pi
        # Folded from beyond an odd half of the frame rate, a tone runs backwards.
        backwards = math.cos(turns - line.turn) < math.cos(turns + line.turn)
        phase = math.remainder(math.pi - line.phase, 2.0 * math.pi) if backwards else line.phase
        return [
            {"amplitude_{d}": line.amplitude, "frequency_Hz": tone_Hz, "phase_rad": phase},
        ]
    return []
