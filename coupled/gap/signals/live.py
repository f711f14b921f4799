"""The parts of a live record that can be judged: by validity, the loader's clock and switches.

A host continues if a sample of the loader does not arrive, so a row may repeat an older sample.
Samples are taken at times of the loader's own clock, so the measured signals are resampled to equal
steps of that clock. Short gaps are interpolated; rows in long gaps, with faded forces, or with
other hardware than at the start are left out. After a gap a replay restarts from the measured
state. In any record, a row that repeats all readings of the controls, whose noise cannot repeat by
chance, is a filled dropout and no new sample.

K̂ and the corrections may change in flight, by a switch or by adaptation in service. The manifest
lists the changes (`live.switched`, `live.adapted`), and the host's equations are replayed with the
values in use at each row.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from coupled.errors import InputError
from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import (
    MINOR,
    MOST,
    NEGLIGIBLE,
    PARTLY,
    TINY,
    BRIDGED_s,
    BRIEF_s,
    LEAD_s,
    SETTLE_s,
    SHORTEST_RECORD_s,
    STRETCH_s,
    WINDOW_s,
)
from coupled.record.channels import (
    CONTROL_NAMES,
    FADED,
    FRESH,
    LOADER_TIME,
    LOST,
    REPEATED,
    SWITCHED,
    TIME,
    VALIDITY,
    channel,
    unit_of,
)
from coupled.record.importing.plausible import chance_of_repeats
from coupled.record.record import Record

Mask = NDArray[np.bool_]
HARDWARE = ("bend", "friction", "breakout")  # switches of a simulated loader
HOSTED = ("assumed_bend", "deflection", "gradient")  # switches of the host's compensation
MEASURED = ("force", "computed", "deflection")


@dataclass(frozen=True)
class Assumed:
    """The difference of the K̂ in use from the first K̂ of the flight, d/N, shape (frames,).

    `estimate` is that of δ̂, `gradient` that of ΔG; K̂ = 0 if a correction is off.
    """

    estimate: Floats
    gradient: Floats


@dataclass(frozen=True)
class Live:
    """The parts of a live record that can be judged; masks have shape (frames,).

    judged    rows in which stages of the loader are judged
    starts    rows at which their replays restart from the measured state
    sampled   rows with a new sample of the loader
    quiet     the longest stretch of samples, from which noise is estimated
    signals   the channels measured by the loader, at equal steps of its clock
    assumed   K̂ in use, by control; only for controls whose K̂ changed
    left_out  what is not judged, or judged with changes, and why; a sentence each
    """

    judged: Mask
    starts: Mask
    sampled: Mask
    quiet: slice
    signals: Mapping[str, Floats] = field(default_factory=dict)
    assumed: Mapping[str, Assumed] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def live_of(record: Record) -> Live | None:
    """Return the parts of a record that can be judged; None if it is not live and lacks no sample.

    Raises InputError if the manifest is damaged.
    """
    live = record.manifest.get("live")
    live = live if isinstance(live, Mapping) else {}
    frame_s = float(np.median(np.diff(record.time_s)))
    known, other, assumed = _settings(record, live, frame_s)
    validity = _validity(record, live)
    if validity is None:
        if not known:
            return None
        validity = np.zeros(len(record))
    sampled = (validity != REPEATED) & (validity != LOST)
    bridged = _short_runs(~sampled, max(1, round(BRIDGED_s / frame_s)))
    clock = _Clock(record, sampled, frame_s)
    if not known:  # a switch of unknown kind
        other |= validity == SWITCHED
    received = sampled | bridged
    judged, starts = _stretches(received & (validity != FADED) & ~other, clock.jumps, frame_s)
    present = [channel(control, q) for control in CONTROL_NAMES for q in MEASURED]
    signals = {
        name: clock.resampled(record[name], sampled, received) for name in present if name in record
    }
    quiet = max(
        _runs(received, clock.jumps), key=lambda run: run.stop - run.start, default=slice(0)
    )
    words = _words(frame_s, sampled, bridged, validity, other, clock, assumed)
    return Live(judged, starts, sampled, quiet, signals, assumed, tuple(words))


def judged_part(record: Record, file: object) -> Record:
    """Return a record up to the last row in which its loader can be judged.

    Raises InputError if too little can be judged.
    """
    live = live_of(record)
    if live is None or live.judged.all():
        return record
    frame_s = float(np.median(np.diff(record.time_s)))
    rows = np.flatnonzero(live.judged)
    whole = 0 if not rows.size else int(rows[-1]) + 1
    if frame_s * len(rows) < STRETCH_s or frame_s * whole < SHORTEST_RECORD_s:
        problem = (
            f"holds {frame_s * len(rows):.1f} s in which the loader can be judged, the last at"
            f" {frame_s * whole:.1f} s; {STRETCH_s:g} s are needed, and {SHORTEST_RECORD_s:g} s of"
            " record"
        )
        words = " ".join((f"{problem}.", *live.left_out)).removesuffix(".")
        raise InputError(file, VALIDITY, words)
    return record.rows(0, whole)


def _validity(record: Record, live: Mapping[str, Any]) -> Floats | None:
    """Return each row's validity, else by the spells without an answer, else by repeated rows."""
    if VALIDITY in record:
        return record[VALIDITY]
    spells = live.get("spells") or []
    if not spells:
        present = [channel(control, q) for control in CONTROL_NAMES for q in MEASURED]
        repeated = _repeated(record, present)
        return np.where(repeated, float(REPEATED), FRESH) if repeated.any() else None
    found = np.zeros(len(record))
    for spell in spells:
        try:
            begun, ended = spell
            later = np.inf if ended is None else float(ended)
            found[(record.time_s >= float(begun)) & (record.time_s < later)] = LOST
        except (TypeError, ValueError):
            raise _damaged("spells") from None
    return found


def measured_stretches(record: Record) -> list[Record]:
    """Return the stretches of a flight's record between rows that repeat all of its channels.

    Of repeated rows, a few milliseconds are left in.
    """
    frame_s = float(np.median(np.diff(record.time_s)))
    repeated = _repeated(record, [name for name in record.channels if name != TIME])
    lost = repeated & ~_short_runs(repeated, max(1, round(BRIDGED_s / frame_s)))
    return [record.rows(run.start, run.stop) for run in _runs(~lost)]


def _repeated(record: Record, names: Iterable[str]) -> Mask:
    """Return the rows that repeat all readings of the row before, as a filled dropout does.

    None if the noise of the readings may repeat by chance, or if the log is slower than its rows.
    """
    readings = [record[name] for name in names if name in record]
    found = np.zeros(len(record), dtype=bool)
    if readings:
        found[1:] = np.all(np.diff(readings) == 0.0, axis=0)
    if found.any():
        by_chance = len(record) * math.prod(map(chance_of_repeats, readings))
        found &= by_chance < MINOR and float(np.mean(found)) < PARTLY
    return found


def _damaged(key: str) -> InputError:
    problem = "is not as coupled live writes it; leave the manifest as it was written"
    return InputError("the record's manifest", f"live.{key}", problem)


def _runs(mask: Mask, cuts: Mask | None = None) -> list[slice]:
    """Return the stretches of a mask, divided at `cuts`."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    found = []
    for first, last in edges.reshape(-1, 2):
        inside = [] if cuts is None else first + 1 + np.flatnonzero(cuts[first + 1 : last])
        found += [slice(a, b) for a, b in pairwise((int(first), *map(int, inside), int(last)))]
    return found


def _short_runs(mask: Mask, most: int) -> Mask:
    """Return a mask's inner stretches of at most so many rows."""
    found = np.zeros(len(mask), dtype=bool)
    for run in _runs(mask):
        inner = run.start > 0 and run.stop < len(mask)
        found[run] = inner and run.stop - run.start <= most
    return found


def _stretches(usable: Mask, jumps: Mask, frame_s: float) -> tuple[Mask, Mask]:
    """Return the rows that are judged, and those at which a replay restarts."""
    judged, starts = np.zeros(len(usable), dtype=bool), np.zeros(len(usable), dtype=bool)
    lead, settle = round(LEAD_s / frame_s), round(SETTLE_s / frame_s)
    for run in _runs(usable, jumps):
        begun = run.start + lead + settle if run.start else 0
        if run.stop - begun < WINDOW_s / frame_s:
            continue
        judged[begun : run.stop] = True
        if run.start:
            starts[run.start + lead] = True
    return judged, starts


class _Clock:
    """The times of a record's samples, in frames along equal steps of the loader's clock.

    `at` is the time of each row, `jumps` are the rows at which a new series of equal steps begins.
    `problem` is the reason if the loader's clock is not used.
    """

    def __init__(self, record: Record, sampled: Mask, frame_s: float) -> None:
        rows = np.flatnonzero(sampled)
        self.at = np.arange(len(record), dtype=np.float64)
        self.jumps, self.problem = np.zeros(len(record), dtype=bool), ""
        if LOADER_TIME not in record or len(rows) < 3:
            return
        time, own = record.time_s[rows], record[LOADER_TIME][rows]
        rate = float(np.median(np.diff(own) / np.diff(time)))
        if not abs(rate - 1.0) < NEGLIGIBLE:  # crystals differ by 1e-4
            self.problem = f"The loader's clock runs {rate:.3g} times as fast as the host's"
            return
        away = (own - time) / frame_s
        window = 2 * round(0.5 * BRIEF_s / frame_s) + 1
        usual = median_filter(away, window, mode="nearest")
        cuts = np.concatenate(([False], np.abs(np.diff(usual)) > MOST))
        self.jumps[rows[cuts]] = True
        for part in _runs(np.ones(len(rows), dtype=bool), cuts):
            near = np.abs(away[part] - usual[part]) < MOST
            if not near.any():
                continue
            # The clocks drift apart linearly; a short stretch does not determine the slope.
            degree = 1 if np.sum(near) > window else 0
            drift = Polynomial.fit(rows[part][near], away[part][near], degree)
            self.at[rows[part]] += away[part] - drift(rows[part])

    def resampled(self, signal: Floats, sampled: Mask, received: Mask) -> Floats:
        """Return a signal at equal steps of the clock, linear in rows that are not `received`."""
        rows = np.flatnonzero(sampled)
        if len(rows) < 4:
            return signal
        before = np.maximum.accumulate(self.at[rows])[:-1]
        rows = rows[np.concatenate(([True], self.at[rows][1:] > before + TINY))]
        moved = np.abs(self.at[rows] - rows).max() > TINY
        if received.all() and len(rows) == len(signal) and not moved:
            return signal
        at, frames = self.at[rows], np.arange(len(signal))
        found = np.interp(frames, at, signal[rows])
        inside = received & (frames >= at[0]) & (frames <= at[-1])
        found[inside] = CubicSpline(at, signal[rows])(frames[inside])
        return found


def _settings(
    record: Record, live: Mapping[str, Any], frame_s: float
) -> tuple[bool, Mask, dict[str, Assumed]]:
    """Return whether the manifest lists changes of settings, and their effects.

    These are the rows with other hardware than at the start or with unknown settings, and K̂ in use
    for each control whose K̂ changed.
    """
    time, first = record.time_s, _first_settings(record)
    events = sorted(_events(live, frame_s), key=lambda event: event[0])
    other, assumed = np.zeros(len(record), dtype=bool), dict[str, Assumed]()
    for control in CONTROL_NAMES:
        rows = dict[str, Floats]()
        for what in (*HARDWARE, *HOSTED):
            own = [
                (at, value)
                for at, of, key, value in events
                if (of, key) == (control, what) and at <= time[-1]
            ]
            if control in first:
                values = np.array([first[control][what], *(value for _, value in own)])
                rows[what] = values[np.searchsorted([at for at, _ in own], time, side="right")]
                if what in HARDWARE:
                    other |= rows[what] != rows[what][0]
            elif own:  # first value not known
                other |= time >= own[0][0]
        if rows:
            bend, estimate, gradient = (rows[what] for what in HOSTED)
            used = Assumed(*(bend * on - bend[0] * on[0] for on in (estimate, gradient)))
            if used.estimate.any() or used.gradient.any():
                assumed[control] = used
    return bool(events), other, assumed


def _events(live: Mapping[str, Any], frame_s: float) -> Iterator[tuple[float, str, str, float]]:
    """Yield the changes: time from which it acts, s, control, setting and new value.

    A switch acts from its frame on, an adaptation of K̂ from the next one.
    """
    for change in live.get("switched") or []:
        try:
            at, value = float(change["time_s"]), float(change["value"])
            yield at - 0.5 * frame_s, str(change["control"]), str(change["what"]), value
        except (TypeError, KeyError, ValueError):
            raise _damaged("switched") from None
    for change in live.get("adapted") or []:
        try:
            at, control, value = change
            yield float(at) + 0.5 * frame_s, str(control), "assumed_bend", float(value)
        except (TypeError, ValueError):
            raise _damaged("adapted") from None


def _first_settings(record: Record) -> dict[str, dict[str, float]]:
    """Return the settings at the start of the flight by control, from the manifest."""
    found: dict[str, dict[str, float]] = {}
    for control in CONTROL_NAMES:
        bend = f"bend_{unit_of(control)}_per_N"
        keys = {
            "assumed_bend": ("compensation", bend),
            "deflection": ("compensation", "deflection"),
            "gradient": ("compensation", "gradient"),
            "bend": ("loader", bend),
            "friction": ("loader", "friction_N"),
            "breakout": ("loader", "breakout_N"),
        }
        with suppress(KeyError, TypeError, ValueError):
            data = record.manifest["rig"]["controls"][control]
            found[control] = {what: float(data[part][key]) for what, (part, key) in keys.items()}
    return found


def _words(
    frame_s: float,
    sampled: Mask,
    bridged: Mask,
    validity: Floats,
    other: Mask,
    clock: _Clock,
    assumed: Mapping[str, Assumed],
) -> Iterator[str]:
    """Yield what is not judged in a record, or judged with changes, a sentence each."""

    def seconds(mask: Mask) -> str:
        first, last = np.flatnonzero(mask)[[0, -1]] * frame_s
        return f"{frame_s * np.sum(mask):.2g} s between {first:.2f} s and {last:.2f} s"

    if bridged.any():
        share = 100.0 * float(np.mean(bridged))
        yield f"{share:.2g} % of the loader's samples are missing: they are interpolated."
    if (silent := ~sampled & ~bridged).any():
        yield f"Left out: {seconds(silent)} in which the loader sent no new sample."
    if (faded := validity == FADED).any():
        yield f"Left out: {seconds(faded)} in which forces were faded or limited."
    if other.any():
        yield f"Left out: {seconds(other)} flown with other settings, as switched in flight."
    if clock.jumps.any():
        count = int(np.sum(clock.jumps))
        span_s = SETTLE_s + LEAD_s
        yield f"Left out: {span_s:g} s after each of {count} frames that the host missed."
    if clock.problem:
        yield f"{clock.problem}: its samples are taken at the host's frames."
    for control, used in assumed.items():
        least = min(float(used.estimate.min()), float(used.gradient.min()))
        most = max(float(used.estimate.max()), float(used.gradient.max()))
        span = f"{least:+.3g} to {most:+.3g} {unit_of(control)}/N"
        yield f"The {control}'s K̂ in use changed by {span} in flight: each row has its own."
