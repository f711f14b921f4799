"""The residual of each stage: measured output minus prediction from the measured input.

The chain is cut at every measured signal, so a fault upstream does not affect a stage. Inputs are
smoothed (`smooth`). A residual is divided by its noise floor: its own noise and its inputs'.

    schedule      q̄ → G_T                       surface   δ̂, q̄ → its position
    loader        F, G_T, n_z → δc               sensing   δc as read, against its neighbours
    multiplier    δc, G_T → F_mod (part of the loader)
    linkage       δc, F → δ
    compensation  δc, F → δ̂ (equations of the host)

A wrong scale S₁ has no output of its own: it shows in loader, multiplier and linkage.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise, rms_of
from coupled.gap.noise.smooth import Smoother, rate_of, smoothed
from coupled.gap.signals.conditions import reach_of, trim_shift
from coupled.gap.signals.floors import (
    Drive,
    given_noise,
    left_noise,
    noise_in,
    remove_projection,
    share_from_source,
    share_in_response,
    unsmoothed,
    with_error,
)
from coupled.gap.signals.live import Mask
from coupled.gap.signals.output import Floats, HiddenGap, Output, Predict, estimate_noise, spread
from coupled.gap.signals.reading import Reading, drifts
from coupled.gap.stages.inputs import (
    Driven,
    Noisy,
    creeps,
    in_series,
    under_motion,
    without_backlash_creep,
    without_friction_creep,
)
from coupled.gap.stages.openloop import about
from coupled.gap.stages.surfaces import asked_of, filed_trim, surface_channel, trim_of
from coupled.gap.thresholds import (
    FAR_SIGMAS,
    KNOWN,
    MINOR,
    MOST,
    NEARLY_ALL,
    REPLAY_KNOWN,
    ROUNDING_SPAN,
    SIGMAS,
    SMALL,
    TRIES,
    COARSE_STEPS_Hz,
    PIECE_s,
    STRETCH_s,
)
from coupled.parallel import in_threads
from coupled.rig.hosted import Hosted, held_over
from coupled.rig.nodes import Nodes
from coupled.rig.replay import (
    drive_linkage,
    drive_loader,
    replay_compensation,
    replay_product,
    replay_schedule,
    replay_surface,
)
from coupled.rig.rig import Rig
from coupled.rig.serving import held_force

STEPPED = ("loader", "linkage")  # stages that run at the loader's own steps


def hosted_by(reading: Reading) -> Hosted:
    """Return what a record contains of services and host, and where the cab stopped the grip."""
    held = held_force(reading.rig, reading.record, reading.control)
    assumed = reading.assumed()
    more = None if assumed is None else assumed.gradient
    return Hosted(reading.services(), None, held, reach_of(reading.record, reading.control), more)


@dataclass(frozen=True)
class Reader(Reading):
    """Builds the outputs that a record allows, and lists missing channels."""

    def outputs(self) -> list[Output]:
        """Return every output that the record allows, in the order of the chain; no airframe's."""
        if not self.rig.controls:
            return []
        lacking = self.missing()
        makers = {
            "schedule": self._schedule,
            "loader": self._loader,
            "multiplier": self._multiplier,
            "linkage": self._linkage,
            "compensation": self._compensation,
            "surface": self._surface,
        }
        if self.moved:
            makers = {"schedule": self._schedule, "loader": self._answering}
        if self.in_series:
            makers["loader"] = self._series
            del makers["linkage"]
        if self.set_points:
            del makers["loader"], makers["multiplier"]
        wanted = [make for stage, make in makers.items() if stage not in lacking]
        made = in_threads(lambda make: make(), wanted)
        return [out for each in made for out in each if np.isfinite(out.floor) and out.floor > 0.0]

    def _made(
        self,
        stage: str,
        quantity: str,
        predict: Predict,
        noisy: Noisy,
        own: Noise,
        driven_by: str = "",
        between: float = 0.0,
        judged: NDArray[np.bool_] | None = None,
        correlated: Floats | None = None,
    ) -> Output:
        """Return an output whose floor is its own noise and its input's, propagated.

        The prediction of frames that are not `judged` is the measurement. For an output `driven_by`
        a quantity of the control, `hidden_gap` is set. `between` is the rms error of the prediction
        because the inputs between frames are unknown. The part of the residual that is
        proportional to `correlated` does not count as noise.
        """
        name, measured = self.name_of(quantity), self.signal(quantity)
        base = predict(self.rig)
        own = left_noise(own, measured, remove_projection(measured - base, correlated), judged)
        tries = in_threads(lambda k: noisy(self.rig, k) - base, range(TRIES))
        carried = rms_of(np.array(tries))
        known = REPLAY_KNOWN * float(np.ptp(measured))
        floor = math.hypot(own.rms, carried, between, known)
        made = self._output(stage, name, measured, predict, floor)
        if floor <= 0.0:
            return made
        loose = spread(tries, own.rms, own.memory, self.rig.frame_rate)
        made = replace(made, spread=loose, smoothed=carried / floor)
        if not driven_by:
            return made
        noisiest = self.name_of(driven_by) if carried > own.rms else name
        return replace(made, hidden_gap=HiddenGap(floor / float(np.std(measured)), noisiest, name))

    def _output(
        self, stage: str, name: str, measured: Floats, predict: Predict, floor: float
    ) -> Output:
        rate, missed = self.rig.frame_rate, self.missed.seen
        made = Output(stage, name, measured, predict, floor, rate, self.number, missed=missed)
        fine = stage in STEPPED and self.rig.loader_rate > COARSE_STEPS_Hz
        return replace(made, stepped=fine and made.allows_coarse_steps(self.rig))

    def _schedule(self) -> list[Output]:
        pressure, gradient = self.record["dynamic_pressure_Pa"], self.signal("gradient")
        level, ran = noise_in(self.rig, "dynamic_pressure_Pa", pressure), ~self.missed.seen
        own = noise_in(self.rig, self.name_of("gradient"), gradient[ran])
        smooth = smoothed(pressure)
        at = self.as_read("computed") - self.neutral() if self.schedule.curved else None

        def predict(rig: Rig, q: Floats = smooth) -> Floats:
            missed = self.missed.under(rig, self.control)
            made = replay_schedule(rig, self.control, q, missed=missed, computed=at)
            return made * self.feel_left()

        share, rest = share_from_source(gradient[ran], predict(self.rig, pressure)[ran])
        if share > SMALL:
            # G_T contains the noise of the recorded q̄, so the host computed it from that q̄.
            floor = max(rest, ROUNDING_SPAN * float(np.ptp(gradient)))
            as_read, name = partial(predict, q=pressure), self.name_of("gradient")
            return [self._output("schedule", name, gradient, as_read, floor)]

        def noisy(rig: Rig, k: int) -> Floats:
            return predict(rig, with_error(smooth, k, level))

        return [self._made("schedule", "gradient", predict, noisy, own)]

    def _loader(self) -> list[Output]:
        force, feel, computed = self.pulled(), self.feel(), self.signal("computed")
        inputs_of, hosted = self.other_inputs(), hosted_by(self)
        sensor, own = self.driving("computed"), self.channel_noise("computed")
        smooth = smoothed(computed, sensor)
        leaks = [Nodes(smoothed(other)) for other in self.partner()]
        restarted = drifts(self.rig, self.control, float(np.min(feel.gradient)))

        def driven(
            f: Floats, seen: Floats, starts: Mask | None = None, otherwise: bool = False
        ) -> Driven:
            """Return the response to a force plus a multiple of its noise, with restarts.

            `otherwise`: force and services between the frames are interpolated more coarsely.
            """
            starts = own_starts if starts is None else starts
            nodes = Nodes(f, partial(force.on_nodes, otherwise=otherwise))
            misread = computed - seen
            rate = rate_of(seen, self.rig.frame_rate) if starts.any() else seen

            def at(rig: Rig, times: float) -> Floats:
                sensed = self.sensed(rig)
                scale, hum = sensed.scale(len(seen)), sensed.hum(computed)
                still = rate
                if rate is not seen and isinstance(hum, np.ndarray):
                    still = rate - rate_of(hum, self.rig.frame_rate)
                place = sensed.curve.inverse((seen - hum) / scale)
                restart = (starts, place, still / scale)
                pull = sensed.force_on_nodes(nodes.of(rig), f)
                if times:
                    pull = pull + times * trembling.of(rig)
                if leaks and (share := rig.controls[self.control].loader.crosstalk):
                    pull = pull + share * leaks[0].of(rig)
                host = hosted.a_frame_late() if otherwise else hosted
                host = host._replace(missed=self.missed.under(rig, self.control))
                driven_by = (pull, feel, misread + hum, inputs_of(rig), restart, host)
                moved = drive_loader(rig, self.control, *driven_by)[0]
                return scale * sensed.curve.at(moved) + hum

            return at

        def plain(at: Driven) -> Predict:
            return self._judged(lambda rig: at(rig, 0.0), computed)

        def predicted(at: Driven, times: float = 1.0) -> Predict:
            def walked(rig: Rig) -> Floats:
                return without_friction_creep(rig, self.control, at, computed, times)

            return self._judged(walked, computed) if walks else plain(at)

        def noisy(rig: Rig, k: int) -> Floats:
            seen = with_error(smooth, k + TRIES, sensor)
            return predicted(driven(force.with_error(k), seen), 2.0**0.5)(rig)

        force = self._without_answered_noise(force, computed)
        own_starts, moves = self._restarts(), 0.0
        if restarted:
            own_starts, moves = self._restarts_that_show(
                lambda *given: driven(given[0], smooth, *given[1:])(self.rig, 0.0),
                force.smooth,
                own.rms,
            )
        trembling = Nodes(force.passed(np.random.default_rng(47)))
        answer = driven(force.smooth, smooth)
        walks = force.smooth is not force.recorded
        walks = walks and creeps(self.rig, self.control, answer, own.rms)
        otherwise = driven(force.smooth, smooth, otherwise=True)(self.rig, 0.0)
        given = ("force", rms_of(otherwise - answer(self.rig, 0.0)), self.judged)
        whole = self._made("loader", "computed", predicted(answer), noisy, own, *given)
        whole = _between_restarts(whole.under(force.noise), moves)
        if not restarted:
            every = self._restarts(round(PIECE_s * self.rig.frame_rate))
            whole = replace(whole, shots=plain(driven(force.smooth, smooth, every)))
        return [replace(whole, rough=plain(answer)) if walks else whole]

    def _restarts_that_show(
        self, moved: Callable[[Floats, Mask, bool], Floats], force: Floats, noise: float
    ) -> tuple[Mask, float]:
        """Return restarts so far apart that a tenth more force shows beyond the noise.

        The noise includes the error of the force between frames. A slow machine that is restarted
        often follows any record, whatever its damping. The second number is the rms motion that
        the force causes between the restarts, d.
        """
        for every_s in (PIECE_s, 2.0 * PIECE_s, 4.0 * PIECE_s, STRETCH_s):
            starts = self._restarts(round(every_s * self.rig.frame_rate))
            usual = moved(force, starts, False)
            more = rms_of(moved((1.0 + SMALL) * force, starts, False) - usual)
            between = rms_of(moved(force, starts, True) - usual)
            if more > SIGMAS * math.hypot(noise, between):
                break
        return starts, more / SMALL

    def _restarts(self, every: int = 0) -> Mask:
        """Return the frames at which a replay restarts as measured; also every `every` frames."""
        frames = np.arange(len(self.record))
        starts: Mask = (frames == 0) & self.begins_moved
        if self.live is not None:
            starts = starts | self.live.starts
        return starts | (frames % every == 0) if every else starts

    def _judged(self, predict: Predict, measured: Floats) -> Predict:
        """Return a prediction that equals the measurement where the loader is not judged."""
        judged = self.judged
        if judged is None:
            return predict
        return lambda rig: np.where(judged, predict(rig), measured)

    def _without_answered_noise(self, force: Drive, answer: Floats) -> Drive:
        """Return a broadband force with the noise reduced to what its response does not show."""
        if force.noise.rms <= SMALL * float(np.std(force.recorded)):
            return force
        share = share_in_response(force.recorded, answer)
        less = float(np.sqrt(max(1.0 - share, 0.0)))
        level = replace(force.noise, rms=force.noise.rms * less)
        if share > NEARLY_ALL:
            level = given_noise(self.rig, self.name_of("force"), force.recorded)
        return replace(force, noise=level) if share <= MOST else force.unsmoothed(level)

    def _series(self) -> list[Output]:
        """Return the grip's motion under the force, for records without δc."""
        grip = self.signal("deflection")
        force = self._without_answered_noise(self.pulled(), grip)
        own = self.channel_noise("deflection")
        seen, shaken = in_series(self, force, hosted_by(self), own)
        predict = self._judged(seen, grip)

        def noisy(rig: Rig, k: int) -> Floats:
            return self._judged(lambda other: shaken(other, k), grip)(rig)

        given = (predict, noisy, own, "force")
        found = self._made("loader", "deflection", *given, judged=self.judged)
        return [replace(found, in_series=True).under(force.noise)]

    def _answering(self) -> list[Output]:
        """Return the force as the output under an imposed motion."""
        predict, noisy, judged = under_motion(self)
        given = ("loader", "force", predict, noisy, self.driving("force"), self.imposed)
        made = self._made(*given, judged=judged)
        return [replace(made, imposed=self.signal(self.imposed))]

    def _product(self, read: Floats, rig: Rig | None = None) -> Floats:
        """Return F_mod by δc as read, by this rig or another one."""
        rig = self.rig if rig is None else rig
        missed, assumed = self.missed.under(rig, self.control), self.assumed()
        more = None if assumed is None else assumed.gradient
        read = read - self.neutral()
        return replay_product(rig, self.control, read, self.feel(), missed, more)

    @cached_property
    def repeats_product(self) -> bool:
        """Whether F_mod was computed from δc as read: its only noise is that of δc.

        Then the motion of the loader discriminates the multipliers, but not F_mod.
        """
        analog = self.rig.controls[self.control].loader.multiplier != "digital"
        if not analog or self.moved or self.set_points or "multiplier" in self.missing():
            return False
        computed = self.as_read("computed")
        product = self._product(computed)
        repeated = rms_of(product - self._product(smoothed(computed)))
        left = rms_of(self.signal("modifying_force") - product)
        return repeated > 0.0 and left < MINOR * repeated

    def _multiplier(self) -> list[Output]:
        """Return F_mod, predicted by the product of δc itself, or of δc as read.

        A digital product contains the sensor noise and scale error of δc, an analog product does
        not. The part of F_mod that repeats the noise of δc (`correlated`) is therefore not the
        channel's own noise: in the noise floor, it would hide whether the product is digital. There
        is no output if that is all of its noise (`repeats_product`).

        At the breakout the product jumps. Frames in which noise of δc decides the sign of a jump
        are not judged: the prediction there is the measurement. A jump below the noise of F_mod
        counts too, if it exceeds the rise of the gradient: δc as read has the right sign more often
        than δc smoothed, for both kinds of product.
        """
        if self.repeats_product:
            return []
        recorded, computed = self.signal("modifying_force"), self.as_read("computed")
        own, level = self.channel_noise("modifying_force"), self.channel_noise("computed")
        smooth, neutral = smoothed(computed), 0.0 * computed + self.neutral()
        below, above, beyond = (self._product(neutral + k * level.rms) for k in (-1.0, 1.0, 3.0))
        jump, rise = np.abs(above - below), np.abs(beyond - above)
        near = np.abs(smooth - neutral) < FAR_SIGMAS * level.rms
        judged = ~(near & ((jump > FAR_SIGMAS * own.rms) | (jump > 2.0 * rise)))
        if self.judged is not None:
            judged &= self.judged
        if self.live is not None:  # a row without a new sample holds the product of the row before
            judged &= self.live.sampled
        likely = _with_motion(computed, smooth, level)

        def predict(rig: Rig, seen: Floats = likely) -> Floats:
            read = computed
            if rig.controls[self.control].loader.multiplier != "digital":
                sensed = self.sensed(rig)
                still = seen - sensed.hum(computed)
                read = sensed.curve.inverse(still / sensed.scale(len(seen)))
            return np.where(judged, self._product(read, rig), recorded)

        def noisy(rig: Rig, k: int) -> Floats:
            return predict(rig, with_error(likely, k, level))

        correlated = self._product(computed) - self._product(smooth)
        correlated = np.where(judged, correlated, 0.0)
        given = ("modifying_force", predict, noisy, own)
        return [self._made("multiplier", *given, judged=judged, correlated=correlated)]

    def _linkage(self) -> list[Output]:
        computed, measured = self.signal("computed"), self.signal("deflection")
        command, force = self.commanded(), self.pulled()
        others, rng = self.others(), np.random.default_rng(47)
        noise = Nodes(command.passed(rng)), force.passed(rng)

        def driven(c: Floats, f: Floats, otherwise: bool = False) -> Predict:
            nodes = Nodes(c, partial(command.on_nodes, otherwise=otherwise))

            def at(rig: Rig, times: float) -> Floats:
                sensed, moved, pulled = self.sensed(rig), nodes.of(rig), f
                if times:
                    moved, pulled = moved + times * noise[0].of(rig), f + times * noise[1]
                driven_by = sensed.both(moved, pulled, computed)
                shown = drive_linkage(rig, self.control, *driven_by, others)
                return sensed.at_grip(shown, driven_by[1])

            return self._judged(
                lambda rig: without_backlash_creep(rig, self.control, at, measured), measured
            )

        def noisy(rig: Rig, k: int) -> Floats:
            return driven(command.with_error(k), force.with_error(k + TRIES))(rig)

        given, predict = (command.smooth, force.smooth), driven(command.smooth, force.smooth)
        between = rms_of(driven(*given, otherwise=True)(self.rig) - predict(self.rig))
        made = (predict, noisy, self.channel_noise("deflection"), "computed", between)
        linkage = self._made("linkage", "deflection", *made, self.judged)
        # A bend adds to δc; with set points the whole motion is the servo's.
        return [replace(linkage, handed_on=None if self.set_points else computed)]

    def _compensation(self) -> list[Output]:
        """Return δ̂, predicted by the host's equations from δc and F as read.

        The floor is the noise of δc, although the host reads the same noise, because F may be
        stamped slightly late. If the rig's F is late, the record's noise of F may differ from the
        host's.
        """
        computed, recorded = self.as_read("computed"), self.as_read("force")
        others, assumed = self.others(as_read=True), self.assumed()

        def made(rig: Rig, force: Floats) -> Floats:
            missed = self.missed.under(rig, self.control)
            made = replay_compensation(rig, self.control, computed, force, others, missed)
            return made if assumed is None else made + held_over(assumed.estimate * force, missed)

        def predict(rig: Rig) -> Floats:
            return made(rig, self.sensed(rig).as_the_host_had_it(recorded))

        own = max(self.channel_noise("computed").rms, ROUNDING_SPAN * float(np.ptp(computed)))
        rig, carried = self.rig, 0.0
        if rig.controls[self.control].sensing.force_stamp != 0.0:
            level, late = self.driving("force"), self.sensed(rig).as_the_host_had_it
            shaken = late(unsmoothed(recorded, 0, level)), unsmoothed(late(recorded), 0, level)
            carried = math.hypot(*(float(np.std(made(rig, f) - predict(rig))) for f in shaken))
        name, estimate = self.name_of("estimate"), self.signal("estimate")
        floor = math.hypot(own, carried)
        found = self._output("compensation", name, estimate, predict, floor)
        return [replace(found, smoothed=carried / floor) if floor else found]

    def _surface(self) -> list[Output]:
        points = None if self.rig.flight is None else self.surface_points(self.rig, self.control)
        if points is None:
            return []
        surface, estimate = surface_channel(self.control), asked_of(self.record, self.control)
        measured = self.record[surface]
        trim = trim_of(self.rig, self.record, self.control)
        filed = filed_trim(self.rig, self.control)
        held = 0.0 if trim is None else about(trim.position, filed, points)
        pressure = self.record["dynamic_pressure_Pa"]
        shift = trim_shift(self.record, self.control, 1.0 / self.rig.frame_rate)

        def predict(rig: Rig) -> Floats:
            """Return the surface position; a row results from the command in the row before."""
            wanted = replay_surface(rig, self.control, estimate, pressure)
            asked = np.concatenate(([0.0], (wanted + shift)[:-1]))
            return np.interp(held + asked, *points)

        # The host's noise is in δ̂ and moves the surface, so the floor is the sensor's noise.
        left = measured - predict(self.rig)
        own = left_noise(estimate_noise(left), measured, left)
        floor = float(np.hypot(own.rms, KNOWN * np.ptp(measured)))
        return [self._output("surface", surface, measured, predict, floor)]


def _between_restarts(output: Output, moves: float) -> Output:
    """Return an output whose floor is compared with the motion `moves`, rms, between restarts.

    The motion over the whole record is far larger than a short replay predicts. Without restarts
    `moves` is 0.
    """
    if output.hidden_gap is None or moves <= 0.0:
        return output
    return replace(output, hidden_gap=replace(output.hidden_gap, share=output.floor / moves))


def _with_motion(computed: Floats, smooth: Floats, level: Noise) -> Floats:
    """Return the estimate of δc, d: smoothed, plus the motion's share of what the smoother removes.

    It is large for a fast motion with little noise. Without it, an analog product, which contains
    the whole motion, would seem to repeat the noise of δc.
    """
    rest = computed - smooth
    noise = level.sample(len(rest), np.random.default_rng(53))
    alone = noise - Smoother.of(computed).passed(noise)
    power = float(rest @ rest)
    motion = max(0.0, 1.0 - float(alone @ alone) / power) if power > 0.0 else 0.0
    return smooth + motion * rest
