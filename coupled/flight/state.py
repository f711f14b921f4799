"""The state of a flight at one frame: a row of its record, with its channels by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, NoReturn

from coupled.errors import MissingKeyError, nearest, shown
from coupled.record.channels import TIME


class Rows(NamedTuple):
    """The numbers of one row or of many, one after the other, and each channel's place in a row."""

    places: Mapping[str, int]
    numbers: memoryview[float]


class State:
    """The channels of a flight at one frame, frozen: those of its record, SI, by their names.

    `state.column_force_N` and `state["column_force_N"]` are the same number; `iter(state)` gives
    the names, `state.as_dict()` all. The host has read its sensors and set its commands for this
    frame. A pull, right wheel and right pedal are positive. An unknown name raises an InputError,
    or an AttributeError, with the nearest name.

    >>> import coupled
    >>> with coupled.Session("t37") as session:
    ...     state = session.state
    >>> round(state.altitude_m), state["time_s"], len(state)
    (1500, 0.0, 46)
    """

    __slots__ = ("_rows", "_start")
    _rows: Rows
    _start: int

    def __init__(self, places: Mapping[str, int], values: bytes) -> None:
        _set_rows(self, Rows(places, memoryview(values).cast("d")))
        _set_start(self, 0)

    def __getattr__(self, name: str) -> float:
        places, numbers = self._rows
        at = places.get(name)
        if at is None:
            hint = nearest(name, places)
            raise AttributeError(f"a state has no {shown(name)}; {hint}", name=name, obj=self)
        found: float = numbers[self._start + at]
        return found

    def __getitem__(self, channel: str) -> float:
        places, numbers = self._rows
        at = places.get(channel) if isinstance(channel, str) else None
        if at is None:
            hint = nearest(str(channel), places)
            raise MissingKeyError("state", "", f"no channel {shown(str(channel))}; {hint}")
        found: float = numbers[self._start + at]
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows.places)

    def __len__(self) -> int:
        return len(self._rows.places)

    def __contains__(self, channel: object) -> bool:
        return channel in self._rows.places

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a state is frozen; {shown(name)} cannot be set")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"a state is frozen; {shown(name)} cannot be deleted")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, State) and self.as_dict() == other.as_dict()

    def __hash__(self) -> int:
        return hash(self._own().tobytes())

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *self._rows.places})

    def __reduce__(self) -> tuple[Any, ...]:
        return State, (dict(self._rows.places), self._own().tobytes())

    def __repr__(self) -> str:
        first = ", ".join(f"{name}={self[name]:.6g}" for name in list(self)[:3])
        return f"State({first}, …; {len(self)} channels)"

    def as_dict(self) -> dict[str, float]:
        """Return the values by channel, SI."""
        return dict(zip(self, self.as_list(), strict=True))

    def as_list(self) -> list[float]:
        """Return the values in the channels' order, SI."""
        return list(self._own())

    def _own(self) -> memoryview[float]:
        """Return this row's numbers."""
        return self._rows.numbers[self._start : self._start + len(self)]


# The slots' own setters, since a state is made in every frame and has no other.
_set_rows: Any = vars(State)["_rows"].__set__
_set_start: Any = vars(State)["_start"].__set__


def state_reader(places: Mapping[str, int], rows: memoryview) -> Callable[[int], State]:
    """Return a function that returns the state of a row; the state reads `rows` on access.

    So it costs little in every frame. `rows` has shape (frames, channels). Before a row changes,
    `copy_row` copies the row into its state.
    """
    shared, width = Rows(places, rows.cast("B").cast("d")), len(places)
    new, set_rows, set_start = object.__new__, _set_rows, _set_start

    def read(k: int) -> State:
        state = new(State)
        set_rows(state, shared)
        set_start(state, k * width)
        return state

    return read


def copy_row(state: State) -> None:
    """Copy a state's row into the state, before the row changes."""
    numbers = memoryview(state._own().tobytes()).cast("d")
    _set_rows(state, Rows(state._rows.places, numbers))
    _set_start(state, 0)


def time_of(state: State) -> str:
    """Return the time of a state in words, for messages."""
    return f"at {state[TIME]:.4g} s"
