"""Pilots with a script: force (step, ramp, doublet, 3-2-1-1, sweep), or a held deflection.

Edges are half cosines over `rise_s`, as those of a hand.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from coupled.arguments import public
from coupled.errors import InputError
from coupled.flight.pilot.base import STRONGEST, Action, Floats, Pilot, Start, edges
from coupled.record.channels import ControlName, unit_of
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig
from coupled.schema import quantity


@public
class _Levels(Pilot):
    """A force that moves from level to level."""

    force_N: float = quantity("", ge=-STRONGEST, le=STRONGEST)
    rise_s: float = quantity("", 0.1, ge=0, le=7200)

    @property
    def rests(self) -> bool:
        """Whether the force is zero."""
        return self.force_N == 0.0

    def levels(self) -> list[tuple[float, float]]:
        """Return the (time in s, share of the force) of each level."""
        raise NotImplementedError

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the scripted force."""

        def force(times: Floats) -> Floats:
            signal = edges(times, self.levels(), self.rise_s)
            signal *= self.force_N
            return signal

        return Action(force=force)


@public
class Step(_Levels):
    """A force held for `duration_s`, or to the end if that is 0.

    `force_N` to ±5000, a pull positive; it begins at `start_s` (1), its edges are half cosines
    of `rise_s` (0.1). Raises InputError as a run file does.

    >>> import coupled
    >>> coupled.Step(force_N=50, start_s=1, duration_s=3).force_N
    50.0
    >>> coupled.Step(force_lb=11)
    Traceback (most recent call last):
    coupled.errors.InputError: coupled.Step: force_lb: wrong unit: give force_N instead
    """

    kind: Literal["step"] = "step"
    duration_s: float = quantity("", 0.0, ge=0, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return one level, and its end."""
        end = [(self.start_s + self.duration_s, 0.0)] if self.duration_s > 0.0 else []
        return [(self.start_s, 1.0), *end]


@public
class Ramp(Pilot):
    """A force that grows linearly over `ramp_s`, and is then held.

    `force_N` to ±5000, a pull positive; it begins at `start_s` (1). Raises InputError as a run
    file does.

    >>> import coupled
    >>> coupled.Ramp(force_N=-40, ramp_s=2).start_s
    1.0
    """

    kind: Literal["ramp"] = "ramp"
    force_N: float = quantity("", ge=-STRONGEST, le=STRONGEST)
    ramp_s: float = quantity("", ge=1e-3, le=7200)

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the ramp."""

        def force(t: Floats) -> Floats:
            return np.asarray(self.force_N * np.clip((t - self.start_s) / self.ramp_s, 0.0, 1.0))

        return Action(force=force)


@public
class Doublet(_Levels):
    """A force in one direction, then for the same time in the other.

    `force_N` to ±5000, a pull first where positive; each half lasts `half_period_s`, from
    `start_s` (1), with edges of `rise_s` (0.1). Raises InputError as a run file does.

    >>> import coupled
    >>> coupled.Doublet(force_N=30, half_period_s=0.7).levels()
    [(1.0, 1.0), (1.7, -1.0), (2.4, 0.0)]
    """

    kind: Literal["doublet"] = "doublet"
    half_period_s: float = quantity("", ge=1e-3, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the two halves."""
        t, half = self.start_s, self.half_period_s
        return [(t, 1.0), (t + half, -1.0), (t + 2 * half, 0.0)]


@public
class ThreeTwoOneOne(_Levels):
    """The 3-2-1-1 of aircraft identification: alternating pulses of 3, 2, 1 and 1 units.

    `force_N` to ±5000, a pull first where positive; a unit lasts `unit_s`, from `start_s` (1),
    with edges of `rise_s` (0.1). Raises InputError as a run file does.

    >>> import coupled
    >>> coupled.ThreeTwoOneOne(force_N=30, unit_s=0.5).levels()[-1]
    (4.5, 0.0)
    """

    kind: Literal["3211"] = "3211"
    unit_s: float = quantity("", ge=1e-3, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the four pulses."""
        at = self.start_s + self.unit_s * np.array([0, 3, 5, 6, 7])
        return list(zip(at.tolist(), [1.0, -1.0, 1.0, -1.0, 0.0], strict=True))


@public
class FrequencySweep(Pilot):
    """A sine whose frequency goes exponentially from `low_Hz` (0.1) to `high_Hz` (2).

    Amplitude `force_N`, over `duration_s` from `start_s` (1), faded in and out over a tenth of
    it. Raises InputError as a run file does, and for more than half the frame rate.

    >>> import coupled
    >>> coupled.FrequencySweep(force_N=40, duration_s=30, high_Hz=3).low_Hz
    0.1
    """

    kind: Literal["sweep"] = "sweep"
    force_N: float = quantity("", ge=-STRONGEST, le=STRONGEST)
    duration_s: float = quantity("", ge=1e-3, le=7200)
    low_Hz: float = quantity("", 0.1, ge=1e-3, le=50)
    high_Hz: float = quantity("", 2.0, ge=1e-3, le=50)

    def check(self, rig: Rig, control: ControlName, file: object) -> None:
        """Refuse frequencies above the Nyquist frequency of the frames."""
        super().check(rig, control, file)
        if max(self.low_Hz, self.high_Hz) > 0.5 * rig.frame_rate:
            problem = f"is beyond half the frame rate, {0.5 * rig.frame_rate:g} Hz"
            raise InputError(file, f"pilot.{control}.high_Hz", problem)

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the sweep, faded in and out over a tenth of it."""

        def force(t: Floats) -> Floats:
            u = np.clip((t - self.start_s) / self.duration_s, 0.0, 1.0)
            ratio = np.log(self.high_Hz / self.low_Hz)
            scale = np.expm1(ratio * u) / ratio if ratio != 0.0 else u
            phase = 2.0 * np.pi * self.low_Hz * self.duration_s * scale
            fade = np.sin(0.5 * np.pi * np.clip(np.minimum(u, 1.0 - u) / 0.1, 0.0, 1.0)) ** 2
            return np.asarray(self.force_N * fade * np.sin(phase))

        return Action(force=force)


@public
class Clamp(Pilot):
    """Holds the grip at a deflection, with whatever force that requires.

    The clamp's impedance is computed from the rig's own mass, damping and gradient, so that the
    error of deflection decays as exp(−bandwidth·t) on any rig, without a steady-state error.
    `deflection_m` (`deflection_rad` on a wheel) within the travel, reached over `rise_s` (0.5)
    from `start_s` (1), for `duration_s` (0: to the end); `bandwidth_rad_per_s` (6). Raises
    InputError as a run file does.

    >>> import coupled
    >>> flight = coupled.fly("t37", column=coupled.Clamp(deflection_m=0.02), duration_s=4)
    >>> round(float(flight.record["column_deflection_m"][-1]), 3)
    0.02
    """

    kind: Literal["clamp"] = "clamp"
    deflection_m: float = quantity("", 0.0)
    deflection_rad: float = quantity("", 0.0)
    rise_s: float = quantity("", 0.5, gt=0)
    duration_s: float = quantity("", 0.0, ge=0, le=7200)
    bandwidth_rad_per_s: float = quantity("", 6.0, gt=0, le=30)
    _BY_UNIT: ClassVar[tuple[str, ...]] = ("reach", "deflection")

    def deflection(self, control: ControlName) -> float:
        """Return the deflection held on a control, d."""
        return self.deflection_rad if unit_of(control) == "rad" else self.deflection_m

    def check(self, rig: Rig, control: ControlName, file: object) -> None:
        """Refuse a deflection beyond the travel of its side."""
        super().check(rig, control, file)
        key = f"deflection_{unit_of(control)}"
        if key not in self.model_fields_set:
            raise InputError(file, f"pilot.{control}.{key}", "is missing")
        held, data = self.deflection(control), rig.controls[control]
        if abs(held) > data.travel_to(held):
            problem = f"{held:g} is beyond the control's travel, {-data.push:g} to {data.pull:g}"
            raise InputError(file, f"pilot.{control}.{key}", problem)

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the held deflection, and the clamp's impedance."""
        end = [(self.start_s + self.duration_s, 0.0)] if self.duration_s > 0.0 else []
        levels = [(self.start_s, 1.0), *end]
        w, held = self.bandwidth_rad_per_s, self.deflection(control)
        loader = rig.controls[control].loader
        hand = Hand(w * loader.damping, w * loader.mass, w * start.gradient)
        return Action(held=lambda t: held * edges(t, levels, self.rise_s), hand=hand)
