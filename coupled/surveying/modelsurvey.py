"""A survey of several JSBSim models."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

from coupled.parallel import as_done, cores, executor
from coupled.results import Displayed, Tabular, frame_of
from coupled.surveying.survey import Surveyed, chosen_models, survey

if TYPE_CHECKING:
    import polars as pl

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, repr=False)
class Survey(Sequence[Surveyed], Displayed, Tabular):
    """JSBSim models: where each trims or why not, how its controls move, its rigs."""

    models: tuple[Surveyed, ...]

    @overload
    def __getitem__(self, index: int) -> Surveyed: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Surveyed, ...]: ...

    def __getitem__(self, index: int | slice) -> Surveyed | tuple[Surveyed, ...]:
        return self.models[index]

    def __len__(self) -> int:
        return len(self.models)

    def __repr__(self) -> str:
        trimmed = sum(one.flight is not None for one in self.models)
        return f"Survey({len(self.models)} models, {trimmed} trim)"

    def as_dict(self) -> list[dict[str, Any]]:
        """Return the results of each model as JSON data."""
        return [one.as_dict() for one in self.models]

    def to_polars(self) -> pl.DataFrame:
        """Return one row per model; SI."""
        return frame_of(self.as_dict())


def survey_models(
    names: Sequence[str] = (), workers: int = 0, progress: Progress | None = None
) -> Survey:
    """Return the results of some models, or of all known models.

    `names` are models, their files, or folders of models. `workers` is the number of processes, 0
    for one per core. Raises InputError for other names.
    """
    chosen = chosen_models(names)
    found: list[Surveyed] = []
    # Each process holds a model and keeps a core busy: more processes than cores cost memory only.
    count = 1 if len(chosen) < 4 else min(cores(workers), cores(0), len(chosen))
    with executor(count) as pool:
        for one in as_done(pool, survey, [(each,) for each in chosen], 2 * count):
            found.append(one)
            if progress is not None:
                progress(one.model, len(found), len(chosen))
    order = [each.label for each in chosen]
    return Survey(tuple(sorted(found, key=lambda one: order.index(one.model))))
