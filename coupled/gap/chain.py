"""The stages of the signal chain as a diagnosis knows them: listed here, and nowhere else.

The order is that of the chain; tables, figures and JSON follow it. What a stage is driven by, and
its replay, is in `stages` and `airframe`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """One stage: the outputs that judge it, and how figures show it.

    `outputs` are those that its gap is taken over. `effects_show_in` are those in which an effect
    of it shows, unless the effect says otherwise. A stage without outputs of its own shows only
    in those of its neighbours. `flown`: to replay it is to fly the aircraft, so a size is not
    scanned. `drive` is the quantity of the control, or the channel, that drives it, by its symbol.
    `color` is one of Okabe and Ito's.
    """

    name: str
    outputs: tuple[str, ...]
    color: str
    effects_show_in: tuple[str, ...]
    flown: bool = False
    drive: tuple[str, str] = ("", "")


CHAIN: tuple[Stage, ...] = (
    Stage("schedule", ("schedule",), "#cc79a7", ("schedule",), drive=("q̄", "dynamic_pressure_Pa")),
    Stage("loader", ("loader", "multiplier"), "#0072b2", ("loader",), drive=("F", "force")),
    Stage("sensing", (), "#56b4e9", ("loader", "multiplier", "linkage")),
    Stage("linkage", ("linkage",), "#d55e00", ("linkage",)),
    Stage("compensation", ("compensation",), "#e69f00", ("compensation",)),
    Stage("surface", ("surface",), "#009e73", ("surface",)),
    Stage(
        "airframe",
        ("airframe",),
        "black",
        ("airframe",),
        flown=True,
        drive=("elevator, nose up", "elevator_rad"),
    ),
)
BY_NAME = {stage.name: stage for stage in CHAIN}
STAGES = tuple(BY_NAME)


def stage_of(output: str) -> str:
    """Return the stage that an output judges: F_mod, the multiplier's, is the loader's."""
    return next((stage.name for stage in CHAIN if output in stage.outputs), output)
