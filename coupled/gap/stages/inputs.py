"""Other inputs: imposed motion, loader and linkage in series, and noise that creeps.

Residual noise of an input makes backlash and friction creep. A backlash keeps the extremes of its
input. While friction holds the loader still, the smoothed δc still contains noise; each maximum of
it moves the grip's side of the backlash. A fit then finds the backlash too large, by 1 % of 0.8 mm
at 20 μm of noise. Friction with presliding creeps likewise: each noise peak of F makes the contact
slip a little. Where the force rests completely it is held constant (`smooth`).

The creep grows with the noise. The stage is replayed with as much noise again, in both signs, so
that linear contributions cancel, and the change is extrapolated to zero noise (SIMEX: Cook and
Stefanski, JASA 89, 1994). The correction is not applied if the record does not show the creep.

With imposed motion, as on a damper test bench, the force is the output. The motion is that of the
grip if recorded, else δc. The measured force is compared with the loader's reaction
(`rig.imposed`). Structure (which bends under the measured force), servo and backlash lie between
grip and loader. The grip takes up a rigid backlash on the side of the force,
δ = x + sgn(F)·play/2 + bend(F). Within the backlash the force is zero and δ is arbitrary.

A record of F and δ without δc has loader and linkage in series:

    F → loader → δc → servo, play → + bend(F) → δ

The predicted reading of the transducer at the grip is compared with the record. All effects of
loader and linkage show in this one output. A static record gives one number only, the slope

    dδ/dF = 1/(G_B + ΔG) + K

so a bend, a gradient and a force scale are not separable. The loader's mass and damping make them
separable if the force excites both.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.settings import CONTACT, is_dry, most_yielding
from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import Smoother, rate_of, smoothed, unjudged
from coupled.gap.signals.floors import Drive
from coupled.gap.signals.output import Floats, Predict
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import CREEP_FRICTION_N, CREEP_WORSE, LESSER, SIGMAS, TRIES
from coupled.parallel import in_threads
from coupled.record.channels import ControlName, unit_of
from coupled.rig.hosted import Hosted
from coupled.rig.imposed import NEIGHBOURS, answer_to, behind_linkage
from coupled.rig.nodes import Nodes
from coupled.rig.recorder import stamped
from coupled.rig.replay import Restart, drive_series
from coupled.rig.rig import Rig

RATCHET = 1.0 / (2.0**0.5 - 1.0)  # noise of √2 times the size causes √2 times the creep
Driven = Callable[[Rig, float], Floats]  # response of a rig with a multiple of a noise sample
Noisy = Callable[[Rig, int], Floats]  # prediction by a rig with a numbered error of its input


def without_backlash_creep(rig: Rig, control: ControlName, at: Driven, measured: Floats) -> Floats:
    """Return a linkage's response without noise-induced creep of its backlash.

    `at` gives the response with a multiple of a sample of input noise added; shapes (frames,).
    """
    loader = rig.controls[control].loader
    may_creep = loader.play != 0.0 or loader.bend_hysteresis_share != 0.0
    return _without_creep(rig, at, measured) if may_creep else at(rig, 0.0)


def without_friction_creep(
    rig: Rig, control: ControlName, at: Driven, measured: Floats, times: float = 1.0
) -> Floats:
    """Return a loader's response without creep of presliding friction by `times` its noise."""
    may_creep = rig.controls[control].loader.friction_stiffness != 0.0 and is_dry(rig, control)
    return _without_creep(rig, at, measured, times) if may_creep else at(rig, 0.0)


def creeps(rig: Rig, control: ControlName, at: Driven, noise: float) -> bool:
    """Tell whether noise of the force makes presliding friction creep by more than it vibrates.

    With the filed friction, or a little if none is filed, and a usual presliding length. `noise`
    is that of δc, rms in d.
    """
    loader = rig.controls[control].loader
    level = max(loader.friction, loader.breakaway) or CREEP_FRICTION_N
    length = LESSER * most_yielding(control)
    changes = {} if is_dry(rig, control) else {f"controls.{control}.loader.friction_N": level}
    key = f"controls.{control}.{CONTACT[0]}".format(d=unit_of(control))
    yields = rig.changed({**changes, key: level / length})
    plain, up, down = in_threads(partial(at, yields), (0.0, 1.0, -1.0))
    shaken = np.sqrt(np.mean((0.5 * (up - down)) ** 2) + noise**2)
    walked = np.sqrt(np.mean((plain - 0.5 * (up + down)) ** 2))
    return bool(walked > LESSER * shaken)


def _without_creep(rig: Rig, at: Driven, measured: Floats, times: float = 1.0) -> Floats:
    """Return a response without creep, from two responses with `times` the noise in addition.

    The predicted creep is removed unless this increases the mean square residual, and in part
    between the two shares of `CREEP_WORSE`: the residual does not show a creep that a fitted
    backlash absorbs.
    """
    plain, up, down = in_threads(partial(at, rig), (0.0, times, -times))
    push = RATCHET * (plain - 0.5 * (up + down))
    before, after = (float(np.mean((measured - one) ** 2)) for one in (plain, plain + push))
    some, much = CREEP_WORSE
    worse = after / before - 1.0 if before > 0.0 else 0.0
    return plain + min(max((much - worse) / (much - some), 0.0), 1.0) * push


def under_motion(reading: Reading) -> tuple[Predict, Noisy, NDArray[np.bool_]]:
    """Return the prediction of the force as read, N, under an imposed motion.

    And that with a numbered sample of the error of the smoothed motion, and the judged frames. A
    smoother bends a motion that does not rest at an end of the record: within its memory of both,
    where the inertia would be wrong, the prediction is the measurement.
    """
    control, inputs, others = reading.control, reading.other_inputs(), reading.others()
    feel, measured, held = reading.feel(), reading.signal("force"), reading.pulled().smooth
    given, level = reading.signal(reading.imposed), reading.driving(reading.imposed)
    motion, moved = Smoother.imposed(given, level)
    # The force bends the structure, by which the loader moves: its noise accelerates the loader.
    force, pulled_by = Smoother.imposed(measured, reading.driving("force"))
    spoiled = unjudged(Smoother.of_imposed(given, level).gain, len(given)) + NEIGHBOURS
    frames = np.arange(len(given))
    ends = np.minimum(frames, frames[::-1]) < spoiled

    def moved_by(motion: Floats, pulled: Floats) -> Predict:
        """Return the prediction for a motion as read, d, and F, N, which bends the structure."""
        imposed = Nodes(motion)

        def at_loader(rig: Rig) -> Floats:
            read_as = reading.sensed(rig)
            if reading.imposed == "deflection":
                bending = read_as.force(pulled)
                grip = read_as.from_grip(motion, bending)
                return behind_linkage(rig, control, grip, bending, others)
            nodes = imposed.of(rig)
            scaled = nodes / read_as.scale(len(nodes), rig.substeps)
            return read_as.curve.inverse(np.asarray(scaled))

        def predicted(rig: Rig) -> Floats:
            data = rig.controls[control]
            answer = answer_to(rig, control, at_loader(rig), feel, inputs(rig))
            late_s = data.sensing.force_stamp - data.loader.delay

            def read(force: Floats) -> Floats:
                shown = data.sensing.force_curve.at(force)
                gauged = data.sensing.force_scale * shown + data.sensing.force_zero
                return stamped(gauged, late_s * rig.frame_rate)

            made = np.where(ends, measured, read(answer.force))
            if (answer.most > answer.least).any():
                made = _within_rests(made, held, read(answer.least), read(answer.most))
            return _within_jumps(made, measured, answer.jumps) if answer.jumps.any() else made

        return predicted

    def noisy(rig: Rig, k: int) -> Floats:
        return moved_by(moved(k), pulled_by(k + TRIES))(rig)

    return moved_by(motion, force), noisy, ~ends


def _within_rests(predicted: Floats, measured: Floats, least: Floats, most: Floats) -> Floats:
    """Return a prediction that at rest is the force measured, as far as friction can hold it."""
    held = np.clip(measured, np.minimum(least, most), np.maximum(least, most))
    return np.where(most != least, held, predicted)


def _within_jumps(predicted: Floats, measured: Floats, jumps: NDArray[np.bool_]) -> Floats:
    """Return a prediction with a small weight where the force jumps within a frame.

    A backlash that closes within it gives a sample between the forces before and after. A share
    `LESSER` of the difference still guides a fit.
    """
    around = np.stack((np.roll(predicted, 1), np.roll(predicted, -1)))
    held = np.clip(measured, around.min(axis=0), around.max(axis=0))
    return np.where(jumps, held + LESSER * (predicted - held), predicted)


def in_series(reading: Reading, force: Drive, hosted: Hosted, own: Noise) -> tuple[Predict, Noisy]:
    """Return the prediction of δ as read, d, under a force; `own` is the noise of δ.

    And that with a numbered sample of the error of the smoothed force.
    """
    control, inputs, others = reading.control, reading.other_inputs(), reading.others()
    feel, measured = reading.feel(), reading.signal("deflection")
    smooth_grip = smoothed(measured)
    leaks = [Nodes(smoothed(other)) for other in reading.partner()]
    trembling = force.passed(np.random.default_rng(47))
    trembling_nodes = Nodes(trembling)

    def begun(rig: Rig, bending: Floats) -> Restart | None:
        """Return the measured start of the loader, if the record does not begin at rest.

        A grip moved by a bench begins anywhere within the play, so its start is not known.
        """
        if not reading.begins_moved or reading.by_hand:
            return None
        bend = rig.controls[control].loader.bend
        place = reading.sensed(rig).from_grip(smooth_grip, bending) - bend * bending
        return np.arange(len(place)) == 0, place, rate_of(place, rig.frame_rate)

    def driven(pulled: Floats) -> Driven:
        """Return the response to a force, N at the frames, plus a multiple of its noise."""
        nodes = Nodes(pulled, force.on_nodes)

        def at(rig: Rig, times: float) -> Floats:
            sensed = reading.sensed(rig)
            pull, bending = sensed.force_on_nodes(nodes.of(rig), pulled), sensed.force(pulled)
            if times:
                pull = pull + times * trembling_nodes.of(rig)
                bending = bending + times * trembling
            if leaks and (share := rig.controls[control].loader.crosstalk):
                pull = pull + share * leaks[0].of(rig)
            host = hosted._replace(missed=reading.missed.under(rig, control))
            driven_by = (pull, feel, bending, inputs(rig), host, others, begun(rig, bending))
            return sensed.at_grip(drive_series(rig, control, *driven_by), bending)

        def taken_up(rig: Rig, times: float) -> Floats:
            loader = rig.controls[control].loader
            if loader.play == 0.0 or loader.play_stiffness > 0.0:
                return at(rig, times)
            key = f"controls.{control}.loader.play_{unit_of(control)}"
            held, half = at(rig.changed({key: 0.0}), times), 0.5 * loader.play
            true = reading.sensed(rig).force(pulled)
            free = np.clip(measured, held - half, held + half)
            acts = np.abs(true) > SIGMAS * force.noise.rms
            return np.where(acts, held + half * np.sign(true), free)

        return taken_up if reading.by_hand else at

    def predicted(at: Driven, rig: Rig, times: float = 1.0) -> Floats:
        loader = rig.controls[control].loader
        if (loader.play > 0.0 and not reading.by_hand) or loader.bend_hysteresis_share:
            return without_backlash_creep(rig, control, at, measured)
        if walks:
            return without_friction_creep(rig, control, at, measured, times)
        return at(rig, 0.0)

    def noisy(rig: Rig, k: int) -> Floats:
        return predicted(driven(force.with_error(k)), rig, 2.0**0.5)

    answer = driven(force.smooth)
    walks = force.smooth is not force.recorded
    walks = walks and creeps(reading.rig, control, answer, own.rms)
    return partial(predicted, answer), noisy
