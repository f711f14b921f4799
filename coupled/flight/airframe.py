"""The aircraft: the only module that knows JSBSim.

An `Airframe` is trimmed level, takes the commands of elevator, aileron and rudder
(about trim, ±1 for the whole travel) and gives the motion. It opens no socket,
writes no file and prints nothing: a model's own inputs and outputs are disabled
before they start, and JSBSim's log is kept to be quoted where something fails.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import jsbsim

from coupled.channels import MOTION
from coupled.errors import InputError, nearest
from coupled.rig.parameters import SURFACES, Flight
from coupled.units import FOOT_m, KNOT_m_per_s, PSF_Pa

_COMMANDS = {name: f"fcs/{name}-cmd-norm" for name in SURFACES.values()}

# Each motion channel: JSBSim's property, and the factor to SI.
_MOTION = {
    "dynamic_pressure_Pa": ("aero/qbar-psf", PSF_Pa),
    "load_factor": ("accelerations/Nz", 1.0),
    "elevator_rad": ("fcs/elevator-pos-rad", 1.0),
    "pitch_rate_rad_per_s": ("velocities/q-rad_sec", 1.0),
    "alpha_rad": ("aero/alpha-rad", 1.0),
    "pitch_rad": ("attitude/theta-rad", 1.0),
    "true_airspeed_m_per_s": ("velocities/vt-fps", FOOT_m),
    "altitude_m": ("position/h-sl-ft", FOOT_m),
    "aileron_rad": ("fcs/left-aileron-pos-rad", 1.0),
    "rudder_rad": ("fcs/rudder-pos-rad", 1.0),
    "roll_rate_rad_per_s": ("velocities/p-rad_sec", 1.0),
    "yaw_rate_rad_per_s": ("velocities/r-rad_sec", 1.0),
    "sideslip_rad": ("aero/beta-rad", 1.0),
    "roll_rad": ("attitude/phi-rad", 1.0),
    "heading_rad": ("attitude/psi-rad", 1.0),
}
_HEIGHT = "position/h-agl-ft"


class Airframe(Protocol):
    """What the frame loop flies: an aircraft, or a bench that only tells q̄."""

    def motion(self) -> tuple[float, ...]:
        """Return the motion's channels as they are now, q̄ in Pa and load factor first."""

    def step(self, commands: tuple[float, float, float]) -> None:
        """Run one frame with these commands about trim, one a control of the rig."""

    def trouble(self) -> str:
        """Return why the flight cannot go on, or an empty string."""

    def extra(self) -> tuple[float, ...]:
        """Return the further properties that a run asked for."""


class _Log(jsbsim.FGLogger):
    """Keeps what JSBSim says, and prints none of it."""

    def __init__(self) -> None:
        super().__init__()
        self.text = ""

    def set_level(self, level: Any) -> None:
        """Begin a message."""

    def file_location(self, filename: str, line: int) -> None:
        """Take the place that the message is about."""

    def message(self, message: str) -> None:
        """Take a piece of the message."""
        self.text = (self.text + message)[-2000:]

    def format(self, format: Any) -> None:
        """Take the colour of what follows."""

    def flush(self) -> None:
        """End a message."""


_log = _Log()
_base: Callable[[], Any] = jsbsim.FGJSBBase  # its debug level is the library's


def packaged_models() -> dict[str, Path]:
    """Return the models that come with JSBSim: {name: folder of all models}."""
    root = Path(jsbsim.get_default_root_dir()) / "aircraft"
    return {folder.name: root for folder in root.iterdir() if _is_model(folder)}


def _is_model(folder: Path) -> bool:
    return (folder / f"{folder.name}.xml").is_file()


class JSBSimAirframe:
    """A JSBSim model, trimmed level at the rig's altitude and calibrated airspeed.

    Parameters: the rig's `flight` section; `frame_s` in seconds; `controls`, those of
    the rig in its order; `models`, folders of models of our own, searched first; `file`,
    where the rig was described, for faults; `record`, further properties to read each
    frame, asked for in `record_file`.
    """

    def __init__(
        self,
        flight: Flight,
        frame_s: float,
        controls: Sequence[str] = ("column",),
        models: Sequence[Path] = (),
        file: object = "rig",
        record: Sequence[str] = (),
        record_file: object = "run",
    ) -> None:
        self._file, self._record_file = file, record_file
        self._flight = flight
        self._steps = flight.steps_per_frame
        self._fdm = self._load(models, frame_s)
        self._trim()
        self._run = self._fdm.run
        self._reads = [(self._node(name).get_double_value, k) for name, k in _MOTION.values()]
        self._height = self._node(_HEIGHT).get_double_value
        self._extra = [self._node(name, "record_properties").get_double_value for name in record]
        self._writes = []
        for control in controls:
            node = self._node(_COMMANDS[SURFACES[control]])
            self._writes.append((node.set_double_value, node.get_double_value()))

    def _fault(self, key: str, problem: str) -> InputError:
        return InputError(self._file, f"flight.{key}" if key else "flight", problem)

    def _load(self, models: Sequence[Path], frame_s: float) -> Any:
        _base().debug_lvl = 0
        jsbsim.set_logger(_log)
        known = packaged_models()
        for folder in reversed(models):
            known |= {m.name: folder for m in folder.iterdir() if _is_model(m)}
        name = self._flight.model
        if name not in known:
            raise self._fault("model", f"there is no JSBSim model {name!r}; {nearest(name, known)}")
        fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
        fdm.set_aircraft_path(str(known[name]))
        _log.text = ""
        try:
            loaded = fdm.load_model(name)
        except (RuntimeError, jsbsim.BaseError) as error:
            raise self._fault("model", f"{name} does not load: {error}") from None
        if not loaded:
            raise self._fault("model", f"{name} does not load: {_log.text.strip()[-200:]}")
        fdm.disable_input()
        fdm.disable_output()
        fdm.set_dt(frame_s / self._steps)
        self._properties = fdm.get_property_manager()
        return fdm

    def _node(self, name: str, key: str = "model") -> Any:
        node = self._properties.get_node(name)
        if node is None:
            problem = f"{self._flight.model} has no property {name!r}"
            if key == "model":
                raise self._fault(key, problem + ", so it cannot be flown by its controls")
            raise InputError(self._record_file, key, problem + "; none is created")
        return node

    def _trim(self) -> None:
        fdm, flight = self._fdm, self._flight
        fdm["ic/h-sl-ft"] = flight.altitude / FOOT_m
        fdm["ic/vc-kts"] = flight.calibrated_airspeed / KNOT_m_per_s
        fdm["ic/gamma-deg"] = 0.0
        fdm["propulsion/set-running"] = -1
        for engine in range(fdm.get_propulsion().get_num_engines()):
            for lever in ("mixture", "advance"):
                node = self._properties.get_node(f"fcs/{lever}-cmd-norm[{engine}]")
                if node is not None:
                    node.set_double_value(1.0)
        for name, value in flight.properties.items():
            node = self._properties.get_node(name)
            if node is None:
                raise self._fault(
                    f"properties.{name}", f"{flight.model} has no such property; none is created"
                )
            node.set_double_value(value)
        _log.text = ""
        where = (
            f"{flight.model} does not trim level at altitude_m = {flight.altitude:g},"
            f" calibrated_airspeed_m_per_s = {flight.calibrated_airspeed:g}"
        )
        try:
            started = fdm.run_ic()
            if started:
                fdm["simulation/do_simple_trim"] = 1
        except (RuntimeError, jsbsim.BaseError):
            raise self._fault("calibrated_airspeed_m_per_s", where + "; choose others") from None
        if not started or not math.isfinite(fdm["aero/alpha-rad"]):
            raise self._fault("model", f"{flight.model} does not start: {_log.text.strip()[-200:]}")

    def motion(self) -> tuple[float, ...]:
        """Return the motion now, in the order of `channels.MOTION`, SI."""
        return tuple([read() * factor for read, factor in self._reads])

    def extra(self) -> tuple[float, ...]:
        """Return the further properties, in JSBSim's units."""
        return tuple([read() for read in self._extra])

    def step(self, commands: tuple[float, float, float]) -> None:
        """Run one frame with these commands about trim, one a control of the rig."""
        for (write, trim), command in zip(self._writes, commands, strict=False):
            write(trim + command)
        for _ in range(self._steps):
            self._run()

    def trouble(self) -> str:
        """Return why the flight cannot go on, or an empty string."""
        height = self._height()
        if height > 0.0:
            return ""
        return "the state is not finite" if math.isnan(height) else "the aircraft met the ground"


class Bench:
    """No aircraft: the dynamic pressure that the host is told, from a schedule in time."""

    def __init__(self, frame_s: float, pressures_Pa: Sequence[tuple[float, float]]) -> None:
        self._frame_s = frame_s
        self._points = list(pressures_Pa)
        self._k = 0

    def motion(self) -> tuple[float, ...]:
        """Return q̄ in Pa and a load factor of one."""
        time = self._k * self._frame_s
        points = self._points
        if time <= points[0][0]:
            return (points[0][1], 1.0)
        for (t0, q0), (t1, q1) in pairwise(points):
            if time < t1:
                return (q0 + (q1 - q0) * (time - t0) / (t1 - t0), 1.0)
        return (points[-1][1], 1.0)

    def extra(self) -> tuple[float, ...]:
        """Return nothing: a bench has no properties."""
        return ()

    def step(self, commands: tuple[float, float, float]) -> None:
        """Go to the next frame."""
        self._k += 1

    def trouble(self) -> str:
        """Return nothing: a bench has no trouble."""
        return ""


def check_direct_controls(
    flight: Flight, frame_s: float, controls: Sequence[str], **where: Any
) -> Mapping[str, float]:
    """Fly a small step of each control on an aircraft of its own, and refuse what is not direct.

    Direct means: within one step the surface stands at its new place, stays there, and the
    aircraft turns to the side that the rig's signs say. Returns {control: surface travel in
    rad per unit of command}.
    """
    rates = {"column": "pitch_rate_rad_per_s", "wheel": "roll_rate_rad_per_s"}
    travel = {}
    for i, control in enumerate(controls):
        surface = SURFACES[control]
        still = JSBSimAirframe(flight, frame_s, controls, **where)
        moved = JSBSimAirframe(flight, frame_s, controls, **where)
        step = 0.05 if control == "wheel" else -0.05  # positive force of the pilot
        commands = (step * (i == 0), step * (i == 1), step * (i == 2))
        at = MOTION.index(f"{surface}_rad")
        turn = MOTION.index(rates.get(control, "yaw_rate_rad_per_s"))
        positions, rate = [], 0.0
        for _ in range(max(2, round(0.1 / frame_s))):
            still.step((0.0, 0.0, 0.0))
            moved.step(commands)
            positions.append(moved.motion()[at] - still.motion()[at])
            rate = moved.motion()[turn] - still.motion()[turn]
        first, last = positions[0], positions[-1]
        fault = ""
        if not math.isfinite(first) or abs(first) < 1e-4:
            fault = f"does not move its {surface} at once"
        elif abs(last - first) > 0.25 * abs(first):
            fault = f"moves its {surface} by more than the command (a control law or a lag)"
        elif rate <= 0.0:
            fault = f"turns the wrong way on a positive {control}"
        if fault:
            raise InputError(
                where.get("file", "rig"),
                "flight.model",
                f"{flight.model} has no direct controls: it {fault};"
                " c172p, T37, 737 and B747 fly with theirs",
            )
        travel[control] = first / step
    return travel
