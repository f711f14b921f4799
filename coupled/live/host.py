"""The companion of a live flight, which acts before and after each frame of a batch flight.

Before frame k it waits for the frame's deadline, executes requests of the user, and takes the
measurement of the loader or the position of the hand. The batch flight's kernel then computes the
frame. After it, the companion sends orders to the loader, and data to estimators, views and page.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from coupled.errors import InputError
from coupled.flight.companion import FlightAccess
from coupled.live.attached import AttachedLoader
from coupled.live.hands import HandPositions, PositionFilter
from coupled.live.link import Link
from coupled.live.pacing import Pacer
from coupled.live.rows import Rows, only_measured
from coupled.live.safety import Limits
from coupled.live.service import Adaptation, BendEstimator
from coupled.record.channels import FRESH, SWITCHED, channel
from coupled.record.record import Record
from coupled.rig.serving import check_service, service_command, services_of, set_service
from coupled.rig.switches import Switches

STOPPED = "stopped"
SAVE_EVERY_s = 5.0  # writing a record takes processor time from the frames
Motion = tuple[float, ...]


@dataclass(frozen=True)
class Request:
    """A request of the user: `stop`, `mark`, `save`, `set` of a switch or `service`.

    `text` names the switch or the service of a `control`, or is the text of a mark.
    """

    what: str
    text: str = ""
    control: str = ""
    value: float = 0.0


class Watcher(Protocol):
    """An observer of the flight, such as a view or the page: it neither waits nor raises."""

    def begin(self, host: Host) -> None:
        """Start."""

    def observe(self, host: Host, k: int) -> None:
        """Observe frame k."""

    def requests(self) -> Sequence[Request]:
        """Return the user's requests since the last call."""

    def close(self) -> None:
        """End."""


@dataclass
class Plan:
    """The equipment of a live flight; by default a batch flight in real time.

    `paced` is real time; otherwise lock-step: as fast as the loader answers. `link` is a real
    loader; without it `hand_positions` moves the hands on the simulated one. `adapt` sets the
    compensation's K̂ to the estimated K. `warn` receives urgent messages for the pilot. `save`
    writes a record so far, in a thread, and may raise InputError.
    """

    paced: bool = True
    link: Link | None = None
    hand_positions: HandPositions | None = None
    limits: Limits = field(default_factory=Limits)
    adapt: bool = False
    watchers: Sequence[Watcher] = ()
    warn: Callable[[str], None] = lambda text: None
    save: Callable[[Record], None] | None = None


@dataclass
class FlightEvents:
    """The events of a live flight; times in s."""

    marks: list[tuple[float, str]] = field(default_factory=list)
    led: list[tuple[float, str, str, float]] = field(default_factory=list)  # control, service, to
    alarms: list[tuple[float, str, float]] = field(default_factory=list)  # time, control, K
    adapted: list[tuple[float, str, float]] = field(default_factory=list)  # time, control, K̂


class Host:
    """The companion of a live flight."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.real_loader = plan.link is not None
        self.sets_services = plan.link is None and bool(plan.watchers)
        self.events = FlightEvents()
        self.attached: AttachedLoader | None = None
        self.time_s = 0.0
        self.real_time_priority = False  # whether the system granted real-time priority
        self.access: FlightAccess | None = None
        self._saving: threading.Thread | None = None
        self._next_save_s = 0.0

    def begin(self, access: FlightAccess) -> None:
        """Start with the aircraft in trim: connect to the loader and fade its forces in."""
        plan, rig = self.plan, access.manoeuvre.rig
        self.access, self.frame_s = access, 1.0 / rig.frame_rate
        self.names = [str(name) for name in rig.controls]
        self.substeps, controls = rig.substeps, list(rig.controls.values())
        self.switches = Switches(rig, access.controls, access.hands, self.real_loader)
        self.pacer = Pacer(self.frame_s, len(access.data))
        self.rows = Rows(len(access.data), plan.link is not None, plan.paced)
        self._filters = [PositionFilter(control, self.frame_s) for control in controls]
        self._columns = [
            [access.channels.index(channel(name, q)) for q in ("force", "computed", "deflection")]
            for name in self.names
        ]
        measured = plan.link is None or plan.link.measures_deflection
        pairs = zip(self.names, controls, strict=True)
        known = [(name, c) for name, c in pairs if measured and c.compensation.bend > 0.0]
        self.service = {name: BendEstimator(control, self.frame_s) for name, control in known}
        self._adaptations = {
            name: Adaptation(control.compensation.bend, max(control.schedule.gradients))
            for name, control in known
            if plan.adapt
        }
        if plan.link is not None:
            self.attached = AttachedLoader(plan.link, plan.limits, access, plan.paced, plan.warn)
            self.attached.connect()
        for watcher in plan.watchers:
            watcher.begin(self)

    def before(self, k: int, motion: Motion) -> str:
        """Wait for the frame's deadline, and take requests, measurements and hand positions."""
        self.time_s = k * self.frame_s
        if self.plan.paced:
            self.pacer.wait()
        for watcher in self.plan.watchers:
            for request in watcher.requests():
                if request.what == "stop":
                    return STOPPED
                self._execute(request)
        if self.attached is not None:
            return self.attached.listen(self.time_s)
        if self.plan.hand_positions is not None:
            self._move_hands(self.plan.hand_positions, k)
        return ""

    def _execute(self, request: Request) -> None:
        if request.what == "save":
            self._save()
        elif request.what == "mark":
            self.events.marks.append((self.time_s, request.text[:200]))
        elif request.what == "service":
            self._set_service(request)
        elif request.what == "set":
            try:
                self.switches.set(self.time_s, request.control, request.text, request.value)
            except InputError as error:
                self.plan.warn(str(error))

    def _set_service(self, request: Request) -> None:
        """Set a service of a simulated loader, as an event of a run does."""
        assert self.access is not None
        control, service, value = request.control, request.text, request.value
        try:
            if self.real_loader:
                raise InputError("service", service, "belongs to the real loader; set it there")
            check_service(self.switches.rig, control, service, value, "service", service)
        except InputError as error:
            self.plan.warn(str(error))
            return
        set_service(self.access.controls, self.names, control, service, value)
        self.events.led.append((self.time_s, control, service, value))

    def services(self) -> dict[str, dict[str, float]]:
        """Return the services of each simulated control that can be set, and their values."""
        if self.real_loader or self.access is None:
            return {}
        found: dict[str, dict[str, float]] = {}
        for name in self.names:
            for service in services_of(name):
                with contextlib.suppress(InputError):
                    check_service(self.switches.rig, name, service, 0.0, "service", service)
                    command = service_command(self.access.controls, self.names, name, service)
                    found.setdefault(name, {})[service] = command
        return found

    def _save(self) -> None:
        """Write the record so far in a thread; one at a time."""
        rows, save = round(self.time_s / self.frame_s), self.plan.save
        busy = self._saving is not None and self._saving.is_alive()
        if save is None or rows < 2 or busy or self.time_s < self._next_save_s:
            return
        self._next_save_s = self.time_s + SAVE_EVERY_s

        def write() -> None:
            try:
                save(self.so_far(0, rows))
            except InputError as error:
                self.plan.warn(str(error))

        self._saving = threading.Thread(target=write)
        self._saving.start()

    def so_far(self, first: int, last: int) -> Record:
        """Return the record from frame `first` to before `last` of the current flight."""
        assert self.access is not None
        return self.kept(self.access.so_far(first, last), True, first)

    def kept(self, record: Record, stopped: bool, first: int = 0) -> Record:
        """Return a record that begins with frame `first`, with the data of the live flight.

        A flight `stopped` by its user does not count as ended early.
        """
        manifest: dict[str, Any] = {**record.manifest, "live": self.as_dict()}
        manifest["live"]["stopped"] = stopped
        if stopped:
            manifest["ended_early"] = None
        finished = Record(record.channels, record.data, manifest)
        if (attached := self.attached) is not None:
            grips, link = attached.measures_deflection, attached.link
            finished = only_measured(finished, link, self.switches.rig, grips)
        return self.rows.append_to(finished, first)

    def _move_hands(self, positions: HandPositions, k: int) -> None:
        """Write the hands' positions over the next frame."""
        assert self.access is not None
        first, last = k * self.substeps, (k + 1) * self.substeps
        for i, (name, position_filter) in enumerate(zip(self.names, self._filters, strict=True)):
            before = position_filter.at
            way = np.linspace(before, position_filter.move(positions.read(name)), last - first + 1)
            self.access.script[i, 1, first + 1 : last + 1] = way[1:]

    def after(self, k: int, commands: tuple[float, float, float]) -> None:
        """Send the orders, and pass the frame to estimators and watchers."""
        assert self.access is not None
        row, attached = self.access.data[k], self.attached
        validity = FRESH
        if attached is not None:
            attached.order(self.access.controls, row)
            validity = attached.validity()
            self.rows.loader_time_s[k] = attached.time_s
        switched = validity == FRESH and self.switches.differs
        self.rows.validity[k] = SWITCHED if switched else validity
        for i, (name, at) in enumerate(zip(self.names, self._columns, strict=True)):
            if name in self.service:
                new = attached is None or attached.measured_now(i)
                self._estimate_bend(name, new, *(float(row[column]) for column in at))
        for watcher in self.plan.watchers:
            watcher.observe(self, k)

    def _estimate_bend(
        self, name: str, new: bool, force: float, computed: float, deflection: float
    ) -> None:
        estimator = self.service[name]
        alarmed = estimator.now.alarm
        found = estimator.update(force, computed, deflection, fresh=new)
        if found.alarm and not alarmed and found.bend is not None:
            self.events.alarms.append((self.time_s, name, found.bend))
            self.plan.warn(f"K of the {name} differs from the calibrated one")
        if name in self._adaptations:
            assumed = self._adaptations[name].update(self.time_s, found)
            if assumed is not None:
                self.switches.put(name, "assumed_bend", assumed)
                self.events.adapted.append((self.time_s, name, assumed))

    def shut_down(self) -> None:
        """Fade the loader's forces out, and close all devices; called at every end of a flight."""
        try:
            if self._saving is not None:
                self._saving.join()
            if self.attached is not None:
                self.attached.shut_down()
            elif self.plan.link is not None:
                self.plan.link.close()
        finally:
            for watcher in self.plan.watchers:
                watcher.close()
            if self.plan.hand_positions is not None:
                self.plan.hand_positions.close()

    def as_dict(self) -> dict[str, Any]:
        """Return the section `live` of the manifest."""
        link, attached = self.plan.link, self.attached
        found: dict[str, Any] = {
            "paced": self.plan.paced,
            "real_time_priority": self.real_time_priority,
            "loader": "sim" if link is None else link.name,
            "lateness": self.pacer.result().as_dict() if self.plan.paced else None,
            "switched": [asdict(change) for change in self.switches.changes],
            "bend_in_service": {n: e.now.as_dict() for n, e in self.service.items()},
            "adapt": self.plan.adapt,
            **{what: list(events) for what, events in vars(self.events).items()},
        }
        if link is not None and attached is not None:
            found |= {
                "dropped_packets": dict(link.dropped),
                "round_trip": None if link.round_trips is None else link.round_trips.as_dict(),
                "limits": asdict(self.plan.limits),
                "limited_frames": attached.limited_frames,
                **asdict(attached.losses),
            }
        return found
