"""The stages of the signal chain in a diagnosis, defined in this module alone.

Tables, figures and JSON list the stages in the order of the chain. The inputs and predictions of
the stages are in `stages` and `airframe`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from coupled.record.channels import ControlName


@dataclass(frozen=True)
class Stage:
    """One stage: the outputs that judge it, and its display in figures.

    The gap of a stage is taken over its `outputs`. An effect of the stage shows in the outputs
    `effects_show_in`, unless the effect has outputs of its own. A stage without outputs shows only
    in those of its neighbours. `drive` is the symbol and name of the quantity or channel that
    drives the stage; an airframe is driven by all surfaces.
    `color` is of the palette of Okabe and Ito.
    """

    name: str
    outputs: tuple[str, ...]
    color: str
    effects_show_in: tuple[str, ...]
    drive: tuple[str, str] = ("", "")


CHAIN: tuple[Stage, ...] = (
    Stage("schedule", ("schedule",), "#cc79a7", ("schedule",), drive=("q̄", "dynamic_pressure_Pa")),
    Stage("loader", ("loader", "multiplier"), "#0072b2", ("loader",), drive=("F", "force")),
    Stage("sensing", (), "#56b4e9", ("loader", "multiplier", "linkage")),
    Stage("linkage", ("linkage",), "#d55e00", ("linkage",)),
    Stage("compensation", ("compensation",), "#e69f00", ("compensation",)),
    Stage("surface", ("surface",), "#009e73", ("surface",)),
    Stage("airframe", ("airframe",), "black", ("airframe",)),
)
BY_NAME = {stage.name: stage for stage in CHAIN}
STAGES = tuple(BY_NAME)
AIRFRAME = "airframe"
OF_FLIGHT = "flight."  # how the keys of the aircraft start in a rig file


@dataclass(frozen=True)
class Part:
    """The stages that one search judges: a control's `own`, the airframe, or both.

    If the records move one control, they are one part. If they move several, the stages of each
    control up to its surface are a part, and the airframe, which all of them move, is another. Its
    `control` is the first; sizes of the aircraft's effects are compared in regimes of its motion.
    """

    control: ControlName
    own: bool = True
    airframe: bool = True

    @property
    def name(self) -> str:
        """The control, or `airframe`."""
        return self.control if self.own else AIRFRAME

    def judges(self, stage: str) -> bool:
        """Tell whether a stage belongs to the part."""
        return self.airframe if stage == AIRFRAME else self.own

    def frees(self, keys: Iterable[str]) -> bool:
        """Tell whether an effect that frees these keys of a rig file is tried in the part."""
        of_flight = all(key.startswith(OF_FLIGHT) for key in keys)
        return self.airframe if of_flight else self.own

    def owner(self, stage: str) -> ControlName | None:
        """Return the control of a stage; None for the airframe and the sensors of its motion."""
        return self.control if self.own and stage != AIRFRAME else None


def stage_of(output: str) -> str:
    """Return the stage of an output; the output `multiplier`, F_mod, is of the loader."""
    return next((stage.name for stage in CHAIN if output in stage.outputs), output)
