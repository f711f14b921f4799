"""Prepare records for a diagnosis: the drive, the trim, the outputs and the effects to try.

The input of a machine is a force, set points or an imposed motion, as its records show clearly. A
digital servo receives set points. In a record faster than the set points each one is held for
several frames, and they differ by more than one step of a converter; a measured motion repeats
values only by rounding. In a record as fast as the set points their noise decides: a computed
number has none in comparison with the transducer at the grip.

A record may have motion and force of the grip and no δc. If a spring holds the loader, its response
to the force is predicted, with the linkage in series (`stages.inputs`). Without a spring this
prediction would drift, so the motion is taken as imposed and the force as output.

The zero of an encoder is known no better than to one of its counts.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from coupled.errors import InputError
from coupled.flight.loading import INERTIAS
from coupled.gap.chain import AIRFRAME, Part
from coupled.gap.checks import (
    at_rate_of,
    check_against_model,
    check_levers,
    check_moved_by_pilot,
    check_record,
    check_trim,
    check_units,
    clipped,
    density_of,
    motion_alone,
    not_in_trim,
    not_measured,
    other_air,
    trim_in,
    trim_speed,
    trimmed,
    without_dropouts,
)
from coupled.gap.effects.effect import Effect, keys_of
from coupled.gap.effects.library import library_of
from coupled.gap.effects.settings import way_of
from coupled.gap.findings.healthy import Baseline
from coupled.gap.findings.result import EffectResult
from coupled.gap.search.case import Case, Tell, allowing_for_contact
from coupled.gap.signals.live import judged_part, live_of
from coupled.gap.signals.output import Floats, Output, estimate_noise, rounding
from coupled.gap.signals.reading import drifts, in_trim, softest_gradient, worth_recording
from coupled.gap.stages.airframe import Flights, airframe_outputs, unjudged_axes
from coupled.gap.stages.labels import check_labels
from coupled.gap.stages.openloop import not_judged
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.stages.tried import tried_effects, with_terms
from coupled.gap.thresholds import (
    FEW,
    FEW_FRAMES,
    MOST,
    NEGLIGIBLE,
    SHORT_FRAMES,
    SIGMAS,
    TINY,
    STEP_s,
)
from coupled.parallel import in_threads
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.parameters import Flight
from coupled.rig.rig import Rig

ZEROS = {"deflection": "sensing.deflection_zero_{d}", "force": "sensing.force_zero_N"}
_KEPT = 3  # rigs whose noise floors are cached


@dataclass(frozen=True)
class Prepared:
    """Prepared records of one part of a diagnosis.

    `case` holds the rig and the outputs, `library` the effects that can be tried. `trim` and
    `left_out` are sentences for the report: the trim that was taken from the records, and what of
    the records is not judged. `baseline` is the healthy machine, if known. `by_recorder`: rows that
    no sensor has measured may be the cause. `density` is that of the air over the model's.
    """

    part: Part
    case: Case
    library: tuple[Effect, ...]
    readers: tuple[Reader, ...]
    records: Mapping[str, Record]
    trim: str = ""
    left_out: tuple[str, ...] = ()
    baseline: Baseline | None = None
    by_recorder: bool = False
    density: float = 1.0

    @property
    def own_records(self) -> list[Record]:
        """The records as each reader has them."""
        return [reader.record for reader in self.readers]

    def is_otherwise(self, effect: EffectResult) -> bool:
        """Tell whether the recorder or the air is as probable a cause as an effect."""
        if self.by_recorder or self.density == 1.0 or effect.name not in ("mass", *INERTIAS):
            return self.by_recorder
        (p,) = effect.parameters
        ends = (-math.inf if p.low is None else p.low, math.inf if p.high is None else p.high)
        return ends[0] <= 1.0 / self.density <= ends[1]


def finely_stepped(
    trims: Mapping[str, Rig], records: Mapping[str, Record]
) -> tuple[dict[str, Rig], str]:
    """Return the rigs of an aircraft alone with the steps that fit, and a sentence on a change.

    An aircraft moves continuously, and wide steps of its model act like an error of its damping and
    of the time stamps; but a log of a simulation may have a step per row. So steps wider than
    JSBSim's own are compared with finer ones by the residuals without effects, as white noise of
    unknown variance. The steps of a record with the rig in its manifest are known.
    """
    rig = next(iter(trims.values()))
    assert rig.flight is not None
    steps, each = math.ceil(1.0 / (STEP_s * rig.frame_rate) - TINY), records.values()
    flown = [one.manifest.get("rig") and "imported_from" not in one.manifest for one in each]
    if rig.flight.steps_per_frame >= steps or any(flown):
        return dict(trims), ""
    finer = {file: one.changed({"flight.steps_per_frame": steps}) for file, one in trims.items()}

    def missed(rigs: Mapping[str, Rig]) -> float:
        found = 0.0
        for file, record in records.items():
            for output in airframe_outputs(rigs[file], record):
                left = output.floor * output.residual(rigs[file])
                found += len(left) * math.log(max(float(np.mean(left**2)), sys.float_info.min))
        return found

    if missed(trims) <= missed(finer):
        return dict(trims), ""
    return finer, (
        f"The model is flown with {steps} steps a frame, which fit better than the "
        f"{rig.flight.steps_per_frame} of the rig file."
    )


def prepare(
    rig: Rig,
    records: Mapping[str, Record],
    part: Part,
    tell: Tell | None = None,
    baseline: Baseline | None = None,
    flight: Flight | None = None,
    terms: bool = False,
) -> Prepared:
    """Return records prepared for the diagnosis of a part, by their files' names.

    With `terms`, the named functions of the model's aerodynamics are tried (`stages.tried`). With a
    `baseline`, the rig is that of the healthy machine, and its model error raises the noise floors.
    `flight` is the aircraft with what was found in it before. Raises InputError if a record cannot
    be of this rig, or if no stage can be judged.
    """
    if baseline is not None:
        rig = baseline.rig
    if flight is not None:
        rig = rig.changed({"flight": flight})
    control = part.control
    live = [one for one in map(live_of, records.values()) if one is not None]
    records = {file: judged_part(record, file) for file, record in records.items()}
    dropped = list[str]()
    if not rig.controls:
        records, dropped = without_dropouts(motion_alone(records))
        rig = at_rate_of(rig, records)
    each = list(records.values())
    rig = as_driven(rig, each, control) if control in rig.controls else rig
    for file, record in records.items():
        check_units(rig, record, control, file)
    rig = as_counted(rig, each, control) if control in rig.controls else rig
    trims, trim = trimmed(rig, records)
    stepped = ""
    if not rig.controls and baseline is None:
        trims, stepped = finely_stepped(trims, records)
    rig = next(iter(trims.values()))
    for file, record in records.items():
        check_record(trims[file], record, control, file, moved=part.own)
        check_levers(record, file)
        if rig.flight is not None:
            check_trim(trim_speed(trims[file]), record, file)
    if not rig.controls:
        check_moved_by_pilot(rig, records)
    readers = readers_of(trims, records, control)
    judged = Judged(rig, part, readers, baseline)
    outputs = [
        allowing_for_contact(output.halved(rig), rig, control) for output in judged.under(rig)
    ]
    if not outputs:
        raise InputError(next(iter(records)), "", _too_little(rig, control, readers))
    check_against_model(outputs, rig, list(records), each)
    check_labels(outputs, readers, records)
    own = control if part.own else None
    set_points = readers[0].set_points
    motion = dict.fromkeys(one.channel for one in outputs if one.stage == AIRFRAME)
    repeated = [
        words
        for file, one in records.items()
        for words in not_measured(one, own, file, set_points, motion)
    ]
    left_out = [stepped, *dropped, *(why for one in live for why in one.left_out), *repeated]
    left_out += [
        f"{channel(control, 'modifying_force')} of {file} was computed from the recorded "
        f"{channel(control, 'computed')}: it cannot discriminate analog and digital multipliers."
        for file, reader in zip(records, readers, strict=True)
        if part.own and reader.repeats_product
    ]
    for file, record in records.items() if part.own else ():
        left_out += clipped(record, control, file)
    left_out += [] if rig.controls else unjudged_axes(outputs, each)
    densities = dict[str, float]()
    if any(output.stage == AIRFRAME for output in outputs):
        left_out += [not_judged(each), *(not_in_trim(one, file) for file, one in records.items())]
        densities = {file: density_of(trims[file], one) for file, one in records.items()}
        left_out += [other_air(density, file) for file, density in densities.items()]
    library = [one for one in library_of(rig, control) if part.frees(keys_of([one]))]
    if terms and part.airframe:
        library = with_terms(library, rig, records)
    return Prepared(
        part,
        Case(rig, control, outputs, tell, judged.under, baseline is not None, (), way_of(readers)),
        tuple(tried_effects(library, readers, outputs)),
        tuple(readers),
        records,
        trim,
        tuple(dict.fromkeys(words for words in left_out if words)),
        baseline,
        bool(repeated) and baseline is None,
        next((density for density in densities.values() if density != 1.0), 1.0),
    )


def readers_of(
    rigs: Mapping[str, Rig], records: Mapping[str, Record], control: ControlName
) -> list[Reader]:
    """Return the reader of each record, which makes its outputs; `rigs` has each in its trim."""
    first = next(iter(rigs.values()))
    return [
        Reader(rigs[file], record, control, surface_points, number, trim_in(rigs[file], first))
        for number, (file, record) in enumerate(records.items())
    ]


def in_own_trims(outputs: Sequence[Output], readers: Sequence[Reader]) -> list[Output]:
    """Return outputs whose predictions are by a rig in the trim of their record."""
    each = ((output, readers[output.record].trim) for output in outputs)
    return [
        output.predicted_by(partial(in_trim, trim=trim)) if trim else output
        for output, trim in each
    ]


@dataclass(frozen=True)
class Judged:
    """The outputs that can be judged, with noise floors estimated with a given rig.

    Those of the last rigs are cached, and the flights, if neither rigging nor aircraft change.
    """

    rig: Rig
    part: Part
    readers: Sequence[Reader]
    baseline: Baseline | None = None
    _flights: dict[int, Flights] = field(default_factory=dict, repr=False, compare=False)
    _flown: list[Output] = field(default_factory=list, repr=False, compare=False)
    _known: list[tuple[Rig, list[Output]]] = field(default_factory=list, repr=False, compare=False)

    def under(self, rig: Rig) -> list[Output]:
        """Return the outputs with noise floors estimated with a rig."""
        known = next((made for other, made in self._known if other == rig), None)
        if known is None:
            known = self._made(rig)
            self._known[:] = [*self._known[1 - _KEPT :], (rig, known)]
        return known

    def _made(self, rig: Rig) -> list[Output]:
        readers = [reader.under(rig) for reader in self.readers]
        own = readers if self.part.own else []
        makers: list[Callable[[], list[Output]]] = [reader.outputs for reader in own]
        rigging = [[one.rigging for one in each.controls.values()] for each in (self.rig, rig)]
        same = rigging[0] == rigging[1] and self.rig.flight == rig.flight
        alike = bool(self._known) and same
        for one in readers if self.part.airframe and not alike else []:
            flights = self._flights.setdefault(one.number, Flights())
            makers.append(partial(airframe_outputs, one.rig, one.record, one.number, flights))
        each = in_threads(lambda make: make(), makers)
        made = in_own_trims([output for outputs in each for output in outputs], readers)
        if alike:
            made += self._flown
        elif rig == self.rig:
            self._flown[:] = [output for output in made if output.stage == AIRFRAME]
        return made if self.baseline is None else self.baseline.raised(made)


def _too_little(rig: Rig, control: ControlName, readers: Sequence[Reader]) -> str:
    """Return the message that records lack the channels of every stage."""
    lacking = {
        name
        for reader in readers
        for stage, names in reader.missing().items()
        for name in worth_recording(rig, control, stage, names)
    }
    return f"holds too little to judge any stage by; it lacks {', '.join(sorted(lacking))}"


def as_driven(rig: Rig, records: Collection[Record], control: ControlName) -> Rig:
    """Return the rig with its kind of input, if all records show one that the file does not set."""
    name, grip, force = (channel(control, q) for q in ("computed", "deflection", "force"))
    if rig.controls[control].drive != "force":
        return rig
    held = all(name in record and in_set_points(record[name]) for record in records)
    if held or any(_is_computed(record, control) for record in records):
        return rig.changed({f"controls.{control}.drive": "setpoint"})
    alone = all(name not in one and grip in one and force in one for one in records)
    if alone and any(drifts(rig, control, softest_gradient(rig, control, one)) for one in records):
        return rig.changed({f"controls.{control}.drive": "displacement"})
    return rig


def _is_computed(record: Record, control: ControlName) -> bool:
    """Tell whether δc is a computed number, not a measured motion.

    Only for records without other channels of loader or host: a simulation may have no noise.
    """
    others = (channel(control, q) for q in ("gradient", "modifying_force", "estimate"))
    given, grip = channel(control, "computed"), channel(control, "deflection")
    if any(name in record for name in others) or not (given in record and grip in record):
        return False
    return _estimate_quietest_noise(record[given]) < NEGLIGIBLE * estimate_noise(record[grip]).rms


def _estimate_quietest_noise(signal: Floats) -> float:
    """Return the rms noise of the quietest stretches in which a signal moves; infinite if none.

    Fourth differences have 70 times the variance of white noise. The motion adds almost nothing to
    them in the quietest short stretches, but a chirp does over all frames. Motion slower than two
    converter steps a frame is left out, since its values repeat by rounding.
    """
    steps = np.abs(np.diff(signal))
    if not np.any(steps) or len(steps) < FEW_FRAMES + 4:
        return math.inf
    least = float(np.diff(np.unique(signal)).min())
    slowest = sliding_window_view(steps, FEW_FRAMES + 3).min(axis=1)
    rough = sliding_window_view(np.diff(signal, 4), FEW_FRAMES)
    noise = np.sqrt(np.mean(rough[slowest > 1.5 * least] ** 2, axis=1) / 70.0)
    return float(np.quantile(noise, 0.1)) if noise.size else math.inf


def in_set_points(signal: Floats) -> bool:
    """Tell whether a signal comes in set points, each held over two frames or more.

    Changes in consecutive frames show a motion; pauses longer than `SHORT_FRAMES` are ignored.
    """
    changes = np.flatnonzero(np.diff(signal))
    if len(changes) < SHORT_FRAMES:
        return False
    apart = np.diff(changes)
    moving = apart[apart <= SHORT_FRAMES]
    sizes = np.abs(np.diff(signal)[changes])
    uneven = float(np.median(sizes)) > SIGMAS * float(sizes.min())
    return uneven and len(moving) > 0 and float(np.mean(moving >= 2)) >= (1.0 - FEW)


def as_counted(rig: Rig, records: Collection[Record], control: ControlName) -> Rig:
    """Return the rig with zeros that may be off by a count of their channels, where these count.

    They count if the rounding is half of the noise or more. Tolerances of the file stay.
    """
    known = rig.controls[control].tolerance
    found = dict(known)
    for quantity, zero in ZEROS.items():
        name, key = channel(control, quantity), zero.format(d=unit_of(control))
        most = max((_count(one, name) for one in records if name in one), default=0.0)
        if key not in known and most > 0.0:
            found[key] = most
    return rig if found == known else rig.changed({f"controls.{control}.tolerance": found})


def _count(record: Record, name: str) -> float:
    """Return the size of a channel's count in its unit, 0 where that is little of its noise."""
    signal = record[name]
    error = rounding(signal, math.inf)
    return error * math.sqrt(12.0) if error > MOST * estimate_noise(signal).rms else 0.0
