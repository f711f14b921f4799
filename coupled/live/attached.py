"""A real loader: its answers are checked, its orders limited, its forces faded in and out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coupled.errors import InputError, listed
from coupled.flight.companion import FlightAccess
from coupled.live.link import FADING, OFF, RUN, Link, Measured, Order, Sample, WATCHDOG_s
from coupled.live.safety import Fade, Limiter, Limits, Plausibility
from coupled.record.channels import FADED, FRESH, LOST, REPEATED, channel
from coupled.rig.placed import Placed

ANSWER_s = 10.0  # time limit of a loader's first answer
GONE_s = 30.0  # time without an answer after which the flight ends
AT_REST = 0.25  # of the travel, within which a control must rest before a flight
GONE = f"the loader has not answered for {GONE_s:g} s"
_IDLE = Order(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass
class Losses:
    """The times in s at which a loader could not be used, each with start and end.

    `spells` are without an answer, `stale_frames` is the number of frames without a new sample,
    and `implausible` are those with implausible measurements of a control, with the reason.
    """

    spells: list[list[float | None]] = field(default_factory=list)
    stale_frames: int = 0
    implausible: list[dict[str, Any]] = field(default_factory=list)


def chord(modification: Any, travel: float) -> float:
    """Return F_mod of a curve at full travel over the travel, N/d, on its stiffer side."""
    page = modification["page"]
    at, force, slope = (modification[f"node_{part}"][page] for part in ("at", "force", "slope"))
    last = np.count_nonzero(at <= travel, axis=1) - 1
    sides = np.arange(2)
    reached = force[sides, last] + slope[sides, last] * (travel - at[sides, last])
    return float(np.max(reached)) / travel


class AttachedLoader:
    """The loader on `link`; `warn` receives urgent messages for the pilot."""

    def __init__(
        self,
        link: Link,
        limits: Limits,
        access: FlightAccess,
        paced: bool,
        warn: Callable[[str], None],
    ) -> None:
        self._rig = rig = access.manoeuvre.rig
        self.link, self._aboard, self._paced, self._warn = link, access, paced, warn
        self.frame_s = 1.0 / rig.frame_rate
        controls = list(rig.controls.values())
        self._limiters = [
            Limiter(limits, control.travel, self.frame_s, link.ordered_gradient(i))
            for i, control in enumerate(controls)
        ]
        self._travels = [control.travel for control in controls]
        self._plausible = [Plausibility(c, self.frame_s, link.measures_force) for c in controls]
        self._faults: list[dict[str, Any] | None] = [None] * len(controls)
        self._fade = Fade(limits.fade_s, self.frame_s)
        names, at = list(rig.controls), access.channels.index
        self._force_at = [at(channel(name, "modifying_force")) for name in names]
        self._gradient_at = [at(channel(name, "gradient")) for name in names]
        self._deflection_at = [at(channel(name, "deflection")) for name in names]
        self._measured: tuple[Measured, ...] = (Measured(0.0, 0.0, 0.0),) * len(names)
        self._orders = (_IDLE,) * len(names)
        self._seen = 0.0
        self._fresh = False  # the last call of `listen` received a new sample
        self._measures = [False] * len(names)  # whether it contained δ, by control
        # Of each control, whether a sample before the flight contained δ.
        self.measures_deflection = [False] * len(names)
        self.time_s = math.nan  # of the last sample, by the loader's clock
        self.lost = False
        self.losses = Losses()

    @property
    def limited_frames(self) -> int:
        """Return the number of frames in which the limits reduced an order."""
        return sum(limiter.limited for limiter in self._limiters)

    def connect(self) -> None:
        """Wait for the loader's first answer, and fade its forces in with the aircraft in trim."""
        begun = time.monotonic()
        while (sample := self.link.receive(0.02)) is None:
            self.link.send(self._orders, OFF)
            if time.monotonic() - begun > ANSWER_s:
                raise InputError(self.link.name, "", self._why_no_answer())
        self._take(sample)
        self._find_transducers()
        self._check_rest()
        controls = self._aboard.controls.copy()
        row = np.zeros((1, len(self._aboard.channels)))
        rate_Hz = self._rig.frame_rate
        placed = Placed(controls, self._aboard.script, row, rate_Hz, real_loader=True)
        motion = self._aboard.airframe.whole_motion()
        while True:
            self._put(controls)
            row[:] = 0.0
            placed.frame(0, motion)
            self.order(controls, row[0])
            if self._fade.share >= 1.0:
                self._warn_of_missing_transducers()
                return
            self._wait_frame()
            self.listen(0.0)
            self._find_transducers()
            if time.monotonic() - self._seen > ANSWER_s:
                problem = "stopped answering while its forces were faded in"
                raise InputError(self.link.name, "", problem)

    def _why_no_answer(self) -> str:
        if not self.link.dropped:
            return f"does not answer within {ANSWER_s:g} s; start the loader first"
        reasons = ", ".join(self.link.dropped)
        return (
            f"sends no packet that can be used within {ANSWER_s:g} s ({reasons});"
            f" give {listed(map(str, self._rig.controls))} in the format of docs/live.md"
        )

    def _find_transducers(self) -> None:
        """Note which controls have had their δ measured; before the flight only."""
        pairs = zip(self.measures_deflection, self._measures, strict=True)
        known = self.link.measures_deflection
        self.measures_deflection = [known and (before or now) for before, now in pairs]

    def _warn_of_missing_transducers(self) -> None:
        for name, measured in zip(self._rig.controls, self.measures_deflection, strict=True):
            if self.link.measures_deflection and not measured:
                self._warn(f"δ of the {name} is not measured: neither it nor K is recorded")

    def _check_rest(self) -> None:
        """Raise InputError if a control is far from its trim before forces are faded in."""
        for (name, control), now in zip(self._rig.controls.items(), self._measured, strict=True):
            if abs(now.computed) > AT_REST * control.travel:
                share = 100.0 * now.computed / control.travel
                problem = f"the {name} is at {share:.0f} % of its travel; let it rest at neutral"
                raise InputError(self.link.name, "", problem)

    def _wait_frame(self) -> None:
        if self._paced:
            time.sleep(self.frame_s)

    def listen(self, time_s: float) -> str:
        """Take the loader's newest sample; return why the flight must end, or an empty text."""
        sample = self.link.receive(0.0 if self._paced else WATCHDOG_s)
        now = time.monotonic()
        self._fresh = sample is not None
        if sample is not None:
            self._take(sample)
            self._judge(sample, time_s)
            if self.lost:
                self.lost = False
                self.losses.spells[-1][1] = time_s
                self._warn("the loader answers again: its forces return")
        else:
            self.losses.stale_frames += 1
            for plausible in self._plausible:
                plausible.miss()
            if not self.lost and now - self._seen > WATCHDOG_s:
                self.lost = True
                self.losses.spells.append([time_s, None])
                self._warn("the loader does not answer: its forces fade out, the surface is held")
            if now - self._seen > GONE_s:
                return GONE
        self._put(self._aboard.controls)
        return ""

    def _take(self, sample: Sample) -> None:
        """Take a sample; δ that was not measured keeps its last value."""
        self._seen, self.time_s = time.monotonic(), sample.time_s
        self._measures = [math.isfinite(now.deflection) for now in sample.controls]
        self._measured = tuple(
            now if known else now._replace(deflection=last.deflection)
            for now, last, known in zip(
                sample.controls, self._measured, self._measures, strict=True
            )
        )

    def _judge(self, sample: Sample, time_s: float) -> None:
        """Find implausible measurements, which fade the forces, and warn once of each."""
        for i, (name, now) in enumerate(zip(self._rig.controls, sample.controls, strict=True)):
            known = now if self.link.measures_deflection else now._replace(deflection=math.nan)
            before, found = self._faults[i], self._plausible[i].update(known)
            if found == ("" if before is None else before["why"]):
                continue
            if before is not None:
                before["to_s"] = time_s
            if found:
                spell = {"control": str(name), "why": found, "from_s": time_s, "to_s": None}
                self._faults[i] = spell
                self.losses.implausible.append(spell)
                self._warn(f"all forces fade out: implausible measurement of the {name}: {found}")
            else:
                self._faults[i] = None
                self._warn(f"the measurements of the {name} are plausible again: the forces return")

    def measured_now(self, i: int) -> bool:
        """Return whether the last call of `listen` received a sample of control i with its δ.

        δ that was not measured before the flight is not used, as it is not recorded.
        """
        return self._fresh and self._measures[i] and self.measures_deflection[i]

    def validity(self) -> int:
        """Return the validity of the frame's row (`coupled.record.channels`)."""
        if not self._fresh:
            return LOST if self.lost else REPEATED
        if any(np.greater(self.measures_deflection, self._measures)):
            return REPEATED  # δ of the row is that of an earlier sample
        held = self._fade.share < 1.0 or any(limiter.cut for limiter in self._limiters)
        return FADED if held else FRESH

    def _put(self, controls: Any) -> None:
        """Write the measurements to the kernels' state; without a loader they stay unchanged."""
        state = controls["state"]
        for i, measured in enumerate(self._measured):
            state["hand"]["force"][i] = measured.force
            state["loader"]["computed"][i] = measured.computed

    def order(self, controls: Any, row: Any) -> None:
        """Send the orders of a frame; write the orders sent and the measured δ to the row."""
        share, orders = self._fade.move(not self.lost and not any(self._faults)), []
        for i, limiter in enumerate(self._limiters):
            m = controls["state"]["modification"][i]
            own = self.link.own_load(i, self._measured[i].computed)
            first, second = float(m["first"]), float(m["second"])
            if m["curved"]:
                first = second = chord(m, self._travels[i])
            asked = Order(
                first,
                second,
                float(m["break_computed"]),
                float(m["breakout"]),
                float(row[self._force_at[i]]) + own,
                float(row[self._gradient_at[i]]),
                0.0,
            )
            sent = limiter.order(asked, share)
            orders.append(sent)
            row[self._force_at[i]] = sent.force - own
            row[self._deflection_at[i]] = self._measured[i].deflection
        self._orders = tuple(orders)
        self.link.send(self._orders, RUN if share == 1.0 else FADING if share > 0.0 else OFF)

    def shut_down(self) -> None:
        """Fade the loader's forces out, send that they are off, and close the link."""
        asked = self._orders
        while self._fade.share > 0.0:
            self._wait_frame()
            self.link.receive(0.0 if self._paced else 1e-3)
            share = self._fade.move(on=False)
            pairs = zip(self._limiters, asked, strict=True)
            orders = tuple(limiter.order(order, share) for limiter, order in pairs)
            self.link.send(orders, FADING if share > 0.0 else OFF)
        for _ in range(3):  # a datagram may be lost
            self.link.send((_IDLE,) * len(asked), OFF)
        self.link.close()
