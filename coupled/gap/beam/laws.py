"""Laws that contain one another, and the numbers that effects free."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from coupled.gap.effects.effect import Effect


def contains(law: Effect, other: Effect) -> bool:
    """Tell whether a law contains another."""
    return other.name in law.contains


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
