"""Which law of the library contains which: it is the other at some value of a further parameter."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from coupled.gap.effects.effect import Effect

CONTAINS: dict[str, tuple[str, ...]] = {
    "presliding_friction": ("coulomb_friction",),
    "stribeck_friction": ("coulomb_friction", "presliding_friction"),
    "asymmetric_friction": ("coulomb_friction",),
    "soft_backlash": ("backlash",),
    "stiffening_bend": ("bend",),
    "bend_hysteresis": ("bend",),
    "structural_mode": ("bend",),
    "servo_delay": ("servo_lag",),
    "servo_tuning": ("servo_lag", "servo_delay"),
}


def contains(law: Effect, other: Effect) -> bool:
    """Tell whether a law contains another."""
    return other.name in CONTAINS.get(law.name, ())


def keys_of(effects: Iterable[Effect]) -> set[str]:
    """Return the keys of a rig file that effects free."""
    return {p.key for effect in effects for p in effect.parameters}


def distinct(library: Sequence[Effect], nuisances: Iterable[Effect]) -> list[Effect]:
    """Return the laws that are not another one beside its nuisance parameters.

    Dry friction yields before it slips, and how far is a nuisance parameter where the rig file does
    not give it: presliding friction is Coulomb friction then.
    """
    free = keys_of(nuisances)
    return [
        law
        for law in library
        if not any(
            contains(law, other) and keys_of([law]) - keys_of([other]) <= free for other in library
        )
    ]
