"""The pool of a version's trials: effects, outsiders and rigs, fixed with the version.

A published score is of a version and a seed. So the pool of a version is data of its own,
`versions/vN/`, not the package's rigs or its twin's effects, which grow. The order of the lists
matters, since a draw is an index into a list.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from coupled.blind.trials import NEWEST
from coupled.blind.trials.whole import Whole
from coupled.blind.twin.conditions import PLAIN, Realism
from coupled.blind.twin.effects import EFFECTS
from coupled.blind.twin.kinds import Kind
from coupled.blind.twin.outsiders import OUTSIDERS
from coupled.blind.twin.revision2 import REVISION_2
from coupled.errors import InputError, nearest
from coupled.gap.effects.library import BY_NAME
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.schema import load_toml

VERSIONS = Path(__file__).parent / "versions"
KNOWN = tuple(range(1, NEWEST + 1))
DEFAULT = NEWEST


@dataclass(frozen=True)
class Deck:
    """The pool of a version's trials.

    `built`: budgets and readings are of the rig as built, with its other properties. `whole`: the
    records are of whole aircraft, with effects of their own.
    """

    version: int
    effects: tuple[Kind, ...]
    outsiders: tuple[Kind, ...]
    rigs: Mapping[str, Rig]
    realism: Realism = PLAIN
    built: bool = False
    whole: Whole | None = None

    def kinds(self, category: str) -> tuple[Kind, ...]:
        """Return the kinds that a trial of a category may have."""
        return self.outsiders if category == "outsider" else self.effects

    def kind(self, category: str, name: str) -> Kind:
        """Return a kind by name."""
        return next(kind for kind in self.kinds(category) if kind.name == name)


def read_deck(version: int) -> Deck:
    """Return the deck of a version. Raises InputError for an unknown version."""
    if version not in KNOWN:
        known = ", ".join(map(str, KNOWN))
        raise InputError("--trials", "", f"there is no version {version}; known: {known}")
    folder = VERSIONS / f"v{version}"
    path = folder / "deck.toml"
    table = load_toml(path)
    if "like" in table:
        like = read_deck(int(str(table["like"]).removeprefix("v")))
        return replace(like, version=version, built=table["truth"] == "built")
    if "airframe" in table:
        whole = Whole(*(table[name] for name in ("airframe", "control", "force_N", "noise")))
        for name in (*whole.airframe, *whole.control):
            if name not in BY_NAME:
                raise InputError(path, name, f"is no effect; {nearest(name, BY_NAME)}")
        return Deck(version, (), (), _rigs(folder, table), whole=whole)
    homes = VERSIONS / str(table.get("rigs_of", folder.name))
    return Deck(
        version,
        _sized(path, table, _chosen(path, "effects", table, (*EFFECTS, *REVISION_2))),
        _chosen(path, "outsiders", table, OUTSIDERS),
        _rigs(homes, table),
        Realism(**{name: _tuple(value) for name, value in table.get("realism", {}).items()}),
    )


def _rigs(home: Path, table: Mapping[str, Any]) -> dict[str, Rig]:
    """Return the rigs that a deck names, from the folder of a version."""
    return {str(name): read_rig(home / "rigs" / f"{name}.toml") for name in table["rigs"]}


def _sized(path: Path, table: Mapping[str, Any], kinds: tuple[Kind, ...]) -> tuple[Kind, ...]:
    """Return kinds with the least sizes of the deck, if it gives them."""
    least = table.get("least", {})
    for name in least:
        if name not in [kind.name for kind in kinds]:
            raise InputError(path, f"least.{name}", "is no effect of this deck")
    return tuple(replace(kind, least=least.get(kind.name, kind.least)) for kind in kinds)


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _chosen(
    path: Path, key: str, table: Mapping[str, Any], kinds: Iterable[Kind]
) -> tuple[Kind, ...]:
    """Return the kinds that a list of the deck names, in its order."""
    by_name = {kind.name: kind for kind in kinds}
    for name in table[key]:
        if name not in by_name:
            raise InputError(path, key, f"the twin has no {name}; {nearest(name, by_name)}")
    return tuple(by_name[name] for name in table[key])
