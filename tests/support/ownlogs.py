"""Logs of bare JSBSim, of models edited by hand, and logs in FlightGear's format.

`python -m tests.support.ownlogs` writes the log of the guide, tests/data/JSBout.csv.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import jsbsim
import numpy as np
from numpy.typing import NDArray

from coupled.units import FOOT_m, KNOT_m_per_s
from tests.support.models import edited_model, multiplied

Floats = NDArray[np.float64]
RATE_Hz = 120.0
DIRECTIVE = """<?xml version="1.0"?>
<output name="JSBout.csv" type="CSV" rate="{rate}">{properties}</output>"""
PROPERTIES = (
    "fcs/elevator-pos-rad",
    "fcs/left-aileron-pos-rad",
    "fcs/rudder-pos-rad",
    "velocities/p-rad_sec",
    "velocities/q-rad_sec",
    "velocities/r-rad_sec",
    "aero/alpha-rad",
    "aero/beta-rad",
    "attitude/theta-rad",
    "attitude/phi-rad",
    "accelerations/Nz",
    "velocities/vt-fps",
    "position/h-sl-ft",
)
OF_THE_GUIDE = (
    *("fcs/elevator-pos-rad", "velocities/q-rad_sec", "aero/alpha-rad"),
    *("accelerations/Nz", "velocities/vt-fps", "position/h-sl-ft"),
)
# FlightGear's names of some of them, with the factor from JSBSim's unit.
_DEG = 180.0 / np.pi
FLIGHTGEAR = {
    "velocities/p-rad_sec": ("/orientation/p-body", 1.0),
    "velocities/q-rad_sec": ("/orientation/q-body", 1.0),
    "velocities/r-rad_sec": ("/orientation/r-body", 1.0),
    "aero/alpha-rad": ("/orientation/alpha-deg", _DEG),
    "aero/beta-rad": ("/orientation/side-slip-deg", _DEG),
    "attitude/theta-rad": ("/orientation/pitch-deg", _DEG),
    "attitude/phi-rad": ("/orientation/roll-deg", _DEG),
    "position/h-sl-ft": ("/position/altitude-ft", 1.0),
}


def manoeuvre(length_s: float, size: float = 0.12, by_hand: bool = True) -> Floats:
    """Return commands of elevator, aileron and rudder about trim, shape (frames, 3).

    A 3-2-1-1 and doublets of the elevator, and doublets of the others. Those that are not `by_hand`
    jump within a step.
    """
    t = np.arange(round(length_s * RATE_Hz)) / RATE_Hz
    asked = np.zeros((len(t), 3))

    def hold(control: int, start: float, length: float, share: float) -> None:
        asked[(t >= start) & (t < start + length), control] += share * size

    for start, length, share in ((1.0, 0.9, 1.0), (1.9, 0.6, -1.0), (2.5, 0.3, 1.0)):
        hold(0, start, length, share)
    hold(0, 2.8, 0.3, -1.0)
    for i, at in enumerate(np.arange(5.0, length_s - 4.0, 3.5)):
        control = (1, 2, 0)[i % 3]
        hold(control, at, 0.5, 1.0)
        hold(control, at + 0.5, 0.5, -1.0)
    if not by_hand:
        return asked
    hand = np.hanning(25) / np.sum(np.hanning(25))  # a hand needs a tenth of a second
    return np.column_stack([np.convolve(each, hand, mode="same") for each in asked.T])


def flown(
    folder: Path,
    factors: Mapping[str, float],
    length_s: float = 20.0,
    model: str = "c172p",
    rate_Hz: float = RATE_Hz,
    properties: Sequence[str] = PROPERTIES,
    controls: int = 3,
    heading_deg: float = 0.0,
    by_hand: bool = True,
    fuel: float = 1.0,
    levers: Mapping[str, Callable[[float], float]] | None = None,
    before: Mapping[str, float] | None = None,
    each: int = 1,
) -> tuple[Path, Floats]:
    """Fly an edited copy of a model from trim in bare JSBSim, with its own CSV output.

    `factors` are on functions by the ends of their names, `controls` how many of elevator, aileron
    and rudder move, `by_hand` or in jumps, `fuel` in two tanks, of the model's. `levers` are
    properties by what is added to their positions in trim at a time in s, `before` are properties
    set before the trim. The commands change every `each` frames. Returns the CSV file, and the
    properties at each frame, shape (frames, properties).
    """
    models = edited_model(folder / "edited", model, multiplied(factors))
    listed = "".join(f"<property>{name}</property>" for name in properties)
    (folder / "out.xml").write_text(DIRECTIVE.format(rate=rate_Hz, properties=listed))
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_debug_level(0)
    fdm.set_aircraft_path(str(models))
    fdm.load_model(model)
    fdm.set_dt(1.0 / RATE_Hz)
    fdm["ic/vc-kts"], fdm["ic/h-sl-ft"] = 52.0 / KNOT_m_per_s, 1200.0 / FOOT_m
    fdm["ic/psi-true-deg"] = heading_deg
    for tank in (0, 1) if fuel != 1.0 else ():
        fdm[f"propulsion/tank[{tank}]/contents-lbs"] *= fuel
    for name, value in (before or {}).items():
        fdm[name] = value
    fdm["propulsion/set-running"] = -1
    fdm["fcs/mixture-cmd-norm"] = 1.0
    fdm.set_output_path(str(folder))
    fdm.set_output_directive(str(folder / "out.xml"))
    fdm.run_ic()
    fdm["simulation/do_simple_trim"] = 1
    names = [f"fcs/{name}-cmd-norm" for name in ("elevator", "aileron", "rudder")]
    trim, rows = [fdm[name] for name in names], []
    begun = {name: (fdm[name], added) for name, added in (levers or {}).items()}
    commands = manoeuvre(length_s, by_hand=by_hand)[:, :controls]
    for k, asked in enumerate(np.repeat(commands[::each], each, axis=0)):
        rows.append([fdm[name] for name in properties])
        for name, held, moved in zip(names, trim, asked.tolist(), strict=False):
            fdm[name] = held + moved
        for name, (held, added) in begun.items():
            fdm[name] = held + added(k / RATE_Hz)
        fdm.run()
    del fdm  # closes its file
    (log,) = folder.glob("*.csv")
    return log, np.array(rows)


def flightgear_log(file: Path, rows: Floats, every: int = 2) -> Path:
    """Write properties at JSBSim's frames as FlightGear's logger does: times, property paths."""
    names, factors = ["Time"], [1.0]
    for name in PROPERTIES:
        path, factor = FLIGHTGEAR.get(name, (f"/fdm/jsbsim/{name}", 1.0))
        names.append(path)
        factors.append(factor)
    times = 31.0 + np.arange(len(rows)) / RATE_Hz
    table = (np.column_stack([times, rows]) * factors)[::every]
    lines = [",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in table)]
    file.write_text("\n".join(lines) + "\n")
    return file


def main() -> None:
    """Write the log of the guide: a Cessna 172P with C_mq × 0.7."""
    with tempfile.TemporaryDirectory() as folder:
        (made, _) = flown(Path(folder), {"/Cmq": 0.7}, 16.0, "c172p", 30.0, OF_THE_GUIDE, 1)
        target = Path(__file__).parents[1] / "data" / "JSBout.csv"
        target.write_bytes(made.read_bytes())


if __name__ == "__main__":
    main()
