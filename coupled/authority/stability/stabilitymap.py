"""The stability of a rig: limits at the stiffest gradient, and maps over K·G_T."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coupled.authority.stability.aircraft import BobWeight, bob_weight
from coupled.authority.stability.limits import (
    Disagreement,
    StabilityLimits,
    disagreement,
    stability_limits,
)
from coupled.authority.stability.local import about_rest
from coupled.authority.stability.planes import Kind, Plane, kinds_of, plane
from coupled.errors import InputError, nearest
from coupled.record.channels import ControlName, unit_of
from coupled.results import TableResult, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

Progress = Callable[[str, int, int], None]
QUANTITIES: dict[Kind, str] = {
    "assumed": "assumed_over_real_bend",
    "frame": "frame_s",
    "hand": "hand_stiffness_times_bend",
    "servo": "servo_frequency_Hz",
    "gauge": "gauge_frequency_Hz",
    "mass": "gauge_mass_over_loader_mass",
}


@dataclass(frozen=True, repr=False)
class Stability(TableResult):
    """The stability of a rig: the limits of each control, and maps (`planes`) over K·G_T.

    `bob_weight` is the limit through the aircraft, or None.
    """

    rig: Rig
    limits: tuple[StabilityLimits, ...]
    planes: tuple[Plane, ...]
    bob_weight: BobWeight | None

    @property
    def disagreement(self) -> Disagreement:
        """The differences of simulated limits from those of linear theory."""
        return disagreement(self.planes)

    @property
    def stable(self) -> bool:
        """Whether all values of the rig are on the stable side."""
        return not any(limit.outside for control in self.limits for limit in control.limits)

    @property
    def by_control(self) -> dict[ControlName, list[Plane]]:
        """The maps of each control."""
        names = dict.fromkeys(one.control for one in self.planes)
        return {name: [one for one in self.planes if one.control == name] for name in names}

    def __repr__(self) -> str:
        word = "stable as filed" if self.stable else "unstable as filed"
        names = ", ".join(control.control for control in self.limits)
        return f"Stability({self.rig.name}: {names} {word}; {self.disagreement.words})"

    def as_dict(self) -> dict[str, Any]:
        """Return the limits as JSON data."""
        apart = self.disagreement
        return {
            "rig": self.rig.name,
            "controls": [each.as_dict() for each in self.limits],
            "greatest_difference_percent": None if apart.worst is None else 100.0 * apart.worst,
            "limits_without_theory": apart.alone,
        }

    def to_polars(self) -> pl.DataFrame:
        """Return the maps, one row per simulated cell."""
        return frame_of(
            [
                {
                    "control": one.control,
                    "quantity": QUANTITIES[one.kind],
                    "value": float(value),
                    "bend_times_gradient": float(share),
                    "gradient": float(share) / self.rig.controls[one.control].loader.bend,
                    "gradient_unit": f"N/{unit_of(one.control)}",
                    "simulated_growth_per_s": float(one.simulated[i, j]),
                    "theory_growth_per_s": float(one.theory[i, j]),
                }
                for one in self.planes
                for i, share in enumerate(one.shares)
                for j, value in enumerate(one.values)
            ]
        )


def compliant_controls(
    rig: Rig, control: str | None = None, key: str = "control"
) -> list[ControlName]:
    """Return the controls with structural compliance, one or all.

    Raises InputError for `key` if the rig does not have the control, or none has compliance.
    """
    file = Path(rig.place)
    rig.check_controlled(file)
    names = [name for name in rig.controls if control in (None, name)]
    if not names:
        problem = f"no {control!r}; {nearest(str(control), rig.controls)}"
        raise InputError(file, key, problem)
    local = about_rest(rig)
    bent = [name for name in names if local.controls[name].loader.bend > 0.0]
    if not bent:
        key = f"controls.{names[0]}.loader.bend_{unit_of(names[0])}_per_N"
        raise InputError(file, key, "is 0 and nothing bends; a map over K·G_T needs a K above 0")
    return bent


def map_stability(
    rig: Rig, bent: Sequence[ControlName], progress: Progress | None = None
) -> Stability:
    """Return the stability for small motions of the controls `bent`, which have compliance."""
    rig = about_rest(rig)
    asked = [(name, kind) for name in bent for kind in kinds_of(rig.controls[name])]
    limits = tuple(stability_limits(rig, name) for name in bent)
    bob = bob_weight(rig, Path(rig.place)) if "column" in bent else None
    return Stability(rig, limits, _planes(rig, asked, progress), bob)


def _planes(
    rig: Rig, asked: Sequence[tuple[ControlName, Kind]], progress: Progress | None
) -> tuple[Plane, ...]:
    made = []
    for done, (name, kind) in enumerate(asked):
        if progress is not None:
            progress(f"{name}, {kind}", done, len(asked))
        made.append(plane(rig, name, kind))
    return tuple(made)
