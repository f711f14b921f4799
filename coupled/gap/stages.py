"""Each stage's residual: what is measured less what the stage makes of its measured input.

The chain is cut at every measured signal, so that a fault upstream is inherited by nobody.
Inputs are smoothed (`smooth`). A residual is over its floor: its own noise and its inputs'.

    schedule      q̄ → G_T                       surface   δ̂, q̄ → its position
    loader        F, G_T, n_z → δc               sensing   δc as read, against its neighbours
    multiplier    δc, G_T → F_mod (part of the loader)
    linkage       δc, F → δ
    compensation  δc, F → δ̂ (the host's own arithmetic)

A wrong scale S₁ cannot be driven alone: it shows in all three of loader, multiplier and linkage.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupled.gap.floors import given_noise, noise_in, with_error
from coupled.gap.noise import Noise
from coupled.gap.output import Output, Predict, echoed, spread, white
from coupled.gap.ratchet import passed_noise, unratcheted
from coupled.gap.sensed import Sensed
from coupled.gap.served import asked, left, neutral, services
from coupled.gap.smooth import rate_of, smoothed
from coupled.gap.thresholds import (
    BROAD,
    ECHO_SHARE,
    NOISE_TRIES,
    PRELOAD_UNSURE,
    ROUNDING_SPAN,
    SURFACE_KNOWN,
    RESTART_s,
    SLOW_LOADER_s,
)
from coupled.record.channels import SURFACES, ControlName, channel
from coupled.record.record import Record
from coupled.rig.replay import (
    drive_linkage,
    drive_loader,
    on_nodes,
    replay_product,
    replay_schedule,
    replay_surface,
)
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reader:
    """Builds the outputs that a record lets judge, and says which channels lack."""

    rig: Rig
    record: Record
    control: ControlName
    # The map of a control's commands to its surface's positions; None where others move it, too.
    surface_points: Callable[[Rig, ControlName], tuple[Floats, Floats] | None]
    number: int = 0  # of the record, where there are several

    @property
    def surface(self) -> str:
        """The channel of the control's surface."""
        return f"{SURFACES[self.control]}_rad"

    def signal(self, quantity: str) -> Floats:
        """Return a control's channel."""
        return self.record[channel(self.control, quantity)]

    def others(self) -> dict[str, Floats]:
        """Return the forces in N on other controls of a common structure, where recorded."""
        if self.rig.structure.stands_apart:
            return {}
        held = {str(n): channel(n, "force") for n in self.rig.controls if n != self.control}
        return {name: self.record[force] for name, force in held.items() if force in self.record}

    def missing(self) -> dict[str, list[str]]:
        """Return the channels that each stage would need and the record lacks."""
        needs = {
            "schedule": ["dynamic_pressure_Pa", self._name("gradient")],
            "loader": [self._name(q) for q in ("force", "computed")] + self._gradient_from(),
            "multiplier": [self._name(q) for q in ("computed", "modifying_force")]
            + self._gradient_from(),
            "linkage": [self._name(q) for q in ("computed", "force", "deflection")],
            "compensation": [self._name(q) for q in ("computed", "force", "estimate")],
            "surface": [self._name("estimate"), "dynamic_pressure_Pa", self.surface],
        }
        lacking = {s: [n for n in names if n not in self.record] for s, names in needs.items()}
        return {stage: names for stage, names in lacking.items() if names}

    def _name(self, quantity: str) -> str:
        return channel(self.control, quantity)

    def _gradient_from(self) -> list[str]:
        """Return the channel that G_T is taken from: its own, or q̄ where the record lacks it."""
        own, pressure = self._name("gradient"), "dynamic_pressure_Pa"
        return [pressure if own not in self.record and pressure in self.record else own]

    def gradient(self) -> Floats:
        """Return G_T in N/d: as recorded, else what the nominal schedule makes of q̄."""
        if self._gradient_from() == [self._name("gradient")]:
            return self.signal("gradient")
        pressure = self.record["dynamic_pressure_Pa"]
        return replay_schedule(self.rig, self.control, smoothed(pressure)) * left(self)

    def second(self) -> Floats | None:
        """Return G_T beyond the break, which no record holds: what the schedule makes of q̄."""
        pressure = "dynamic_pressure_Pa"
        two = self.rig.controls[self.control].schedule.second_gradient is not None
        if not two or pressure not in self.record:
            return None
        smooth = smoothed(self.record[pressure])
        return replay_schedule(self.rig, self.control, smooth, beyond=True) * left(self)

    def outputs(self) -> list[Output]:
        """Return every output that the record lets judge, in the order of the chain."""
        lacking = self.missing()
        makers = {
            "schedule": self._schedule,
            "loader": self._loader,
            "multiplier": self._multiplier,
            "linkage": self._linkage,
            "surface": self._surface,
        }
        found = [out for stage, make in makers.items() if stage not in lacking for out in make()]
        return [out for out in found if np.isfinite(out.floor) and out.floor > 0.0]

    def _made(
        self,
        stage: str,
        name: str,
        measured: Floats,
        predict: Predict,
        noisy: Callable[[Rig, int], Floats],
        own: Noise,
    ) -> Output:
        """Return an output whose floor is its own noise and its input's, carried through."""
        base = predict(self.rig)
        tries = [noisy(self.rig, k) - base for k in range(NOISE_TRIES)]
        carried = float(np.sqrt(np.mean(np.square(tries))))
        floor = float(np.hypot(own.rms, carried))
        made = self._output(stage, name, measured, predict, floor)
        if floor <= 0.0:
            return made
        return replace(made, spread=spread(tries, own.rms, own.memory), smoothed=carried / floor)

    def _output(
        self, stage: str, name: str, measured: Floats, predict: Predict, floor: float
    ) -> Output:
        rate = self.rig.frame_rate
        return Output(stage, name, measured, predict, floor, rate, self.number)

    def _heard(self, quantity: str) -> Noise:
        """Return the noise of a control's channel."""
        return noise_in(self.rig, self._name(quantity), self.signal(quantity))

    def _schedule(self) -> list[Output]:
        pressure, gradient = self.record["dynamic_pressure_Pa"], self.signal("gradient")
        own, level = self._heard("gradient"), noise_in(self.rig, "dynamic_pressure_Pa", pressure)
        smooth = smoothed(pressure)

        def predict(rig: Rig, q: Floats = smooth) -> Floats:
            return replay_schedule(rig, self.control, q) * left(self)

        share, rest = echoed(gradient, predict(self.rig, pressure))
        if share > ECHO_SHARE:
            # The host's G_T holds the noise of q̄ as recorded: it was made from it, and no other.
            def as_read(rig: Rig) -> Floats:
                return predict(rig, pressure)

            floor = max(rest, ROUNDING_SPAN * float(np.ptp(gradient)))
            return [self._output("schedule", self._name("gradient"), gradient, as_read, floor)]

        def noisy(rig: Rig, k: int) -> Floats:
            return predict(rig, with_error(smooth, k, level))

        return [self._made("schedule", self._name("gradient"), gradient, predict, noisy, own)]

    def _loader(self) -> list[Output]:
        noisy_force, gradient = self.signal("force"), self.gradient()
        force, level = smoothed(noisy_force), self._heard("force")
        computed, second = self.signal("computed"), self.second()
        load = smoothed(self.record["load_factor"]) if "load_factor" in self.record else None
        smooth, own = smoothed(computed), self._heard("computed")
        every = round(RESTART_s * self.rig.frame_rate) if self._drifts(gradient) else 0

        def driven(f: Floats, seen: Floats) -> Predict:
            """Return the prediction for a force and the δc at which windows start."""
            nodes = on_nodes(self.rig, f)
            misread = computed - seen
            rate = rate_of(seen, self.rig.frame_rate) if every else seen

            def predict(rig: Rig) -> Floats:
                sensed = Sensed(rig, self.control)
                scale = sensed.scale(len(seen))
                restart = (every, seen / scale, rate / scale)
                pull = sensed.force_on_nodes(nodes, f)
                driven_by = (pull, gradient, misread, load, second, restart, services(self))
                return scale * drive_loader(rig, self.control, *driven_by)[0]

            return predict

        def noisy(rig: Rig, k: int) -> Floats:
            seen = with_error(smooth, k + NOISE_TRIES, own)
            return driven(with_error(force, k, level), seen)(rig)

        predict = driven(force, smooth)
        if level.rms > BROAD * float(np.std(noisy_force)):  # no noise, if the loader follows it
            rough = driven(noisy_force, smooth)
            if np.std(computed - rough(self.rig)) < np.std(computed - predict(self.rig)):
                level = given_noise(self.rig, self._name("force"), noisy_force)
                predict, force = rough, noisy_force
        return [self._made("loader", self._name("computed"), computed, predict, noisy, own)]

    def _drifts(self, gradient: Floats) -> bool:
        """Tell whether the loader has no spring to speak of: an open-loop replay would drift."""
        loader = self.rig.controls[self.control].loader
        softest = float(np.min(np.maximum(gradient, 0.0)))
        return softest * SLOW_LOADER_s**2 < 4.0 * np.pi**2 * loader.mass

    def _multiplier(self) -> list[Output]:
        """Return F_mod against the product it should be: of δc itself, or of δc as read.

        A digital product repeats the noise of the δc that it was made from, an analog one
        does not know of it; a wrong scale is in the one and not in the other.
        """
        computed, product = self.signal("computed"), self.signal("modifying_force")
        gradient, second, smooth = self.gradient(), self.second(), smoothed(computed)
        level, own = self._heard("computed"), self._heard("modifying_force")
        about = 0.0 * smooth + neutral(self)

        def made(rig: Rig, read: Floats) -> Floats:
            return replay_product(rig, self.control, read - about, gradient, second)

        # Around neutral a breakout makes F_mod jump, and noise in δc says there on which side.
        jump = made(self.rig, about + level.rms) - made(self.rig, about - level.rms)
        near = np.abs(smooth - about) < PRELOAD_UNSURE * level.rms
        unsure = near & (np.abs(jump) > PRELOAD_UNSURE * own.rms)

        def predict(rig: Rig, seen: Floats = smooth) -> Floats:
            digital = rig.controls[self.control].loader.multiplier == "digital"
            read = computed if digital else seen / Sensed(rig, self.control).scale(len(seen))
            return np.where(unsure, product, made(rig, read))

        def noisy(rig: Rig, k: int) -> Floats:
            return predict(rig, with_error(smooth, k, level))

        name = self._name("modifying_force")
        return [self._made("multiplier", name, product, predict, noisy, own)]

    def _linkage(self) -> list[Output]:
        computed, force, measured = map(self.signal, ("computed", "force", "deflection"))
        levels = self._heard("computed"), self._heard("force")
        smooth, smooth_force = map(smoothed, (computed, force))
        others = {name: smoothed(signal) for name, signal in self.others().items()}
        noise = passed_noise(self.rig, (computed, force), levels)

        def driven(c: Floats, f: Floats) -> Predict:
            nodes = on_nodes(self.rig, c)

            def at(rig: Rig, times: float) -> Floats:
                sensed = Sensed(rig, self.control)
                driven_by = sensed.both(nodes + times * noise[0], f + times * noise[1])
                return sensed.zero + drive_linkage(rig, self.control, *driven_by, others)

            return lambda rig: unratcheted(rig, self.control, at)

        def noisy(rig: Rig, k: int) -> Floats:
            f = with_error(smooth_force, k + NOISE_TRIES, levels[1])
            return driven(with_error(smooth, k, levels[0]), f)(rig)

        made = (measured, driven(smooth, smooth_force), noisy, self._heard("deflection"))
        return [self._made("linkage", self._name("deflection"), *made)]

    def _surface(self) -> list[Output]:
        points = None if self.rig.flight is None else self.surface_points(self.rig, self.control)
        if points is None:
            return []
        commands_at, positions = points
        estimate, measured = asked(self), self.record[self.surface]
        pressure = self.record["dynamic_pressure_Pa"]
        command = replay_surface(self.rig, self.control, estimate, pressure)

        def position(wanted: Floats) -> Floats:
            return np.interp(wanted, commands_at, positions)

        def predict(rig: Rig) -> Floats:
            commands = replay_surface(rig, self.control, estimate, pressure)
            # Row k is the answer to row k − 1; the first is the trim.
            return position(np.concatenate(([0.0], commands[:-1])))

        # The host's own noise is in δ̂ and reaches the surface: the floor is the sensor's alone.
        left = measured - position(np.concatenate(([0.0], command[:-1])))
        floor = float(np.hypot(white(left), SURFACE_KNOWN * np.ptp(measured)))
        return [self._output("surface", self.surface, measured, predict, floor)]
