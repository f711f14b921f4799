"""Which effects records let be tried, and in which outputs each shows there.

The library says in which stages an effect shows. What a record holds changes that:

    loader and linkage in series   the linkage's effects show in the loader's output
    imposed motion                 they show in the force; the motion of the grip is given
    set points                     a commanded number has no sensor, and the servo has reached the
                                   speed that the grip was measured at
    a wheel, or no length of arm   the grip's arc has no radius
    no lateral motion              effects that show in it are not tried; nor are those of parts
                                   that the aircraft's model lacks

If asked for, the named functions of the model's aerodynamics are tried. A function is freed if its
share of its axis in a record is at least `NEGLIGIBLE`. The shares are those of the filed model,
flown with the record's surfaces. The functions replace the effects of the library that scale the
aerodynamics, since each such effect is a part of some functions.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np
from scipy.linalg import eigh

from coupled.errors import InputError
from coupled.flight.airframe import main_file
from coupled.flight.altered import ALTERATIONS, parts_of
from coupled.flight.modelparts import Thrust
from coupled.flight.modeltext import functions_of
from coupled.gap.effects.airframe import term
from coupled.gap.effects.effect import BY_REGRESSOR, Effect, Parameter, dotted, keys_of
from coupled.gap.effects.settings import Scales, in_scale
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.output import Floats, Output, white
from coupled.gap.stages.airframe import RATE, needs
from coupled.gap.stages.openloop import fly_open_loop
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import flown_by, moved
from coupled.gap.thresholds import (
    MISMATCH,
    MORE,
    NEGLIGIBLE,
    PLAYS,
    REACHED_OVER,
    REPLAY_KNOWN,
    SIGMAS,
    SMALL,
)
from coupled.record.channels import LATERAL, ControlName, channel, motions_in, unit_of
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.rig import Rig
from coupled.surveying.terms import shares

OF_PLAY = "loader.play"  # its key in a rig file without the unit, and that of its contact
CONTACT = "loader.play_stiffness_N_per_{d}"
ARC = "loader.arc_geometry"
GRAVITY = "loader.gravity_N"
PARTS = {alteration.part.name for alteration in ALTERATIONS}
_AERODYNAMIC = {f"flight.{a.part.name}" for a in ALTERATIONS if not isinstance(a.part, Thrust)}
RATE_LIMIT = "loader.servo_rate_limit_{d}_per_s"
TERMS_OPTION = "--terms"


def tried_effects(
    library: Sequence[Effect], readers: Sequence[Reader], outputs: Sequence[Output]
) -> list[Effect]:
    """Return the effects that records let be tried, with the outputs in which they show."""
    records = [reader.record for reader in readers]
    rig, control = readers[0].rig, readers[0].control
    scales, excluded = Scales.of(readers), lacking_keys(rig)
    if not has_arc(rig, control):
        excluded.add(ARC)
    if not _turns_far(readers):
        excluded.add(GRAVITY)
    if scales is None or scales.regressor == 0.0:  # none, or as constant as an offset
        excluded.update(BY_REGRESSOR)
    known = [one for one in library if one.can_be_tried(records, control)]
    known = [one for one in known if excluded.isdisjoint(keys_of([one]))]
    if rig.flight is not None:
        still = {name for name in LATERAL if not any(_moves(name, record) for record in records)}
        known = [one for one in known if one.stage != "airframe" or still.isdisjoint(one.needs)]
    if not (readers[0].moved and readers[0].imposed == "computed"):
        known = [one for one in known if [p.key for p in one.parameters] != [CONTACT]]
    known = in_scale(as_judged(known, readers, outputs), scales, rig, control)
    if readers[0].set_points:
        known = _under_set_points(known, records, control)
    judged = {output.stage for output in outputs}
    return [effect for effect in known if judged & {*effect.shows_in}]


def has_arc(rig: Rig, control: ControlName) -> bool:
    """Tell whether a rig file gives the radius on which its grip may move."""
    data = rig.controls.get(control)
    return data is not None and unit_of(control) == "m" and data.length > 2.0 * data.travel / np.pi


def _turns_far(readers: Sequence[Reader]) -> bool:
    """Tell whether a motion turns far enough to distinguish gravity from a spring with an offset.

    For every angle of the link, the part of sin(δc + angle) that no straight line in δc represents
    must exceed the model error of a right effect, as a share of its motion.
    """
    if unit_of(readers[0].control) != "rad":
        return False
    for reader in readers:
        moved = motions_in(reader.record, reader.control)
        if not moved:
            continue
        way = smoothed(reader.record[moved[0]])
        waves = np.column_stack((np.sin(way), np.cos(way)))
        waves -= waves.mean(axis=0)
        line = (way - way.mean()) / np.linalg.norm(way - way.mean())
        curved = waves - np.outer(line, line @ waves)
        least = eigh(curved.T @ curved, waves.T @ waves, eigvals_only=True)[0]
        if least > MISMATCH**2:
            return True
    return False


def lacking_keys(rig: Rig) -> set[str]:
    """Return the keys of the factors on parts that a rig's model lacks."""
    if rig.flight is None:
        return set()
    parts = parts_of(main_file(rig.flight, [aircraft_folder()], rig.place))
    return {f"flight.{key}" for key in PARTS - parts}


def _moves(name: str, record: Record) -> bool:
    """Tell whether a channel shows more than noise."""
    return name in record and float(np.std(record[name])) > MORE * white(record[name])


def as_judged(
    effects: Sequence[Effect], readers: Sequence[Reader], outputs: Sequence[Output]
) -> list[Effect]:
    """Return effects with the outputs in which they show in these records.

    Effects that show in none of them are left out.
    """
    if any(output.in_series for output in outputs):
        return _in_series(effects, any(output.stage == "linkage" for output in outputs))
    if readers[0].moved:
        return _under_motion(effects, readers[0].imposed)
    return list(effects)


def _in_series(effects: Sequence[Effect], separate: bool) -> list[Effect]:
    """Return effects for loader and linkage in series; the linkage's show in the loader's output.

    `separate` where other records have δc, and judge the linkage alone as well. Effects of the
    sensor of δc are left out where none has it.
    """

    def shown(effect: Effect) -> Effect:
        if "linkage" not in effect.shows_in:
            return effect
        others = [name for name in effect.shows_in if name != "linkage" or separate]
        return replace(effect, outputs=tuple(dict.fromkeys((*others, "loader"))))

    return [shown(effect) for effect in effects if separate or not effect.of_sensor]


def _under_motion(library: Sequence[Effect], imposed: str) -> list[Effect]:
    """Return a library for imposed motions: the linkage's effects show in the force.

    Only play and its contact do where δc is `imposed`, and none that is a limit of the servo: the
    motion of the grip is given, whatever the servo can do.
    """
    found = []
    for effect in library:
        keys = [p.key for p in effect.parameters]
        plays = [p for p in effect.parameters if p.key.rpartition("_")[0] == OF_PLAY]
        if effect.stage != "linkage":
            sensed = imposed == "deflection" and "linkage" in effect.shows_in
            found.append(replace(effect, outputs=("loader",)) if sensed else effect)
        elif plays:
            found.append(replace(effect, outputs=("loader",), seen=partial(_plays, effect)))
        elif keys == [CONTACT] or (
            imposed == "deflection" and not any("servo" in k and "limit" in k for k in keys)
        ):
            found.append(replace(effect, outputs=("loader",)))
    return found


def _plays(
    effect: Effect, outputs: Sequence[Output], rig: Rig, control: ControlName
) -> list[dict[str, float]]:
    """Return the backlashes with the least residual of the force, where a fit starts, by scans.

    With each stiffness from which a contact starts, if the effect has one. The cost has local
    minima, since the jumps of a backlash move from sample to sample. The force is scanned as the
    rig predicts it, and with a free factor and offset: by an unknown damping it may be far off.
    """
    number, *contact = effect.free
    ours = [output for output in outputs if output.stage == "loader"]
    key = dotted(number.key_on(control), control)
    filed, travel = rig.controls[control].loader.play, rig.controls[control].travel

    @cache
    def left(play: float) -> tuple[float, float]:
        other = rig.changed({key: number.entered(filed, play)})
        each = [(one.measured / one.floor, one.residual(other, coarse=True)) for one in ours]
        as_filed = sum(float(np.sum(misfit**2)) for _, misfit in each)
        scaled = sum(_beside_factor(seen, seen - misfit) for seen, misfit in each)
        return as_filed, scaled

    found = []
    for i in range(2):
        rough = np.geomspace(REPLAY_KNOWN * travel, travel, PLAYS).tolist()
        best = min(rough, key=lambda play: left(play)[i])
        fine = (best * np.linspace(0.75, 1.3, PLAYS)).tolist()
        found.append(min(fine, key=lambda play: left(play)[i]))
    alike = abs(found[1] - found[0]) < SMALL * found[0]
    plays = [{number.name: play} for play in found[: 1 if alike else 2]]
    return [
        play | {one.name: stiffness for one, stiffness in zip(contact, each, strict=True)}
        for play in plays
        for each in product(*(one.starts for one in contact))
    ]


def _beside_factor(seen: Floats, predicted: Floats) -> float:
    """Return the sum of squares that any positive factor and offset of a prediction leave."""
    about, moves = seen - seen.mean(), predicted - predicted.mean()
    power, shared = float(moves @ moves), float(moves @ about)
    return float(about @ about) - (shared**2 / power if min(power, shared) > 0.0 else 0.0)


def _under_set_points(
    library: Sequence[Effect], records: Collection[Record], control: ControlName
) -> list[Effect]:
    """Return a library for set points, with the limit of the servo's rate above what it reached."""
    grip = channel(control, "deflection")
    seen = [_reached(record[grip], record) for record in records if grip in record]
    reached = max(seen, default=0.0)

    def left(parameter: Parameter) -> Parameter:
        lowest = reached if parameter.key == RATE_LIMIT else 0.0
        return replace(parameter, low=max(parameter.low, min(lowest, 0.5 * parameter.high)))

    return [
        replace(effect, parameters=tuple(map(left, effect.parameters)))
        for effect in library
        if not effect.of_sensor
    ]


def _reached(grip: Floats, record: Record) -> float:
    """Return the speed, d/s, that the grip surely reached over a few frames, without a bend."""
    rate_Hz = (len(grip) - 1) / float(record.time_s[-1] - record.time_s[0])
    noise = 2.0 * SIGMAS * white(grip)  # of the two ends of a way
    over = [n for n in REACHED_OVER if n < len(grip)]
    way = [float(np.max(np.abs(grip[n:] - grip[:-n]))) - noise for n in over]
    return max([rate_Hz * w / n for n, w in zip(over, way, strict=True)], default=0.0)


def with_terms(library: Sequence[Effect], rig: Rig, records: Mapping[str, Record]) -> list[Effect]:
    """Return a library with the model's functions in place of effects of the aerodynamics.

    Raises InputError without named functions, or without channels that the airframe needs.
    """
    assert rig.flight is not None
    if not _axes_of(rig):
        problem = f"{rig.flight.model} has no named aerodynamic functions; leave it out"
        raise InputError(rig.place, TERMS_OPTION, problem)
    for file, record in records.items():
        lacking = [name for name in needs(rig, record) if name not in record]
        if lacking:
            problem = f"the record lacks {', '.join(lacking)}, which the airframe needs"
            raise InputError(file, TERMS_OPTION, problem)
    kept = [one for one in library if not _AERODYNAMIC & keys_of([one])]
    return [*kept, *functions_tried(rig, list(records.values()))]


def functions_tried(rig: Rig, records: Collection[Record]) -> list[Effect]:
    """Return factors on the functions of the model's aerodynamics that records show."""
    axes = _axes_of(rig)
    shown = [one for one in records if all(name in one for name in needs(rig, one))]
    large = {name for one in shown for name in large_terms(rig, one, axes)} if axes else set[str]()
    return [term(name, axis) for name, axis in axes.items() if name in large]


def _axes_of(rig: Rig) -> dict[str, str]:
    """Return the axis of each named function of a rig's model; empty without an aircraft."""
    if rig.flight is None:
        return {}
    return functions_of(main_file(rig.flight, [aircraft_folder()], rig.place))


def untried_terms(library: Sequence[Effect], rig: Rig) -> str:
    """Return a sentence on the model's functions, if it has some and a library lacks them."""
    if any(effect.of for effect in library) or not _axes_of(rig):
        return ""
    return f"Not tried: factors on several of the model's own functions at once ({TERMS_OPTION})."


def large_terms(rig: Rig, record: Record, axes: Mapping[str, str]) -> set[str]:
    """Return the functions whose share of their axis in a record is at least `NEGLIGIBLE`."""
    assert rig.flight is not None
    surfaces, _ = moved(rig, record, {}, np.random.default_rng(43))
    given = (rig.flight, rig.frame_rate, flown_by(rig), surfaces, (RATE, *axes), record)
    flown = fly_open_loop(*given)
    values = dict(zip(axes, flown.motion[:, 1:].T, strict=True))
    return {one.term for one in shares(axes, values) if (one.share or 0.0) >= NEGLIGIBLE}
