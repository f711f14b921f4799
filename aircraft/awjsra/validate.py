"""Published against flown: print the first tables of validation.md beside this file.

    python aircraft/awjsra/validate.py

The aircraft is trimmed as its rig file says, in the published approach, and linearised by JSBSim
itself; what JSBSim does not linearise (nozzles, thrust instead of throttle) is found by finite
differences. One root and the spring tab's rows come from flights in time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import jsbsim
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals

from coupled.flight.newton import newton_trim
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.units import FOOT_m, KNOT_m_per_s, POUND_PER_INCH_N_per_m, PSF_Pa

HERE = Path(__file__).parent
RIG = HERE / "awjsra.toml"
Floats = NDArray[np.float64]
GRAVITY = 32.174  # ft/s²
FRAME_s = 1 / 120
SEA_LEVEL_kg_per_m3 = 1.225
TRAVEL_in = 7.0
FORCE_PER_G_lb = 57.2  # published, like all in `Row.published`
NOZZLE_FORCE_lb_per_deg = 0.21
SPRING_TAB = {5.0: 0.86, 12.2: 0.80, 33.8: 0.65, 100.0: 0.42}  # q̄ in lb/ft²: its steady ratio
LEVERS = ("fcs/throttle-cmd-norm[0]", "fcs/throttle-cmd-norm[1]")


def trimmed(rig: Rig, estimates: dict[str, float] | None = None) -> jsbsim.FGFDMExec:
    """Return JSBSim with the aircraft trimmed as the rig says, some of its estimates changed."""
    base: Callable[[], Any] = jsbsim.FGJSBBase  # its debug level is the library's
    base().debug_lvl = 0
    flight = rig.flight
    assert flight is not None
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_aircraft_path(str(HERE.parent))
    fdm.load_model(flight.model)
    fdm.set_dt(FRAME_s)
    fdm["ic/h-sl-ft"] = flight.altitude / FOOT_m
    fdm["propulsion/set-running"] = -1
    for name, value in {**flight.properties, **(estimates or {})}.items():
        fdm[name] = value
    problem = newton_trim(fdm, flight)
    if problem:
        raise RuntimeError(problem)
    return fdm


@dataclass
class Derivatives:
    """Body-axis accelerations per lever: (X, Z, M) in ft/s² and rad/s²."""

    thrust_per_lb: Floats
    nozzle_per_deg: Floats
    column_per_in: Floats


def derivatives(fdm: jsbsim.FGFDMExec) -> Derivatives:
    """Return what thrust, nozzles and column do at once, by central differences in trim."""
    fdm.set_trim_status(True)  # levers stand where they are put

    def around(names: tuple[str, ...], step: float) -> tuple[Floats, float]:
        found, thrust = [], []
        start = fdm[names[0]]
        for value in (start + step, start - step, start):
            for name in names:
                fdm[name] = value
            for _ in range(3):
                fdm.run_ic()
            accelerations = (fdm["accelerations/udot-ft_sec2"], fdm["accelerations/wdot-ft_sec2"])
            found.append(np.array([*accelerations, fdm["accelerations/qdot-rad_sec2"]]))
            thrust.append(fdm["aero/hot-thrust-lbs"])
        return (found[0] - found[1]) / (2 * step), (thrust[0] - thrust[1]) / (2 * step)

    lever, thrust_per_lever = around(LEVERS, 0.005)
    nozzle, _ = around(("fcs/nozzle-cmd-deg",), 0.2)
    elevator, _ = around(("fcs/elevator-cmd-norm",), 0.01)
    fdm.set_trim_status(False)
    return Derivatives(lever / thrust_per_lever, nozzle, -elevator / TRAVEL_in)


@dataclass
class Linear:
    """JSBSim's linear model in speed, angle of attack, pitch and pitch rate; one column, 1/in.

    Units: ft/s, rad, rad, rad/s. `roots` in the order short period (quick, slow), phugoid.
    """

    a: Floats
    b: Floats
    path_rad: float
    speed: float
    roots: list[complex] = field(init=False)

    def __post_init__(self) -> None:
        found = sorted(np.linalg.eigvals(self.a), key=lambda root: (-abs(root), -root.imag))
        self.roots = [complex(root) for root in found]

    @property
    def path(self) -> Floats:
        """The row that gives the path's angle."""
        return np.array([0.0, -1.0, 1.0, 0.0])

    def zeros(self, row: Floats) -> Floats:
        """Return the numerator's roots from the column to an output, the slow ones first."""
        matrix = np.block([[self.a, self.b[:, None]], [row[None, :], np.zeros((1, 1))]])
        ones = np.diag([1.0, 1.0, 1.0, 1.0, 0.0])
        found = eigvals(matrix, ones)
        found = found[np.isfinite(found) & (np.abs(found) < 1e4)].real
        return np.asarray(found[np.argsort(np.abs(found))])

    def steady(self) -> Floats:
        """Return the steady state per inch of column."""
        return np.asarray(np.linalg.solve(self.a, -self.b))


def linear(fdm: jsbsim.FGFDMExec) -> Linear:
    """Return JSBSim's linearisation; spends the aircraft."""
    path, speed = fdm["flight-path/gamma-rad"], fdm["velocities/vt-fps"]
    model = jsbsim.FGLinearization(fdm)
    at = [model.x_names.index(name) for name in ("Vt", "Alpha", "Theta", "Q")]
    a = np.asarray(model.system_matrix)[np.ix_(at, at)]
    b = np.asarray(model.input_matrix)[at, model.u_names.index("DeCmd")]
    return Linear(a, -b / TRAVEL_in, path, speed)


def flown(rig: Rig, inches: float, seconds: float, pull_s: float) -> Floats:
    """Return the states of `Linear`, and the load factor, of a pull flown in time."""
    fdm = trimmed(rig)
    names = ["velocities/vt-fps", "aero/alpha-rad", "attitude/theta-rad", "velocities/q-rad_sec"]
    names.append("accelerations/Nz")
    trim, found = fdm["fcs/elevator-cmd-norm"], []
    for k in range(round(seconds / FRAME_s)):
        fdm["fcs/elevator-cmd-norm"] = trim - (inches / TRAVEL_in if k * FRAME_s < pull_s else 0.0)
        fdm.run()
        found.append([fdm[name] for name in names])
    return np.array(found)


def flown_root(rig: Rig) -> float:
    """Return the slow short-period root as a flight in time shows it, 1/s.

    A pull of a second less a push, which leaves out what both share. Afterwards each sample of
    the four states follows from the one before by the same matrix; a least-squares fit finds
    it, and its real roots are the short period's.
    """
    pull, push = (flown(rig, inches, 11.0, 1.0)[:, :4] for inches in (0.5, -0.5))
    every = 12
    states = (pull - push)[round(1.2 / FRAME_s) :: every] / [1.0, 0.01, 0.01, 0.01]
    change = np.linalg.lstsq(states[:-1], states[1:], rcond=None)[0].T
    roots = np.log(np.linalg.eigvals(change).astype(complex)) / (every * FRAME_s)
    return float(min(-root.real for root in roots if abs(root.imag) < 1e-6))


Basis = Literal["fit", "gradient", "roots", "geometry", "equation"]


@dataclass(frozen=True)
class Row:
    """A figure: published, flown, the aim, and what the flown one rests on.

    `rests_on` is `fit` where the model's estimates were fitted to it; `gradient` where the rig's
    gradient was chosen for it, or enters with a fitted figure; `roots` where the gradient is that
    of `gradient_of_the_roots` instead, which nothing was chosen for; `geometry` where it follows
    from published thrust, weight, inertia and thrust line; `equation` where the model carries out
    a published equation.
    """

    what: str
    published: float
    flown: float
    aim: float
    rests_on: Basis

    @property
    def off(self) -> float:
        """Flown over published, less one."""
        return self.flown / self.published - 1.0

    @property
    def met(self) -> bool:
        """Whether it is off by no more than the aim."""
        return abs(self.off) <= self.aim


def gradient_of_the_roots() -> float:
    """Return the column's gradient that published roots and force per g give together, lb/in.

    g per inch is V/g·(M per inch)·(high numerator root)/(product of the short-period roots), all
    published; at 60 kt, as published, whether true or indicated.
    """
    speed = 60.0 * KNOT_m_per_s / FOOT_m
    return FORCE_PER_G_lb * speed / GRAVITY * 0.0425 * 0.37 / (1.2 * 0.62)


def rows(rig: Rig, estimates: dict[str, float] | None = None) -> Iterator[Row]:
    """Yield the table's rows that need no flight in time."""
    fdm = trimmed(rig, estimates)
    thrust, pounds = fdm["aero/hot-thrust-lbs"], column_gradient(rig, fdm)
    by_roots = gradient_of_the_roots()
    moves = derivatives(fdm)
    model = linear(fdm)
    quick, slow, phugoid, _ = model.roots
    yield Row("short-period root, quick, rad/s", 1.2, -quick.real, 0.1, "fit")
    yield Row("short-period root, slow, rad/s", 0.62, -slow.real, 0.1, "fit")
    yield Row("phugoid frequency, rad/s", 0.22, abs(phugoid), 0.1, "fit")
    yield Row("phugoid damping ratio", 0.15, -phugoid.real / abs(phugoid), 0.1, "fit")
    low, high = -model.zeros(np.array([0.0, 0.0, 1.0, 0.0]))[:2]
    yield Row("pitch numerator root, low, rad/s", 0.18, low, 0.1, "fit")
    yield Row("pitch numerator root, high, rad/s", 0.37, high, 0.1, "fit")
    per_inch = float(moves.column_per_in[2])
    yield Row("pitch acceleration per inch of column, rad/s²", 0.0425, per_inch, 0.1, "fit")
    load = model.speed / GRAVITY * per_inch * high / (quick * slow).real
    what = f"column force per g, lb, at {pounds:.2f} lb/in, chosen for it"
    yield Row(what, FORCE_PER_G_lb, pounds / load, 0.1, "gradient")
    what = f"column force per g, lb, at {by_roots:.1f} lb/in, as the published roots give"
    yield Row(what, FORCE_PER_G_lb, by_roots / load, 0.1, "roots")
    yield Row("path numerator root 1/Th1, rad/s", 0.06, model.zeros(model.path)[0], 0.25, "fit")
    steady = model.steady()
    yield Row("steady γ per θ", -0.43, float(model.path @ steady / steady[2]), 0.25, "fit")
    knots = steady[0] * FOOT_m / KNOT_m_per_s * math.radians(1.0) / steady[2]
    yield Row("steady V per θ, kt/deg", -2.5, float(knots), 0.25, "fit")
    yield Row("hot thrust in trim, lb", 7160.0, thrust, 0.25, "fit")
    x, z, m = moves.thrust_per_lb
    yield Row("Z per pound of hot thrust, ft/s²", -0.0018, float(z), 0.25, "fit")
    yield Row("its X/Z", 0.0164, float(x / z), 0.25, "fit")
    yield Row("its M/Z, rad/ft", 0.0008, float(m / z), 0.25, "fit")
    x, z, m = moves.nozzle_per_deg
    yield Row("X per degree of nozzle, ft/s²", -0.094, float(x), 0.25, "geometry")
    yield Row("its Z/X", 0.0424, float(z / x), 0.25, "geometry")
    yield Row("its M/X, rad/ft", 0.0153, float(m / x), 0.25, "geometry")
    inches = -float(m) / per_inch
    nozzle = "column force to balance a nozzle change, lb/deg"
    what = f"{nozzle}, at {pounds:.2f} lb/in"
    yield Row(what, NOZZLE_FORCE_lb_per_deg, pounds * inches, 0.25, "gradient")
    what = f"{nozzle}, at {by_roots:.1f} lb/in"
    yield Row(what, NOZZLE_FORCE_lb_per_deg, by_roots * inches, 0.25, "roots")


def tab_rows(rig: Rig) -> Iterator[Row]:
    """Yield the spring tab's steady ratio of elevator to command, two seconds after a step.

    At 5 lb/ft² the aircraft does not trim; the ratio is that at which the tab comes to rest there.
    """
    assert rig.flight is not None
    clean = {"fcs/flap-cmd-norm": 0.0, "fcs/nozzle-cmd-deg": 18.5, "gear/gear-cmd-norm": 0.0}
    for pressure, ratio in SPRING_TAB.items():
        knots = math.sqrt(2.0 * pressure * PSF_Pa / SEA_LEVEL_kg_per_m3) / KNOT_m_per_s
        changes: dict[str, Any] = {"flight.properties.fcs/spring-tab-on": 1.0}
        if knots > 80.0:
            changes["flight.calibrated_airspeed_m_per_s"] = knots * KNOT_m_per_s
            changes["flight.flight_path_rad"] = 0.0
            changes |= {f"flight.properties.{name}": value for name, value in clean.items()}
        fdm = trimmed(rig.changed(changes))
        if knots < 50.0:
            fdm.set_trim_status(True)
            fdm["ic/vc-kts"] = knots
            fdm.run_ic()
        else:
            fdm["fcs/elevator-cmd-norm"] -= 0.05
            for _ in range(round(2.0 / FRAME_s)):
                fdm.run()
        flown_ratio = fdm["fcs/elevator-pos-rad"] / fdm["fcs/tab-command-rad"]
        what = f"spring tab's steady ratio at {pressure:g} lb/ft²"
        yield Row(what, ratio, flown_ratio, 0.1, "equation")


def column_gradient(rig: Rig, fdm: jsbsim.FGFDMExec) -> float:
    """Return the column's gradient at the aircraft's dynamic pressure, lb/in."""
    schedule, pressure = rig.controls["column"].schedule, fdm["aero/qbar-psf"] * PSF_Pa
    gradient = float(np.interp(pressure, schedule.dynamic_pressure, schedule.total_gradient))
    return gradient / POUND_PER_INCH_N_per_m


def table(found: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    lines = ["| | published | flown | off | aim | by |", "| --- | --- | --- | --- | --- | --- |"]
    for row in found:
        met = "" if row.met else ", **missed**"
        value = f"{row.flown:.0f}" if abs(row.flown) >= 1000 else f"{row.flown:.3g}"
        lines.append(
            f"| {row.what} | {row.published:g} | {value} | {round(100 * row.off) or 0:+d} %"
            f" | {100 * row.aim:.0f} % | {row.rests_on}{met} |"
        )
    return "\n".join(lines)


def force_at_constant_speed(
    model: jsbsim.FGLinearization, gradient_lb_per_in: float, speed_fps: float
) -> float:
    """Return the column force per g of a steady pull at constant speed, lb."""
    a = np.asarray(model.system_matrix)
    b = -np.asarray(model.input_matrix)[:, model.u_names.index("DeCmd")] / TRAVEL_in
    pair = [model.x_names.index("Alpha"), model.x_names.index("Q")]
    turn = np.linalg.solve(a[np.ix_(pair, pair)], -b[pair])[1]
    return float(gradient_lb_per_in * GRAVITY / (turn * speed_fps))


def remarks(rig: Rig) -> str:
    """Return what is flown and was not published: other forces per g, the lateral modes."""
    fdm = trimmed(rig)
    pounds, speed = column_gradient(rig, fdm), fdm["velocities/vt-fps"]
    model = jsbsim.FGLinearization(fdm)
    states, a = model.x_names, np.asarray(model.system_matrix)
    steady_lb = force_at_constant_speed(model, pounds, speed)
    load = flown(rig, 1.0, 8.0, 8.0)[:, 4]
    sides = [states.index(name) for name in ("Beta", "Phi", "P", "R")]
    modes = np.linalg.eigvals(a[np.ix_(sides, sides)])
    swing = next(mode for mode in modes if mode.imag > 0.0)
    spiral, roll = sorted((m.real for m in modes if m.imag == 0.0), key=abs)
    return (
        f"Column force per g by other definitions: {steady_lb:.0f} lb at constant speed,"
        f" {pounds / (load.max() - load[0]):.0f} lb from the peak load factor after a step of 1 in."
        f" Lateral modes: Dutch roll {abs(swing):.2f} rad/s,"
        f" ζ {-swing.real / abs(swing):.2f}; roll {roll:.2f} 1/s; spiral {spiral:+.3f} 1/s."
    )


def account(rig: Rig, unfitted: list[Row]) -> str:
    """Return what the rows that were not fitted are worth, in sentences."""
    of = {basis: [row for row in unfitted if row.rests_on == basis] for basis in get_args(Basis)}
    fdm = trimmed(rig)
    chosen, by_roots = column_gradient(rig, fdm), gradient_of_the_roots()
    force, nozzle = of["roots"]
    # M of a degree of nozzle over M of an inch, as published and as flown
    published = NOZZLE_FORCE_lb_per_deg * 0.0425 / (0.094 * 0.0153)
    asked = by_roots * nozzle.published / nozzle.flown
    missed = sum(not row.met for row in of["roots"])
    return (
        f"{len(unfitted)} rows were not fitted: {len(of['geometry'])} follow from published"
        f" thrust, weight and thrust line, {len(of['equation'])} from a published equation, and"
        f" {len(of['gradient'])} from the chosen {chosen:.2f} lb/in and fitted figures. The"
        f" {len(of['roots'])} forces at {by_roots:.1f} lb/in also depend on fitted figures; they"
        f" differ by {100 * force.off:+.0f} % and {100 * nozzle.off:+.0f} %, {missed} by more than"
        f" the aim. No row tests the aerodynamics independently of the fit. The published forces"
        f" imply different gradients: the nozzles' {asked:.1f} lb/in with the model's moments and"
        f" {published:.1f} lb/in with the published ones, force per g {chosen:.2f} and"
        f" {by_roots:.1f}."
    )


def report() -> str:
    """Return the tables, fitted and not, and the remarks."""
    rig = read_rig(RIG)
    found = list(rows(rig))
    timed = Row("short-period root, slow, by a flight in time", 0.62, flown_root(rig), 0.1, "fit")
    found.insert(2, timed)
    fitted = [row for row in found if row.rests_on == "fit"]
    unfitted = [row for row in found if row.rests_on != "fit"] + list(tab_rows(rig))
    parts = [table(fitted), table(unfitted), account(rig, unfitted), remarks(rig)]
    return "\n\n".join(parts)


if __name__ == "__main__":
    print(report())
