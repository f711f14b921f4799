"""The data of a rig: its sections, without what checks and changes them."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from coupled.arguments import public
from coupled.errors import InputError
from coupled.record.channels import ControlName
from coupled.rig.parameters import Control, Flight, PlainName, SurfaceProperties
from coupled.rig.structure import Structure
from coupled.schema import Section, quantity


class RigData(Section):
    """The sections of a rig file; SI."""

    name: PlainName
    frame_rate: float = quantity("Hz", ge=1, le=10_000)
    loader_rate: float = quantity("Hz", 2000.0, ge=2000, le=100_000)
    controls: dict[ControlName, Control]
    flight: Flight | None = None
    noise: dict[str, float] = {}
    structure: Structure = Structure()

    @model_validator(mode="after")
    def _give_surfaces(self) -> Self:
        """Give the aircraft the surfaces' properties of the controls."""
        if self.flight is not None:
            each = {str(name): control.properties for name, control in self.controls.items()}
            own = {name: given for name, given in each.items() if given != SurfaceProperties()}
            if own != self.flight.surfaces:
                self.__dict__["flight"] = self.flight.model_copy(update={"surfaces": own})
        return self

    @public
    def check_controlled(self, file: object = None) -> None:
        """Refuse a rig without a control; `file` is named in the fault, by default the rig."""
        if not self.controls:
            problem = "the rig has an aircraft only; give a rig with a control ([controls.column])"
            raise InputError(file or self.name, "controls", problem)
