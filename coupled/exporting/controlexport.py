"""The common data of the stages of one exported control: rig, system, and time steps.

A run of JSBSim takes one step of dt. The loader takes `substeps` of h = dt/substeps within it, each
a set of components of its own, since JSBSim runs components in the order of the file and has no
loop. A host slower than JSBSim acts at every `steps`-th run, and holds its outputs in between.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from coupled.exporting.expression import Expr, Value, either, equal, exponential, prop
from coupled.exporting.system import System
from coupled.record.channels import SURFACES, ControlName, unit_of
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.surface import COMMAND_SIGN

DT = prop("simulation/dt")
STILL_s = 1e-6  # the loader's step in a run of zero time, as in JSBSim's trim


@dataclass(frozen=True)
class ControlExport:
    """One control during its export.

    `substeps` of the loader in a run of JSBSim, `steps` of JSBSim in a frame of the host.
    """

    rig: Rig
    name: ControlName
    substeps: int
    system: System = field(init=False)

    def __post_init__(self) -> None:
        system = System(f"coupled {self.name}", f"coupled/{self.name}")
        object.__setattr__(self, "system", system)

    @property
    def control(self) -> Control:
        """The control's section of the rig."""
        return self.rig.controls[self.name]

    @property
    def d(self) -> str:
        """The unit of its deflection."""
        return unit_of(self.name)

    @property
    def steps(self) -> int:
        """The number of runs of JSBSim in a frame of the host."""
        return self.rig.flight.steps_per_frame if self.rig.flight is not None else 1

    @property
    def command(self) -> str:
        """JSBSim's property that moves the surface."""
        given = self.control.properties.command
        return given[0] if given else f"fcs/{SURFACES[self.name]}-cmd-norm"

    @property
    def sign(self) -> float:
        """JSBSim's sign of a command for a positive force."""
        return COMMAND_SIGN[self.control.surface]

    def own(self, name: str) -> Expr:
        """Return a component's value, of the last run if it comes later in the file."""
        return self.system.own(name)

    def kept(self, name: str) -> Expr:
        """Return a component's value of the last run, 0 in the first after a start."""
        return self.own("live") * self.own(name)

    def add_at_frame(self, name: str, value: Value, says: str = "", out: str = "") -> Expr:
        """Add a component that the host sets at its frames, and holds in between."""
        if self.steps > 1:
            value = either(equal(self.own("clock"), 0.0), value, self.own(name))
        return self.system.add(name, value, says, out=out)

    def frame_gain(self, lag_s: float) -> Expr:
        """Return the step response of a first-order lag after a frame of the host."""
        return 1.0 - exponential(-(self.steps / lag_s) * DT)


def add_clock(made: ControlExport) -> None:
    """Add the time steps: whether JSBSim steps, the loader's step, the host's frame."""
    system = made.system
    system.channel("time", "A run of zero time (JSBSim's start and trim) resets all.")
    system.add("live", either(stepping(), own_started(made), 0.0), "1 from the second step on")
    system.add("started", stepping(), "1 from the first step on")
    step = either(made.own("live"), DT / float(made.substeps), STILL_s)
    system.add("step-s", step, f"h, the loader's step: {made.substeps} in a run")
    if made.steps > 1:
        count = made.own("clock") + 1.0
        turn = either(equal(count, float(made.steps)), 0.0, count)
        system.add("clock", either(made.own("live"), turn, 0.0), "runs since the host's frame")


def stepping() -> Expr:
    """Return 1 if JSBSim's time advances, 0 during its start or trim."""
    return Expr("gt", (DT, Expr("v", text="0.0")))


def own_started(made: ControlExport) -> Expr:
    """Return whether the run before stepped."""
    return made.own("started")
