"""One plain aircraft: loaded, trimmed and stepped. The only module that uses JSBSim.

The airframe is trimmed on its flight path, takes the commands of elevator, aileron and rudder
(about trim, ±1 for the whole travel) and gives the motion. It opens no socket, writes no file and
prints nothing: a model's own inputs and outputs are disabled before they start, and JSBSim's log is
kept for error messages.

Loading, changes of the model and events are wrappers (`wrapper`), called in their order at three
moments. `aircraft` makes their list.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import jsbsim
import numpy as np
from numpy.typing import NDArray

from coupled.errors import LISTED, InputError, listed, nearest
from coupled.flight.addresses import addresses, node_of
from coupled.flight.everyframe import (
    LATERAL_PROPERTIES,
    LONGITUDINAL_PROPERTIES,
    PROPERTIES,
    TO_SI,
    Lever,
    PlainAircraft,
    PlainFrames,
    PlainSteps,
    Read,
    Write,
    command_writes,
    mean_reader,
    motion_reader,
    plain_frames,
    plain_steps,
    stepper,
)
from coupled.flight.gusts import GUST_DOWN
from coupled.flight.modelfile import catalogue, loadable, models_in, properties_read
from coupled.flight.modelparts import NothingToScaleError
from coupled.flight.modelreset import put_back, stall_limits
from coupled.flight.modeltext import UnreadableModelError
from coupled.flight.newton import Elevators, newton_trim, why_unbalanced
from coupled.flight.surfacemap import flown_through, stops_found
from coupled.flight.wrapper import Step, Wrapper, led_by
from coupled.record.channels import ALTITUDE, LONGITUDINAL, SURFACES, motion_channels
from coupled.rig.parameters import Flight
from coupled.rig.placed import Connection, HalfFrames, Placed
from coupled.units import DEGREE_rad, FOOT_m, KNOT_m_per_s

_COMMANDS = {name: f"fcs/{name}-cmd-norm" for name in SURFACES.values()}
_POSITIONS = {PROPERTIES[f"{surface}_rad"]: control for control, surface in SURFACES.items()}
UNTRIMMED = "calibrated_airspeed_m_per_s"  # key of the fault of an aircraft that does not trim
# The motion's channels that define its state: the flow, and JSBSim's initial conditions of others.
SPEED = "true_airspeed_m_per_s"
_FLOW = (SPEED, "alpha_rad", "sideslip_rad")
_MOVED_TO = {
    "altitude_m": "ic/h-sl-ft",
    "roll_rad": "ic/phi-rad",
    "pitch_rad": "ic/theta-rad",
    "heading_rad": "ic/psi-true-rad",
    "roll_rate_rad_per_s": "ic/p-rad_sec",
    "pitch_rate_rad_per_s": "ic/q-rad_sec",
    "yaw_rate_rad_per_s": "ic/r-rad_sec",
}
_WIND = tuple(f"atmosphere/wind-{way}-fps" for way in ("north", "east", "down"))
_HEIGHT, _WHEELS = "position/h-agl-ft", "gear/wow"
_MOVED_BY_TRIM = re.compile(
    r"fcs/(throttle|elevator|aileron|rudder|.*trim)-cmd-norm(\[\d+\])?"
).fullmatch
_STRUCTURE = re.compile(r"contact/unit(\[\d+\])?/WOW").fullmatch  # contacts other than wheels


class _Log(jsbsim.FGLogger):
    """Keeps JSBSim's messages, and prints none of them."""

    def __init__(self) -> None:
        super().__init__()
        self.text = ""

    def set_level(self, level: Any) -> None:
        """Begin a message."""

    def file_location(self, filename: str, line: int) -> None:
        """Take the file and line of the message."""

    def message(self, message: str) -> None:
        """Take a piece of the message."""
        self.text = (self.text + message)[-2000:]

    def format(self, format: Any) -> None:
        """Take the colour of the next piece."""

    def flush(self) -> None:
        """End a message."""


def _nearly_equal(value: float, given: float) -> bool:
    return math.isclose(value, given, rel_tol=1e-6, abs_tol=1e-12)


Floats = NDArray[np.float64]
_log = _Log()
_base: Callable[[], Any] = jsbsim.FGJSBBase  # its debug level is the library's


@lru_cache(maxsize=1)
def packaged_models() -> Mapping[str, Path]:
    """Return the models that come with JSBSim: {name: folder of all models}."""
    return models_in(Path(jsbsim.get_default_root_dir()) / "aircraft")


def main_file(flight: Flight, models: Sequence[Path] = (), file: object = "rig") -> Path:
    """Return the main file of a rig's model.

    `models` are folders of our own models, searched first. Raises InputError, with `file`.
    """
    name, known = flight.model, dict(packaged_models())
    for folder in reversed(models):
        known |= models_in(folder)
    if flight.folder:
        known[name] = _own_folder(flight, file)
    if name not in known:
        problem = f"there is no JSBSim model {name!r}; {nearest(name, known)}"
        raise InputError(file, "flight.model", problem)
    main = known[name] / flight.main_file
    if not main.is_file():
        raise InputError(file, "flight.model_file", f"there is no {flight.main_file} of JSBSim")
    return main


def _own_folder(flight: Flight, file: object) -> Path:
    """Return the folder of the rig's own model."""
    folder = Path(flight.folder)
    try:
        there = (folder / flight.main_file).is_file()
    except (OSError, ValueError):  # a name that no folder can have
        there = False
    if not there:
        problem = f"{flight.folder!r} contains no {flight.main_file}"
        raise InputError(file, "flight.model_folder", problem)
    return folder


class JSBSimAirframe:
    """A JSBSim model, trimmed at the rig's altitude, calibrated airspeed and flight path.

    Parameters: the rig's `flight` section; `frame_s` in seconds; `controls`, those of the rig in
    its order; `models`, folders of our own models, searched first; `file`, the rig's file, for
    faults; `record`, further properties to read each frame, requested in `record_file`; `wrappers`,
    in the order in which they act. Load, factors and gusts of the section act only through the
    wrappers of `aircraft.make_aircraft`.
    """

    motion: Callable[[], tuple[float, ...]]  # the current values of the motion's channels, SI
    whole_motion: Callable[[], tuple[float, ...]]  # with zeros for channels that its rig lacks
    step: Step  # one frame with commands about trim

    def __init__(
        self,
        flight: Flight,
        frame_s: float,
        controls: Sequence[str] = ("column",),
        models: Sequence[Path] = (),
        file: object = "rig",
        record: Sequence[str] = (),
        record_file: object = "run",
        wrappers: Sequence[Wrapper] = (),
    ) -> None:
        self._file, self._flight, self._controls = file, flight, tuple(controls)
        self._fdm = self._load(models, frame_s, wrappers)
        self._trim(wrappers)
        lateral = len(motion_channels(controls, flown=True)) > len(LONGITUDINAL)
        along = [self._motion_read(name) for name in LONGITUDINAL_PROPERTIES]
        beside = [self._motion_read(name) for name in LATERAL_PROPERTIES if lateral]
        self.motion, self.whole_motion = motion_reader(along, beside)
        self._height = self._node(_HEIGHT).get_double_value
        touching = filter(_STRUCTURE, self._catalog) if flight.landing else [_WHEELS]
        self._touching = self._reads(touching)
        self._extra = self._reads(record, "record_properties", record_file)
        writes = command_writes([self._levers_of(control) for control in controls])
        plain = stepper(self._fdm.run, writes, flight.steps_per_frame)
        hooks = [hook for wrapper in wrappers if (hook := wrapper.attach(self)) is not None]
        self.step = led_by(hooks, plain)
        self._unled = plain
        # Above this altitude no wheel is near the ground, and the height need not be checked.
        ground_m = self.motion()[ALTITUDE] - self._height() * FOOT_m
        self.safe_altitude_m = ground_m + 100.0
        alone = not hooks and flight.steps_per_frame == 1
        self._plain = self._connected([*along, *beside], writes) if alone else None
        if trouble := self.trouble():
            raise self.fault("altitude_m", f"{trouble} at the start; choose a higher one")

    def fault(self, key: str, problem: str) -> InputError:
        """Return the fault of a key of the rig's `flight` section."""
        return InputError(self._file, f"flight.{key}" if key else "flight", problem)

    def _load(
        self,
        models: Sequence[Path],
        frame_s: float,
        wrappers: Sequence[Wrapper],
        created: frozenset[str] = frozenset(),
    ) -> Any:
        _base().debug_lvl = 0
        jsbsim.set_logger(_log)
        name, main = self._flight.model, main_file(self._flight, models, self._file)
        fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
        step_s = frame_s / self._flight.steps_per_frame
        fdm.set_dt(step_s)  # before loading, for the model's rate limits
        self._properties = fdm.get_property_manager()
        for each in created:
            self._properties.get_node(each, True)
        _log.text = ""
        scaled = [part for wrapper in wrappers for part in wrapper.scaled]
        ballasts = sum(wrapper.ballasts for wrapper in wrappers)
        try:
            with loadable(main, scaled, ballasts) as folder:
                fdm.set_aircraft_path(str(folder))
                loaded = fdm.load_model(name)
        except NothingToScaleError as error:
            raise self.fault(error.name, f"{name} has {error.lacking}") from None
        except UnreadableModelError as error:
            raise self.fault("model", f"{name} does not load: {error}") from None
        except RecursionError:
            problem = f"{name} does not load: its functions refer to one another without end"
            raise self.fault("model", problem) from None
        except OSError as error:
            problem = f"{name} with factors on it cannot be written to a temporary folder: {error}"
            raise self.fault("", problem) from None
        except (RuntimeError, jsbsim.BaseError) as error:
            raise self.fault("model", f"{name} does not load: {error}") from None
        if not loaded:
            raise self.fault("model", f"{name} does not load: {_log.text.strip()[-200:]}")
        fdm.disable_input()
        fdm.disable_output()  # run_ic opens the files nevertheless
        output = 0
        while fdm.get_output_filename(output):
            fdm.set_output_filename(output, os.devnull)
            output += 1
        fdm.set_dt(step_s)
        # The manager crashes on a malformed name, so names are searched in this list.
        self._catalog = catalogue(fdm.query_property_catalog(""))
        self._catalog = {**self._catalog, **dict.fromkeys(created, "RW")}
        self._main = main
        lacking = self._flight.properties.keys() - self._catalog.keys()
        if lacking and (wanted := lacking & properties_read(main)):
            # External programs as FlightGear create them before loading.
            return self._load(models, frame_s, wrappers, created | wanted)
        return fdm

    def _uncreated(self) -> InputError | None:
        """Return the error of a model that reads properties which are never created, or None."""
        names = sorted(properties_read(self._main) - self._catalog.keys())
        if not names:
            return None
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        problem = (
            f"{self._flight.model} reads properties that JSBSim does not create, as FlightGear"
            f" does: {listed(names[:LISTED])}{more}; give each a value in flight.properties"
        )
        return self.fault("properties", problem)

    def _set(self, name: str, value: float) -> None:
        """Set a property named by the rig file, if it exists and may be set."""
        key = f"properties.{name}"
        if name.startswith(("simulation/", "ic/")) or name == "propulsion/set-running":
            raise self.fault(key, "is set from the rig's other keys; leave it out")
        node = self._node(name, f"flight.{key}", self._file)
        node.set_double_value(value)
        if not _nearly_equal(node.get_double_value(), value):
            raise self.fault(key, f"{self._flight.model} does not let it be set to {value:g}")

    def _node(self, name: str, key: str = "model", file: object = None) -> Any:
        node = self._properties.get_node(name) if name in self._catalog else None
        if node is None:
            problem = f"{self._flight.model} has no property {name!r}"
            if key == "model":
                raise self.fault(key, problem + ", so it cannot be flown by its controls")
            near = difflib.get_close_matches(name[:100], self._catalog, n=1)
            like = f", but {near[0]}" if near else ""
            raise InputError(file, key, f"{problem}{like}; none is created")
        return node

    def _motion_read(self, name: str) -> Read:
        """Return the function that reads a property of the motion, or its substitute on a rig."""
        control = _POSITIONS.get(name, "")
        given = self._flight.surfaces.get(control)
        if given is None or not given.position:
            return cast(Read, self._node(name).get_double_value)
        key = f"controls.{control}.surface_property"
        terms: list[tuple[float, Read]] = []
        for each in given.position:
            if each.endswith("norm"):
                problem = f"{each} is no angle; name a property in rad or deg"
                raise InputError(self._file, key, problem)
            factor = DEGREE_rad if each.endswith("deg") else 1.0
            factor *= (-1.0 if each.startswith("-") else 1.0) / len(given.position)
            node = self._node(each.removeprefix("-"), key, self._file)
            terms.append((factor, node.get_double_value))
        return mean_reader(terms)

    def _levers_of(self, control: str) -> list[tuple[str, float, Lever]]:
        """Return the properties that a control commands: name, sign, and how to set it."""
        given = self._flight.surfaces.get(control)
        if given is None or not given.command:
            name = _COMMANDS[SURFACES[control]]
            node = self._node(name)
            return [(name, 1.0, Lever(node.set_double_value, node.get_double_value))]
        key = f"controls.{control}.command_property"
        found = []
        for each in given.command:
            name, sign = each.removeprefix("-"), -1.0 if each.startswith("-") else 1.0
            found.append((name, sign, self.lever(name, self._file, key)))
        return found

    def _reads(self, names: Iterable[str], key: str = "model", file: object = None) -> list[Read]:
        return [self._node(name, key, file).get_double_value for name in names]

    def _trim(self, wrappers: Sequence[Wrapper]) -> None:
        fdm, flight = self._fdm, self._flight
        fdm["ic/h-sl-ft"] = flight.altitude / FOOT_m
        fdm["ic/vc-kts"] = flight.calibrated_airspeed / KNOT_m_per_s
        fdm["ic/gamma-deg"] = math.degrees(flight.flight_path)
        self._start_engines()
        for wrapper in wrappers:
            if wrapper.heading:
                fdm[_MOVED_TO["heading_rad"]] = wrapper.heading
            wrapper.load(self)
        for name, value in flight.properties.items():
            self._set(name, value)
        _log.text = ""
        path = f" on flight_path_rad = {flight.flight_path:g}" if flight.flight_path else " level"
        where = (
            f"{flight.model} does not trim{path} at altitude_m = {flight.altitude:g},"
            f" calibrated_airspeed_m_per_s = {flight.calibrated_airspeed:g}"
        )
        problem, started = "", False
        elevators = [(sign, lever.set) for _, sign, lever in self._levers_of("column")]
        try:
            started = fdm.run_ic()
            for wrapper in wrappers:
                wrapper.weigh(self)
            if started and flight.trim == "newton":
                problem = newton_trim(fdm, flight, elevators)
            elif started:
                fdm["simulation/do_simple_trim"] = 1
        except (RuntimeError, jsbsim.BaseError) as error:
            said = _log.text or str(error)
            if "does not exist" in f"{said}{error}" and (unmade := self._uncreated()) is not None:
                raise unmade from None
            problem = "JSBSim: " + " ".join(said.split())[-120:]
        if problem:
            if started:
                problem = self._why(elevators) or problem
            raise self.fault(UNTRIMMED, f"{where}: {problem}; choose others")
        if not started or not math.isfinite(fdm["aero/alpha-rad"]):
            raise self.fault("model", f"{flight.model} does not start: {_log.text.strip()[-200:]}")
        self._check_kept()

    def _check_kept(self) -> None:
        """Refuse a property of the rig file that the model itself sets, as a flap's position."""
        for name, value in self._flight.properties.items():
            now = self._fdm[name]
            if _MOVED_BY_TRIM(name) is None and not _nearly_equal(now, value):
                problem = f"{self._flight.model} sets it itself, to {now:g} in trim; leave it out"
                if self.has(command := name.replace("-pos-", "-cmd-")) and command != name:
                    problem += f", or give {command}"
                raise self.fault(f"properties.{name}", problem)

    def _connected(self, reads: Sequence[Read], writes: Sequence[Write]) -> PlainAircraft | None:
        """Return the aircraft by its nodes' addresses; None if they are not known."""
        calls: list[Callable[..., object]] = [*reads, *(write for write, _ in writes)]
        nodes = [node_of(call) for call in calls]
        if (found := addresses(nodes)) is None:
            return None
        functions, at = found
        connection = Connection(
            functions.read,
            functions.write,
            list(zip(at[: len(reads)], TO_SI, strict=False)),
            [(node, trim) for node, (_, trim) in zip(at[len(reads) :], writes, strict=True)],
            self.safe_altitude_m,
        )
        return PlainAircraft(connection, nodes, self._fdm.run, self.trouble)

    def _start_engines(self) -> None:
        self._fdm["propulsion/set-running"] = -1
        for engine in range(self._fdm.get_propulsion().get_num_engines()):
            for lever in ("mixture", "advance"):
                node = self._properties.get_node(f"fcs/{lever}-cmd-norm[{engine}]")
                if node is not None:
                    node.set_double_value(1.0)

    def _why(self, elevators: Elevators) -> str:
        """Return why a started aircraft does not trim, or "" if the reason is not known."""
        try:
            why = why_unbalanced(self._fdm, self._flight, elevators)
        except (RuntimeError, jsbsim.BaseError):
            return ""
        if why or self._flight.trim == "newton":
            return why
        return 'JSBSim\'s trim does not find the balance that there is; try trim = "newton"'

    def restarter(self) -> Callable[[], None] | None:
        """Return the function that resets and trims the aircraft; None if a reset loses its stall.

        Only for one that has not been reset, and without acting wrappers (`aircraftcache`).
        """
        set_limits = stall_limits(self._fdm, self._main)
        if set_limits is None:
            return None

        def restart() -> None:
            put_back(self._fdm)
            set_limits()
            self._trim(())

        return restart

    def put(self, state: Mapping[str, float]) -> None:
        """Put the aircraft into a state of motion, by channel, SI; other channels stay.

        Engines, control laws, surfaces and the air stay as they are.
        """
        fdm = self._fdm
        now = {name: fdm[PROPERTIES[name]] for name in (*_FLOW, *_MOVED_TO)}
        now |= state
        if SPEED in state:
            now[SPEED] /= FOOT_m
        if "altitude_m" in state:
            now["altitude_m"] /= FOOT_m
        speed, alpha, beta = (now[name] for name in _FLOW)
        flow = (math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta))
        body = {
            f"ic/{axis}-fps": speed * share
            + fdm[f"velocities/{axis}-fps"]
            - fdm[f"velocities/{axis}-aero-fps"]
            for axis, share in zip("uvw", flow, strict=True)
        }
        wind = {name: fdm[name] for name in _WIND}
        for name, initial in _MOVED_TO.items():
            fdm[initial] = now[name]
        for name, value in body.items():  # after the attitude, which turns them
            fdm[name] = value
        fdm.run_ic()  # in still air
        if any(wind.values()):
            for name, value in wind.items():
                fdm[name] = value
            fdm.suspend_integration()
            fdm.run()
            fdm.resume_integration()

    def surface_map(self, surface: str = "elevator_rad") -> tuple[Floats, Floats]:
        """Return commands about trim, and a surface's position for each, rad.

        The aircraft cannot be used afterwards: it is flown through all of them, a frame each.
        """
        return flown_through(self.step, self.motion, self._controls, surface)

    def surface_stops(self, control: str) -> dict[str, dict[str, Any] | None]:
        """Return the stops of a control's surface at the current trim (`surfacemap`).

        The aircraft cannot be used afterwards: some frames are flown, without wrappers.
        """
        return stops_found(self._unled, self.motion, self._controls, control)

    def names(self) -> list[str]:
        """Return the names of all of the model's properties."""
        return list(self._catalog)

    def has(self, name: str) -> bool:
        """Return whether the model has a property."""
        return name in self._catalog

    def lever(self, name: str, file: object = None, key: str = "model") -> Lever:
        """Return a property that may be set in flight; faults name a key of a file."""
        file = self._file if file is None else file
        if name.startswith(("simulation/", "ic/")):
            raise InputError(file, key, f"{name} is not the aircraft's; it is not set in flight")
        if "W" not in self._catalog.get(name, "W"):
            raise InputError(file, key, f"{self._flight.model} does not let {name} be set")
        node = self._node(name, key, file)
        return Lever(node.set_double_value, node.get_double_value)

    def reader(self, name: str) -> Callable[[], float] | None:
        """Return a function that reads a property, in JSBSim's unit; None if it does not exist."""
        node: Any = self._properties.get_node(name) if self.has(name) else None
        return None if node is None else cast(Read, node.get_double_value)

    def set_gust(self, up_m_per_s: float) -> None:
        """Set a gust's upward speed from the next step on, in addition to any wind."""
        self._fdm[GUST_DOWN] = -up_m_per_s / FOOT_m

    def plain_frames(self, placed: Placed) -> PlainFrames | None:
        """Return the fast loop of rig and aircraft; None if wrappers act on the aircraft."""
        return None if self._plain is None else plain_frames(self._plain, placed)

    def plain_steps(self, halves: HalfFrames) -> PlainSteps | None:
        """Return the fast halves of a frame of rig and aircraft; None if wrappers act on it."""
        return None if self._plain is None else plain_steps(self._plain, halves)

    def extra(self) -> tuple[float, ...]:
        """Return the further properties, in JSBSim's units."""
        return tuple([read() for read in self._extra])

    def trouble(self) -> str:
        """Return why the flight must end, or an empty string."""
        height = self._height()
        if height > 0.0 and not any(touches() for touches in self._touching):
            return ""
        return "the state is not finite" if math.isnan(height) else "the aircraft met the ground"
