"""Shared by the figures of a diagnosis: colours, units, and the rigs of each search depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.display import Shown, System, drawn
from coupled.gap.chain import stage_of
from coupled.gap.effects.effect import Effect
from coupled.gap.findings.diagnosis import PartDiagnosis
from coupled.gap.findings.result import StageResult
from coupled.gap.findings.summary import plain
from coupled.gap.signals.output import Floats, Output
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import FAULTY_FROM
from coupled.record.channels import CONTROL_NAMES
from coupled.record.record import Record
from coupled.rig.rig import Rig

# Colours of Okabe and Ito, as in the other figures: vermilion before the fit, green after it.
MEASURED, WRONG, RIGHT, RIVAL = "black", "#d55e00", "#009e73", "#0072b2"
FAINT, SHADE = "0.6", "#e4ecf4"
_LABELS = {
    "computed": "computed deflection δc",
    "deflection": "deflection δ at the grip",
    "estimate": "host's estimate δ̂",
    "gradient": "scheduled gradient G_T",
    "modifying_force": "modifying force F_mod",
    "force": "pilot's force F",
    "elevator": "elevator",
    "aileron": "aileron",
    "rudder": "rudder",
    "roll_rate": "roll rate",
    "yaw_rate": "yaw rate",
    "sideslip": "sideslip",
    "pitch": "pitch attitude",
    "roll": "bank angle",
    "heading": "heading",
    "pitch_rate": "pitch rate",
    "alpha": "angle of attack",
    "dynamic_pressure": "dynamic pressure q̄",
}


def channel_shown(name: str, system: System = "si", fine: bool = False) -> Shown:
    """Return the words and the drawn unit of a channel; `fine` for a residual, in mm."""
    return replace(drawn(name, system, fine), words=channel_label(name))


def channel_label(name: str) -> str:
    """Return the label of a channel in a figure, with its symbol."""
    first, rest = name.split("_", 1)
    bare = rest if first in CONTROL_NAMES else name
    for start in sorted(_LABELS, key=len, reverse=True):
        if bare.startswith(start):
            return _LABELS[start]
    return plain(bare)


def style_of(kind: str) -> dict[str, Any]:
    """Return the line style of a kind: measured, wrong (before), right (after) or rival."""
    styles: dict[str, dict[str, Any]] = {
        "measured": {"color": "0.7", "linewidth": 4.5, "zorder": 1.5},
        "wrong": {"color": WRONG, "linewidth": 1.4, "linestyle": "dashed"},
        "right": {"color": RIGHT, "linewidth": 1.5},
        "rival": {"color": RIVAL, "linewidth": 1.4, "linestyle": "dotted"},
    }
    return styles[kind]


@dataclass(frozen=True)
class View:
    """A diagnosis, its records, and the system of units in which it is drawn."""

    diagnosis: PartDiagnosis
    system: System = "si"

    @property
    def records(self) -> tuple[Record, ...]:
        """The records, in order."""
        return tuple(self.diagnosis.records.values())

    @property
    def stages(self) -> dict[str, StageResult]:
        """The result of each stage, by name."""
        return {stage.name: stage for stage in self.diagnosis.stages}

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects found, in the order of the search."""
        return tuple(step.effect for step in self.diagnosis.choice.steps)

    def rig_with(self, effects: Sequence[Effect]) -> Rig:
        """Return the nominal rig with some of the effects, at the values of the final fit."""
        whole = self.diagnosis
        if not effects:
            return whole.nominal
        if set(effects) == set(self.effects):
            return whole.improved
        return whole.rig_with(effects)

    def rungs(self) -> list[tuple[str, Rig]]:
        """Return the rigs from nominal to improved, with one more effect each, and their labels."""
        found = [("nominal", self.diagnosis.nominal)]
        for k, effect in enumerate(self.effects):
            found.append((f"+ {plain(effect.name)}", self.rig_with(self.effects[: k + 1])))
        return found

    def threshold(self, stage: str) -> float:
        """Return the normalised residual up to which a stage counts as explained."""
        found = self.stages.get(stage)
        return FAULTY_FROM if found is None else found.explained_below

    def suspects(self) -> list[Output]:
        """Return the outputs of faulty stages and of the effects found, by falling residual.

        Outputs within their noise floor are omitted, unless all are.
        """
        guilty = set(self.diagnosis.guilty)
        for effect in self.effects:
            guilty |= {stage_of(output) for output in effect.shows_in}
        every = self.diagnosis.outputs
        ours = [output for output in every if stage_of(output.stage) in guilty] or [*every]
        known = [(max(o.gap(self.diagnosis.nominal), self._left(o)), o) for o in ours]
        known.sort(key=lambda pair: -pair[0])
        wide = [output for gap, output in known if gap > FAULTY_FROM]
        return wide or [output for _, output in known]

    def _left(self, output: Output) -> float:
        return output.gap(self.diagnosis.improved)

    def readers(self, rig: Rig) -> list[Reading]:
        """Return the `Reading` of each record, which computes the inputs of the stages."""
        return [reader.under(rig) for reader in self.diagnosis.readers]

    def time(self, output: Output) -> Floats:
        """Return the times of the frames of an output, in s from the start of the record."""
        time = self.records[output.record].time_s
        return np.asarray(time - time[0])

    def source(self, output: Output) -> str:
        """Return the record file of an output as a suffix, or "" for a single record."""
        files = tuple(self.diagnosis.records)
        return "" if len(files) < 2 else f" ({files[output.record]})"
