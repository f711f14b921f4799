"""One structure under all controls: the bend at each control by forces on the others.

    δ_i = x_i + K_ii·F_i + Σ_j K_ij·F_j                      eq. (1) for three controls

K_ii is the loader's own bend; the off-diagonal terms are data here, deflection of the first control
by force on the second, zero for independent controls.

A linear structure is reciprocal (Maxwell-Betti): its compliance is symmetric between forces and the
displacements along them. A wheel's force acts at the rim, whose displacement is r·δ with r the
rim's radius, the wheel's `length_m`; so in the file's units

    K_column,wheel = r·K_wheel,column,   K_pedals,wheel = r·K_wheel,pedals,   K_cp = K_pc

This is not imposed, since readings determine one column of the matrix at a time. `reciprocal`
requests the check. Whatever the radius, the strain energy is positive only if all principal minors
of K are (scaling by r does not change their signs).

The felt forces: with ΔG of eq. (12) the loader of control i holds F_i = g_i·δc_i, and

    F = (1 + g·K)⁻¹·g·δ,     g = diag(G_i/(1 − K̂_ii·G_i))

The matrix form of eq. (12) would be F = G·(1 − K̂·G)⁻¹·δc. Its off-diagonal terms multiply another
control's δc, for which a loader has no multiplier. With the diagonal known, F_i = G_i·(δ_i −
Σ_j K_ij·F_j): the bend by other forces is felt as a shift of neutral, and is not corrected. Its
effect on the surfaces, δ̂_i = δc_i + Σ_j K̂_ij·F_j, is corrected by the host.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.record.channels import unit_of
from coupled.rig.parameters import Control
from coupled.schema import Section, file_keys, quantity

Floats = NDArray[np.float64]
RECIPROCAL_WITHIN = 0.01  # of the larger: the accuracy of a calibration


class Compliance(Section):
    """The off-diagonal terms of the compliance: the bend at a control by a force on another."""

    column_by_wheel: float = quantity("m_per_N", 0.0)
    column_by_pedals: float = quantity("m_per_N", 0.0)
    wheel_by_column: float = quantity("rad_per_N", 0.0)
    wheel_by_pedals: float = quantity("rad_per_N", 0.0)
    pedals_by_column: float = quantity("m_per_N", 0.0)
    pedals_by_wheel: float = quantity("m_per_N", 0.0)

    @property
    def diagonal(self) -> bool:
        """Whether all off-diagonal terms are zero."""
        return not any(getattr(self, name) for name in Compliance.model_fields)

    def between(self, names: Sequence[str]) -> Floats:
        """Return the off-diagonal terms for controls in this order, d/N, with a zero diagonal."""
        return np.array(
            [[0.0 if i == j else getattr(self, f"{i}_by_{j}") for j in names] for i in names]
        )


class Structure(Compliance):
    """The true structure, and the host's assumption for δ̂."""

    reciprocal: bool = False
    assumed: Compliance = Compliance()

    @property
    def stands_apart(self) -> bool:
        """Whether all controls are independent, in the rig and for its host."""
        return self.diagonal and self.assumed.diagonal


def whole(controls: Mapping[str, Control], terms: Compliance) -> Floats:
    """Return the whole K, d/N: the loaders' bends and the off-diagonal terms, controls in order."""
    bends = [min(_bends(control)) for control in controls.values()]
    return np.asarray(terms.between(list(controls)) + np.diag(bends))


def _bends(control: Control) -> tuple[float, float]:
    loader = control.loader
    return loader.bend, loader.bend if loader.bend_push is None else loader.bend_push


def check_structure(structure: Structure, controls: Mapping[str, Control], file: object) -> None:
    """Raise InputError for an impossible structure, with the terms."""
    if structure.stands_apart:
        return
    for path, terms in (("structure", structure), ("structure.assumed", structure.assumed)):
        for key, name in file_keys(Compliance, "m").items():
            for control in name.split("_by_"):
                if getattr(terms, name) and control not in controls:
                    raise InputError(file, f"{path}.{key}", f"the rig has no {control}")
    if structure.diagonal:
        return
    _check_linear(structure, controls, file)
    _check_work(structure, controls, file)
    _check_gradients(structure, controls, file)
    if structure.reciprocal:
        _check_reciprocal(structure, controls, file)


def _check_linear(structure: Structure, controls: Mapping[str, Control], file: object) -> None:
    terms = structure.between(list(controls))
    for k, (name, control) in enumerate(controls.items()):
        if control.loader.bend_limit > 0.0 and (terms[k].any() or terms[:, k].any()):
            key = f"controls.{name}.loader.bend_limit_{unit_of(name)}"
            raise InputError(file, key, "a structure that joins controls is linear; give 0")


def _check_work(structure: Structure, controls: Mapping[str, Control], file: object) -> None:
    """Refuse a structure with negative strain energy: a principal minor of K not positive."""
    names, bends = list(controls), whole(controls, structure)
    coupled = structure.between(names)
    for count in (2, 3):
        for chosen in combinations(range(len(names)), count):
            part = np.ix_(chosen, chosen)
            if not coupled[part].any():
                continue
            size = float(np.prod(np.diag(bends[part])))
            minor = float(np.linalg.det(bends[part]))
            if minor > 1e-9 * size or (minor == size == 0.0):
                continue
            between = ", ".join(names[k] for k in chosen)
            problem = f"the compliance of {between} is not positive definite: their bends' product"
            problem += f" is {size:.3g}, the determinant {minor:.3g}; lower the terms between them"
            raise InputError(file, "structure", problem)


def _check_gradients(structure: Structure, controls: Mapping[str, Control], file: object) -> None:
    """Refuse gradients too stiff for the structure: an eigenvalue of K·G_T of 1."""
    bends = structure.between(list(controls))
    bends = bends + np.diag([max(_bends(control)) for control in controls.values()])
    # G_T is linear between rows, and the eigenvalue convex in it: largest at a row.
    rows = sorted({q for c in controls.values() for q in c.schedule.dynamic_pressure})
    for q in rows:
        gradients = np.array([_stiffest(control, q) for control in controls.values()])
        most = float(np.max(np.linalg.eigvals(bends * gradients[None, :]).real))
        if most >= 1.0:
            problem = f"K·G_T has the eigenvalue {most:.3g} at {q:g} Pa: no gradients stiffer"
            problem += " than the structure can be given; all must stay below 1"
            raise InputError(file, "structure", problem)


def _stiffest(control: Control, pressure_Pa: float) -> float:
    schedule = control.schedule
    return max(
        float(np.interp(pressure_Pa, schedule.dynamic_pressure, table)) * max(schedule.slope, 1.0)
        for table in schedule.segments
    )


def _check_reciprocal(structure: Structure, controls: Mapping[str, Control], file: object) -> None:
    for one, two in combinations(controls, 2):
        radius = {one: 1.0, two: 1.0}
        if "wheel" in radius:
            radius["wheel"] = controls["wheel"].length
        there, back = getattr(structure, f"{one}_by_{two}"), getattr(structure, f"{two}_by_{one}")
        if there == back == 0.0:
            continue
        if 0.0 in radius.values():
            problem = "gives the rim's radius, which `reciprocal` needs"
            raise InputError(file, "controls.wheel.length_m", problem)
        wanted = radius[one] * there / radius[two]
        if abs(wanted - back) > RECIPROCAL_WITHIN * max(abs(wanted), abs(back)):
            key = f"structure.{two}_by_{one}_{unit_of(two)}_per_N"
            problem = f"is {back:.4g}; a linear structure is reciprocal: {wanted:.4g}"
            raise InputError(file, key, f"{problem} (or give reciprocal = false)")
