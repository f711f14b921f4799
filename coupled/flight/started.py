"""A flight from trim on: its arrays, its frames, and its record so far."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.flight.bench import Airframe
from coupled.flight.companion import Companion, FlightAccess
from coupled.flight.flightservices import FlightServices
from coupled.flight.frames import Frames, Split
from coupled.flight.manifest import manifest
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Action
from coupled.flight.pilot.base import Look, Start
from coupled.flight.pilot.own import GivenForce, OwnPilot, force_of, gradient_of, reset_law
from coupled.flight.state import State
from coupled.record.channels import PRESSURE, ControlName, record_channels
from coupled.record.record import EndedEarly, Record
from coupled.rig.control import ControlArray
from coupled.rig.equations import specified_gradient
from coupled.rig.packing import pack
from coupled.rig.placed import Commands, Placed
from coupled.rig.recorder import is_exact, lateness, stamp

Floats = NDArray[np.float64]


class StartedFlight:
    """A flight of a manoeuvre with an aircraft in trim, for a number of `frames` that may grow.

    controls   the rig's controls in the kernels' arrays, in its order
    grips      each pilot's hand, by the control
    data       the record, a row a frame; future rows contain noise
    frames     the loop over its frames
    split      the halves of its frames, if it is `stepped` from outside, or if forces or gradients
               are given frame by frame
    """

    def __init__(
        self,
        manoeuvre: Manoeuvre,
        airframe: Airframe,
        frames: int,
        companion: Companion | None = None,
        stepped: bool = False,
    ) -> None:
        rig = manoeuvre.rig
        self.manoeuvre, self.airframe, self._companion = manoeuvre, airframe, companion
        self._stepped = stepped
        self._names = list(rig.controls)
        self._own_channels = record_channels(self._names, rig.flight is not None)
        self._actions = _actions(manoeuvre, airframe.motion()[PRESSURE])
        self.grips = {str(name): action.hand for name, action in self._actions.items()}
        self.controls = pack(rig, self.grips)
        self.served = FlightServices(
            manoeuvre, self.controls, companion is not None and companion.sets_services
        )
        self._noise = ChannelNoise(self._own_channels, rig.noise, manoeuvre.seed)
        self.data = np.zeros((0, len(self._own_channels)))
        self._hiss = None if is_exact(rig) else self.data
        self._script: Floats
        self.frames: Frames
        for law in (*self._laws().values(), *self._own_pilots().values()):
            reset_law(law)
        self.extend(frames)
        if companion is not None:
            own = (manoeuvre, airframe, self._own_channels, self.controls, self._script, self.data)
            companion.begin(FlightAccess(*own, self.grips, self.so_far))

    def _laws(self) -> Mapping[ControlName, Any]:
        return self.manoeuvre.gradient

    def _own_pilots(self) -> dict[ControlName, Any]:
        pilots = self.manoeuvre.pilots.items()
        return {name: pilot.law for name, pilot in pilots if isinstance(pilot, OwnPilot)}

    def extend(self, frames: int) -> None:
        """Extend the flight to a number of frames; `frames` is then a new loop."""
        manoeuvre, before = self.manoeuvre, len(self.data)
        rig, companion = manoeuvre.rig, self._companion
        more = self._noise.rows(frames - before)
        if self._hiss is not None:
            self._hiss = np.concatenate((self._hiss, more))
        self.data = np.concatenate((self.data, more)) if before else more
        nodes = frames * rig.substeps + 1
        script = _script(self._names, self._actions, nodes, 1.0 / (rig.frame_rate * rig.substeps))
        if before:
            kept = before * rig.substeps + 1
            script[:, :, :kept] = self._script[:, :, :kept]
        self._script = script
        self.served.extend(frames)
        real_loader = companion is not None and companion.real_loader
        placed = Placed(self.controls, script, self.data, rig.frame_rate, real_loader)
        self.split = self._split(placed)
        looks = _looks(self.controls, self._names, self._actions)
        made = Frames(manoeuvre, self.airframe, placed, self.served, looks, companion, self.split)
        if before:
            made.extra, made.done = self.frames.extra, self.frames.done
        self.frames = made

    def _split(self, placed: Placed) -> Split | None:
        """Return the halves of the frames, unless whole frames are flown."""
        pilots, laws = self.manoeuvre.pilots, self._laws()
        given = [i for i, n in enumerate(self._names) if isinstance(pilots.get(n), GivenForce)]
        if not (given or laws or self._stepped):
            return None
        halves, file = placed.in_halves(given), self.manoeuvre.file
        tables = self.controls["parameters"]["schedule"]
        bends = self.controls["parameters"]["modification"]

        def schedule(k: int) -> Commands:
            state, found = self.state(k), list[tuple[int, float]]()
            for name, law in laws.items():
                i = self._names.index(name)
                assumed = float(bends["bend"][i])
                most = 1.0 / assumed if assumed > 0.0 else math.inf
                found.append((i, gradient_of(law, state, file, name, most)))
            halves.undo(k)
            for i, gradient in found:  # a table of equal values, whatever the pressure
                tables["total_gradient"][i] = tables["second_gradient"][i] = gradient
            return halves.begin_again(k)

        own = self.forces if self._own_pilots() else None
        return Split(halves, own, schedule if laws else None)

    def forces(self, k: int) -> Commands:
        """Return the forces of the user's own pilots over frame k, N; 0 for other controls."""
        found = [0.0, 0.0, 0.0]
        state = self.state(k)
        for name, law in self._own_pilots().items():
            found[self._names.index(name)] = force_of(law, state, self.manoeuvre.file, name)
        return found[0], found[1], found[2]

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of a state: those of the record."""
        return (*self._own_channels, *self.served.channels, *self.manoeuvre.record_properties)

    def places(self) -> dict[str, int]:
        """Return the place of each channel in a state."""
        return {name: i for i, name in enumerate(self.channels)}

    def row(self, k: int) -> bytes:
        """Return the values of frame k, whose host has run, in the order of `channels`."""
        parts = [self.data[k]]
        if self.served.channels:
            parts.append(self.served.row(k))
        if self.manoeuvre.record_properties:
            parts.append(np.array(self.frames.extra[k]))
        return np.concatenate(parts).tobytes()

    def state(self, k: int) -> State:
        """Return the state at frame k, whose host has run."""
        return State(self.places(), self.row(k))

    def record(
        self,
        first: int,
        last: int,
        ended: EndedEarly | None = None,
        noted: Mapping[str, Any] = MappingProxyType({}),
    ) -> Record:
        """Return the record of the frames from `first` to before `last`, up to the first NaN.

        Its rows are the flight's own, so it is the end of the flight; `noted` are further entries
        of the manifest.
        """
        return self._record(self.data[first:last], first, ended, noted)

    def so_far(self, first: int, last: int) -> Record:
        """Return the record from frame `first` to before `last` of a flight in progress.

        A channel with an early time stamp needs later rows, so the record ends before them.
        """
        if self._hiss is None:
            return self._record(self.data[first:last].copy(), first)
        late = lateness(self.manoeuvre.rig).values()
        span = 3 + math.ceil(max((abs(frames) for frames in late), default=0.0))
        begin = max(0, first - span)
        record = self._record(self.data[begin:last].copy(), begin)
        return record.rows(first - begin, max(first, last - span) - begin)

    def flown(self, last: int, ended: EndedEarly | None) -> Record:
        """Return the record up to before frame `last`, as if the flight ended there."""
        return self._record(self.data[:last].copy(), 0, ended)

    def _record(
        self,
        data: Floats,
        first: int,
        ended: EndedEarly | None = None,
        noted: Mapping[str, Any] = MappingProxyType({}),
    ) -> Record:
        """Return the record of rows, of which the first is frame `first`."""
        manoeuvre, channels = self.manoeuvre, self._own_channels
        data, ended = _finite(data, manoeuvre.rig.frame_rate, ended)
        if self._hiss is not None:
            stamp(manoeuvre.rig, channels, data, self._hiss[first : first + len(data)])
        more, data = self.served.beside(data, first)
        channels = (*channels, *more)
        if manoeuvre.record_properties:
            channels = (*channels, *manoeuvre.record_properties)
            own = self.frames.extra[first : first + len(data)]
            data = np.column_stack((data, np.reshape(own, (len(data), -1))))
        return Record(channels, data, manifest(manoeuvre, channels, data, ended) | dict(noted))


def _looks(
    controls: ControlArray, names: Sequence[str], actions: dict[ControlName, Action]
) -> list[tuple[Any, Look]]:
    """Return the hands whose pilots observe the motion, with their functions."""
    hands = controls["state"]["hand"]
    return [(hands[names.index(n)], a.look) for n, a in actions.items() if a.look]


def _finite(
    data: Floats, rate_Hz: float, ended: EndedEarly | None
) -> tuple[Floats, EndedEarly | None]:
    """Return a record up to the first row that is not finite, and why the flight ended."""
    finite = np.isfinite(data)
    if finite.all():
        return data, ended
    lost = np.flatnonzero(~finite.all(axis=1))
    return data[: lost[0]], EndedEarly("the state is not finite", int(lost[0]) / rate_Hz)


def _actions(manoeuvre: Manoeuvre, pressure_Pa: float) -> dict[ControlName, Action]:
    """Return each pilot's action on a control, within reach, at the dynamic pressure of trim."""
    rig, found = manoeuvre.rig, {}
    for name, pilot in manoeuvre.pilots.items():
        gradient = float(specified_gradient(rig.controls[name].schedule, pressure_Pa))
        start = Start(gradient, manoeuvre.seed, manoeuvre.file, manoeuvre.rig_file)
        action = pilot.act(rig, name, start)
        hand = replace(action.hand, reach=pilot.reach(name))
        found[name] = replace(action, hand=hand)
    return found


def _script(names: Sequence[str], actions: dict[Any, Action], nodes: int, h: float) -> Floats:
    """Return the hands' script on all nodes, shape (controls, 2, nodes): N and d."""
    script = np.zeros((len(names), 2, nodes))  # allocated only where written
    for name, action in actions.items():
        force, held = script[names.index(name)]
        if action.force is not None:
            force[:] = action.force(_times(nodes, h))
        if action.held is not None:
            held[:] = action.held(_times(nodes, h))
    return script


@lru_cache(maxsize=1)
def _times(nodes: int, h: float) -> Floats:
    """Return the times of all nodes, s, cached for the flights of a sweep."""
    times: Floats = np.arange(nodes, dtype=np.float64) * h
    times.flags.writeable = False
    return times


class ChannelNoise:
    """The noise of a record's channels, drawn from a seed, row by row in their order."""

    def __init__(self, channels: tuple[str, ...], levels: dict[str, float], seed: int) -> None:
        self._sigma = np.array([levels.get(channel, 0.0) for channel in channels])
        # The hand's own force has no noise and draws none, so that seeds give the same as before.
        self._drawn = np.array([not channel.endswith("_hand_force_N") for channel in channels])
        self._rng = np.random.default_rng(seed)

    def rows(self, frames: int) -> Floats:
        """Return the next rows, zeros without noise."""
        hiss = np.zeros((frames, len(self._sigma)))
        if self._sigma.any():
            drawn = self._drawn
            hiss[:, drawn] = self._rng.standard_normal((frames, int(drawn.sum())))
            hiss *= self._sigma
        return hiss
