"""Curves: laws of one signal that the library lacks are described, and nothing else is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from coupled.authority.heldcontrol import true_deflection
from coupled.blind.twin.twin import Twin
from coupled.gap.chain import Part
from coupled.gap.diagnose import findings
from coupled.gap.findings.curvefit import LAWS, Basis, choose, closed_form
from coupled.gap.findings.curves import response_to_force
from coupled.gap.findings.diagnosis import PartDiagnosis
from coupled.gap.findings.flown import fly_force
from coupled.gap.noise.smooth import smoothed
from coupled.gap.prepare import prepare
from coupled.gap.search.beam import search_sets
from coupled.gap.search.problem import ModelError
from coupled.gap.signals.output import Output
from coupled.gap.signals.reading import Sensed
from coupled.plots.curves import draw_curves
from coupled.plots.gapview import View
from coupled.record.record import Record, write_record
from coupled.rig.rigfile import read_rig
from coupled.tables.gaps import curve_table
from tests.support.commands import coupled
from tests.support.outside import RIG, Fault, curves_of, recorded

COLUMN = RIG.controls["column"]
TABLE = COLUMN.schedule
QUADRATIC = 150.0  # N·s²/m²
ENTRY, WRONG = 2, 1.1  # an entry of the schedule, and the factor by which it is off


def by_the_square(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    twin.set(quadratic_damping=QUADRATIC)


def reads_by_the_square(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    """Let the transducer at the grip read δ + 0.6·δ²."""
    twin.set(read_square=0.6)


def bends_unlike(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    """Bend more in a pull than in a push."""
    twin.set(bend_uneven=2e-5)


def wrong_entry(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    twin.numbers[0]["first"][ENTRY] = WRONG * TABLE.total_gradient[ENTRY]


def fades(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    twin.set(damping=COLUMN.loader.damping * (1.0 + 1.5 * np.exp(-time_s / 7.0)))


def jams(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    twin.set(damping=3000.0 if time_s % 7.0 > 6.0 else COLUMN.loader.damping)


def drifts(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    twin.set(basic_gradient=COLUMN.loader.basic_gradient * (1.0 + 0.008 * time_s))


def of_two_signals(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    """A force in proportion to the deflection times q̄."""
    twin.set(basic_gradient=COLUMN.loader.basic_gradient + 0.1 * pressure_Pa)


def healthy(twin: Twin, time_s: float, pressure_Pa: float) -> None:
    """Leave the twin as its rig is."""


def test_damping_by_the_square_of_the_speed_is_a_curve_over_the_rate() -> None:
    found = curves_of(recorded(by_the_square, seconds=12.0))
    assert found is not None
    (curve,) = found.found
    assert (curve.stage, curve.of, curve.unit) == ("loader", "rate_m_per_s", "N")
    assert curve.like == "c·v·|v|"
    assert curve.closed > 0.9
    rate = np.array(curve.nodes)
    # A straight line between two nodes is off by an eighth of c·h² at its middle, at most.
    between = QUADRATIC * np.max(np.diff(rate)) ** 2 / 8.0
    own = found.rig.controls["column"].loader.damping - COLUMN.loader.damping  # in its tolerance
    whole = np.array(curve.values) + own * rate
    assert whole == pytest.approx(QUADRATIC * rate**2, abs=between, rel=0.1)
    assert np.all(np.array(curve.low) <= curve.values)
    assert np.all(np.array(curve.high) >= curve.values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "bend", "key", "like"),
    [
        (reads_by_the_square, 9e-5, "sensing.grip_curve", "c·δ²"),
        (bends_unlike, 9e-5, "loader.bend_curve", "c·|F|"),
        # Of a rigid structure no bend falls with the force, but a reading may.
        (bends_unlike, 0.0, "sensing.grip_load_curve", "c·|F|"),
    ],
)
def test_a_law_of_the_linkage_is_a_curve_over_its_own_signal(
    fault: Fault, bend: float, key: str, like: str
) -> None:
    rig = RIG.changed({"controls.column.loader.bend_m_per_N": bend})
    found = curves_of(recorded(fault, rig=rig), rig)
    assert found is not None
    (curve,) = found.found
    assert (curve.key, curve.stage) == (f"controls.column.{key}", "linkage")
    assert curve.like == like
    assert curve.closed > 0.9


@pytest.fixture(scope="module")
def entry() -> PartDiagnosis:
    """A diagnosis of the wrong entry, as if the library were empty."""
    prepared = prepare(RIG, {"r.csv": recorded(wrong_entry)}, Part("column"))
    return findings(prepared, *search_sets(prepared.case, []))


def test_a_wrong_entry_of_the_schedule_is_that_entry(entry: PartDiagnosis) -> None:
    (curve,) = entry.curves
    at = TABLE.dynamic_pressure[ENTRY]
    assert (curve.stage, curve.of) == ("schedule", "dynamic_pressure_Pa")
    assert curve.like == f"one entry, at {at:g} Pa"
    off = float(np.interp(at, curve.nodes, curve.values))
    assert off == pytest.approx((WRONG - 1.0) * TABLE.total_gradient[ENTRY], rel=0.02)
    assert curve.closed > 0.9


@pytest.mark.parametrize(
    "fault",
    [
        healthy,
        pytest.param(fades, marks=pytest.mark.slow),
        pytest.param(jams, marks=pytest.mark.slow),
        pytest.param(drifts, marks=pytest.mark.slow),
        pytest.param(of_two_signals, marks=pytest.mark.slow),
    ],
)
def test_what_is_no_function_of_one_signal_is_no_curve(fault: Fault) -> None:
    assert curves_of(recorded(fault)) is None


def test_a_curve_is_reported_and_drawn_and_no_cause(entry: PartDiagnosis) -> None:
    assert entry.verdict == "unexplained"
    assert entry.effects == ()
    stated = [one.as_dict() for one in entry.curves]
    (written,) = json.loads(json.dumps(stated, allow_nan=False))
    assert {"of", "unit", "nodes", "values", "low", "high", "closed", "like"} <= set(written)
    assert len({len(written[name]) for name in ("nodes", "values", "low", "high")}) == 1
    assert entry.curved is not None
    assert entry.curved.shrink[0].channel == "column_gradient_N_per_m"
    assert entry.curved.shrink[0].closed == pytest.approx(written["closed"])
    assert entry.curves[0].sentence.endswith("it is no cause.")
    table = curve_table(entry.curves[0], "us")
    assert table.caption.startswith("A curve fitted to the schedule, without a cause; it closes ")
    assert table.heads[1] == "controls.column.schedule.gradient_curve, lb/in"
    assert len(draw_curves(View(entry)).axes) == 1


SERIES = ("gradient_error", "cubic_stiffness", "friction_ripple", "viscous_damping")
PULL_N = 30.0 * np.sin(np.cumsum(np.geomspace(0.01, 0.08, 1800)))


def diagnosed(changes: dict[str, object], names: Sequence[str] = SERIES) -> PartDiagnosis:
    """Return the diagnosis of a bench with changes of its loader, by effects of these names."""
    noise = {"column_force_N": 0.15, "column_computed_m": 2e-5, "column_deflection_m": 4e-5}
    loader = {f"controls.column.loader.{key}": value for key, value in changes.items()}
    real = RIG.changed({"noise": noise, **loader})
    record = fly_force(real, {"column": PULL_N}, np.full(len(PULL_N), 2000.0), seed=4)
    prepared = prepare(RIG, {"r.csv": record}, Part("column"))
    library = [effect for effect in prepared.library if effect.name in names]
    return findings(prepared, *search_sets(prepared.case, library))


@pytest.mark.slow
def test_effects_that_approximate_a_curve_are_less_probable_than_the_curve() -> None:
    """A spring with a dead zone was a gradient error and a cubic stiffness of 0.89 each."""
    zone = {"deflection_m": [-0.1, -1e-3, 1e-3, 0.1], "force_N": [1.65, 1.65, -1.65, -1.65]}
    found = diagnosed({"force_curve": zone})
    assert found.verdict == "unexplained"
    assert len(found.effects) > 1
    assert max(one.probability for one in found.effects) < 0.1
    (curve,) = found.curves
    assert curve.key == "controls.column.loader.force_curve"
    assert curve.closed > 0.95
    assert "It describes the gap better than " in found.summary


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.5, 1.0])
def test_damping_found_before_a_curve_over_the_rate_is_fitted_beside_it(factor: float) -> None:
    """Beside damping by the square of the speed, viscous damping was too large, and certain."""
    rate = np.linspace(0.0, 0.4, 20)
    square = {"rate_m_per_s": rate.tolist(), "force_N": (QUADRATIC * rate**2).tolist()}
    damping = factor * COLUMN.loader.damping
    found = diagnosed({"friction_curve": square, "damping_N_s_per_m": damping})
    (effect,) = found.effects
    assert effect.name == "viscous_damping"
    (curve,) = found.curves
    assert curve.like == "c·v·|v|"
    if factor == 1.0:
        assert effect.probability < 0.1
        assert "It describes the gap better than viscous damping" in found.summary
        return
    assert effect.probability > 0.6
    assert effect.parameters[0].value == pytest.approx(factor, rel=0.02)
    nodes, values = np.array(curve.nodes), np.array(curve.values)
    assert values == pytest.approx(QUADRATIC * nodes**2, rel=0.1, abs=0.05)
    improved = found.improved.controls["column"].loader
    assert improved.damping == pytest.approx(damping, rel=0.02)
    assert not improved.friction_curve.nodes
    with_curves = found.with_curves.controls["column"].loader
    assert with_curves.damping == improved.damping
    assert with_curves.friction_curve.nodes


@pytest.mark.slow
def test_a_curve_has_the_size_at_which_no_effect_corrects_it() -> None:
    """A gradient error of 1.5 % corrected a curve that was too large, and was certain.

    The rig with it and without the curve was worse than the filed one.
    """
    at = np.linspace(-0.06, 0.06, 23)
    spring = {"deflection_m": at.tolist(), "force_N": (3e5 * at**3).tolist()}
    names = [name for name in SERIES if name != "cubic_stiffness"]
    found = diagnosed({"force_curve": spring}, names)
    (curve,) = found.curves
    assert curve.like == "c·δ³"
    loader = found.stage("loader")
    assert loader.gap is not None and loader.left is not None
    assert loader.left < 1.01 * loader.gap
    assert max((one.probability for one in found.effects), default=0.0) < 0.1


def test_effects_that_leave_noise_alone_keep_their_probability() -> None:
    found = diagnosed({"cubic_N_per_m3": 3e5, "damping_N_s_per_m": 105.0})
    assert found.verdict == "effect"
    assert {one.name for one in found.effects} == {"viscous_damping", "cubic_stiffness"}
    assert found.curves == ()


@pytest.mark.parametrize("first", [0.0, -0.02])
def test_a_reading_is_inverted_along_its_curve(first: float) -> None:
    nodes = [first, 0.01, 0.03]
    reading = [1.3 * nodes[0], 0.013, 0.025]
    key = "controls.column.sensing.deflection_curve"
    curved = RIG.changed({key: {"deflection_m": nodes, "reading_m": reading}})
    sensed = Sensed(curved, "column")
    true = np.linspace(-0.04, 0.04, 41)
    assert not np.allclose(sensed.curve.at(true), true)
    assert sensed.curve.inverse(sensed.curve.at(true)) == pytest.approx(true, abs=1e-7)
    table = {"deflection_m": nodes, "reading_m": reading}
    changes = {"grip_curve": table, "deflection_zero_m": 0.01}
    at_grip = Sensed(
        RIG.changed({f"controls.column.sensing.{key}": value for key, value in changes.items()}),
        "column",
    )
    force, by_force = 100.0 * true, {"force_N": [0.0, 1.0], "reading_m": [0.0, -2e-3]}
    loaded = Sensed(
        at_grip.rig.changed({"controls.column.sensing.grip_load_curve": by_force}), "column"
    )
    assert at_grip.at_grip(true, force) == pytest.approx(sensed.curve.at(true) + 0.01)
    assert loaded.at_grip(true, force) == pytest.approx(at_grip.at_grip(true, force) - 0.2 * true)
    for one in (at_grip, loaded):
        read = one.at_grip(true, force)
        assert one.from_grip(read, force) == pytest.approx(true, abs=1e-7)
        names = ("column_deflection_m", "column_force_N")
        record = Record(names, np.column_stack((read, force)))
        assert true_deflection(one.rig, "column", record) == pytest.approx(true, abs=1e-7)


def test_curves_are_written_to_an_improved_rig_only(tmp_path: Path) -> None:
    done = coupled(tmp_path, "diagnose", "r.csv", "--rig", "bench", "--with-curves")
    assert done.returncode == 2
    assert done.stderr == "error: r.csv: --with-curves: is for --improve NEW.toml\n"


@pytest.mark.slow
def test_the_rig_with_curves_is_written_and_explains_the_record(tmp_path: Path) -> None:
    write_record(recorded(wrong_entry), tmp_path / "r.csv")
    RIG.save(tmp_path / "rig.toml")
    words = ("diagnose", "r.csv", "--rig", "rig.toml", "--with-curves")
    more = ("--improve", "new.toml", "--json", "d.json", "--plots", "figures")
    done = coupled(tmp_path, *words, *more)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "new.toml").read_text(encoding="utf-8")
    assert "# added: controls.column.schedule.gradient_curve" in text
    curve = read_rig(tmp_path / "new.toml").controls["column"].schedule.gradient_curve
    assert len(curve.nodes) > 2
    assert "with curves" in done.stdout
    found = json.loads((tmp_path / "d.json").read_text())
    assert found["verdict"] == "unexplained"
    assert found["curves"][0]["stage"] == "schedule"
    assert found["shrink"]["with_curves"][0]["closed"] > 0.9
    flown = found["closed_loop_with_curves"]["column_computed_m"]
    assert flown["after"] < 0.5 * flown["before"]
    assert (tmp_path / "figures" / "curves.png").is_file()
    without = coupled(tmp_path, *words[:-1], "--improve", "plain.toml")
    assert without.returncode == 0
    assert not read_rig(tmp_path / "plain.toml").controls["column"].schedule.gradient_curve.nodes
    again = coupled(tmp_path, "diagnose", "r.csv", "--rig", "./new.toml")
    assert "No gap" in again.stdout


def test_a_force_in_proportion_to_the_deflection_is_answered_as_a_spring() -> None:
    record = recorded(healthy)
    case = prepare(RIG, {"record": record}, Part("column")).case
    (output,) = (one for one in case.outputs if one.stage == "loader")
    place = smoothed(record["column_computed_m"])
    answer = response_to_force(RIG, "column", record, output, 20.0 * place)
    key = "controls.column.loader.force_curve"
    spring = {"deflection_m": [-1.0, 0.0, 1.0], "force_N": [-20.0, 0.0, 20.0]}
    sprung = output.residual(RIG) - output.residual(RIG.changed({key: spring}))
    assert np.std(sprung) > 2.0
    assert np.std(answer - sprung) < 0.06 * np.std(sprung)  # a frame late, it is 0.1


@pytest.mark.parametrize("two", [True, False])
def test_a_closed_form_of_two_signals_is_named_if_it_fits_best(two: bool) -> None:
    rng = np.random.default_rng(3)
    place, rate = np.sin(np.arange(2400) / 50.0), rng.standard_normal(2400)
    law = next(one for one in LAWS if one.key == "loader.force_curve")
    places = np.linspace(-1.0, 1.0, 21)
    hats = np.array([np.interp(place, places, unit) for unit in np.eye(21)]).T
    product = place * np.abs(rate)
    wanted = 20.0 * (product if two else place**3) + rng.standard_normal(2400)
    output = Output("loader", "column_computed_m", wanted, lambda rig: 0.0 * wanted, 1.0, 100.0)
    basis = Basis(law, places, [output], [hats], [wanted], ModelError(np.zeros(1), np.ones(1)))
    pick = choose(basis, basis.sums("all"), ())
    other = {"c·δ·|v|": [product]}
    form = closed_form(basis, pick, (), other)
    assert form is not None
    assert form.name == ("c·δ·|v|" if two else "c·δ³")
