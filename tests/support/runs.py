"""Run files for tests, and shipped runs made shorter."""

from __future__ import annotations

from dataclasses import replace

from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.runfile import read_run

# Two seconds on an aircraft.
SHORT = """
name = "short"
card = "A short pull."
rig = "report-column"
duration_s = 2.0
configurations = ["rigid", "compensated"]

[pilot.column]
kind = "step"
start_s = 0.2
force_N = 40.0
"""

# Two seconds on a bench.
PUSH = """
name = "push"
card = "A push on the bench."
rig = "bench"
duration_s = 2.0
configurations = ["rigid", "compensated"]

[bench]
time_s = [0.0]
dynamic_pressure_Pa = [3000.0]

[pilot.column]
kind = "ramp"
start_s = 0.5
force_N = 40.0
ramp_s = 1.0
"""


def shortened(run: str, controls: int, frames: int) -> Manoeuvre:
    """Return a shipped run with its first controls and a number of frames."""
    scenario = read_run(run)[0]
    names = list(scenario.rig.controls)[:controls]
    rig = scenario.rig.changed({"controls": {name: scenario.rig.controls[name] for name in names}})
    pilots = {name: pilot for name, pilot in scenario.pilots.items() if name in names}
    return replace(scenario, rig=rig, pilots=pilots, duration_s=frames / rig.frame_rate)
