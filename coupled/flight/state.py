"""The state of a flight at one frame: a row of its record, with its channels by name."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping
from struct import Struct
from typing import Any, NoReturn

from coupled.errors import MissingKeyError, nearest, shown
from coupled.record.channels import TIME

_NUMBER_bytes = 8
_number = Struct("d").unpack_from


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

    __slots__ = ("_places", "_values")
    _places: Mapping[str, int]
    _values: bytes

    def __init__(self, places: Mapping[str, int], values: bytes) -> None:
        _set_places(self, places)
        _set_values(self, values)

    def __getattr__(self, name: str) -> float:
        at = self._places.get(name)
        if at is None:
            hint = nearest(name, self._places)
            raise AttributeError(f"a state has no {shown(name)}; {hint}", name=name, obj=self)
        return float(_number(self._values, _NUMBER_bytes * at)[0])

    def __getitem__(self, channel: str) -> float:
        at = self._places.get(channel) if isinstance(channel, str) else None
        if at is None:
            hint = nearest(str(channel), self._places)
            raise MissingKeyError("state", "", f"no channel {shown(str(channel))}; {hint}")
        return float(_number(self._values, _NUMBER_bytes * at)[0])

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, channel: object) -> bool:
        return channel in self._places

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a state is frozen; {shown(name)} cannot be set")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"a state is frozen; {shown(name)} cannot be deleted")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, State) and self.as_dict() == other.as_dict()

    def __hash__(self) -> int:
        return hash(self._values)

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *self._places})

    def __reduce__(self) -> tuple[Any, ...]:
        return State, (dict(self._places), self._values)

    def __repr__(self) -> str:
        first = ", ".join(f"{name}={self[name]:.6g}" for name in list(self._places)[:3])
        return f"State({first}, …; {len(self)} channels)"

    def as_dict(self) -> dict[str, float]:
        """Return the values by channel, SI."""
        return dict(zip(self._places, self.as_list(), strict=True))

    def as_list(self) -> list[float]:
        """Return the values in the channels' order, SI."""
        return array("d", self._values).tolist()


# The slots' own setters, since a state is made in every frame and has no other.
_set_places: Any = vars(State)["_places"].__set__
_set_values: Any = vars(State)["_values"].__set__
_new = object.__new__


def state_of(places: Mapping[str, int], values: bytes) -> State:
    """Return a state; quicker than the class, for every frame."""
    state = _new(State)
    _set_places(state, places)
    _set_values(state, values)
    return state


def time_of(state: State) -> str:
    """Return the time of a state in words, for messages."""
    return f"at {state[TIME]:.4g} s"
