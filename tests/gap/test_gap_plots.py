"""The figures of a diagnosis: one for each effect of the library, and what they tell apart."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from coupled.display import System
from coupled.gap.chain import Part
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import BY_REGRESSOR, Effect, apply, keys_of
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.findings.budget import ChannelShrink, Shrink
from coupled.gap.findings.diagnosis import PartDiagnosis
from coupled.gap.findings.flown import fly_force
from coupled.gap.findings.result import EffectResult, ParameterEstimate, StageResult
from coupled.gap.search.found import Candidate, Choice, Fit, Found
from coupled.gap.signals.output import Output, stage_gaps
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.plots.gaps import FIGURES, draw_diagnosis
from coupled.plots.gapview import View, channel_label, channel_shown
from coupled.plots.saving import save
from coupled.plots.signals import SIGNALS
from coupled.plots.signatures import draw_signature
from coupled.record.channels import LATERAL
from coupled.record.record import Record, write_record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.airframes import noisy, pulses
from tests.support.commands import coupled
from tests.support.gaps import made, nominal_rig
from tests.support.machines import slider, slider_rig

SYSTEMS: tuple[System, System] = ("si", "us")
Case = tuple[Rig, Record, tuple[Output, ...]]
UNITS = r"%|%/s|1|°|°/s|g|N|N/m|m/s|m/s²|mm|mm/s|cm|cm/s|µm|kPa|kPa/s|s|Hz"
UNIT = re.compile(rf", ({UNITS})( \(logarithmic\))?$")


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> Mapping[bool, Case]:
    """A bench and a flight of 12 s without any effect, with their outputs, by whether flown."""
    return {flown: case(tmp_path_factory.mktemp("r"), flown) for flown in (False, True)}


@pytest.fixture(scope="module")
def lateral() -> Case:
    """A flight of 12 s with all three controls, and its outputs."""
    rig = read_rig(shipped_rigs()["c172p"])
    record = fly_force(noisy(rig), pulses(rig, 12.0), seed=3)
    reader = Reader(rig, record, "column", surface_points)
    return rig, record, (*reader.outputs(), *airframe_outputs(rig, record))


def case(folder: Path, flown: bool) -> Case:
    nominal = nominal_rig(flown)
    column = made(folder, nominal, {}, 3).between(0.0, 12.0)
    if "wheel_force_N" in column:
        record = column
    else:  # a wheel that another rig has
        wheel = 20.0 * np.sin(2.0 * column.time_s)
        record = Record((*column.channels, "wheel_force_N"), np.column_stack((column.data, wheel)))
    reader = Reader(nominal, record, "column", surface_points)
    return nominal, record, (*reader.outputs(), *airframe_outputs(nominal, record))


def diagnosis_of(case: Case, effects: list[Effect], rival: Effect | None = None) -> PartDiagnosis:
    """Return the diagnosis that names these effects, whatever the record says."""
    nominal, record, outputs = case
    fitted = fit_of(nominal, effects)
    rivals = (Candidate(9.0, rival, fit_of(nominal, [rival])),) if rival else ()
    steps = tuple(Found(effect, 50.0, 0.99, rivals) for effect in effects)
    rounds = tuple({effect.name: 50.0, "inertia_like": -300.0} for effect in effects)
    gaps = stage_gaps(outputs, nominal)
    blamed = {effect.stage for effect in effects}
    held = ChannelShrink("column_computed_m", 1.0, 1.0, 1.0, 8)
    return PartDiagnosis(
        part=Part("column"),
        readers=(Reader(nominal, record, "column", surface_points),),
        control="column",
        verdict="effect" if effects else "no_gap",
        stages=tuple(StageResult(s, g, g, 1.2, 1.0, s in blamed) for s, g in gaps.items()),
        effects=tuple(
            EffectResult(
                effect.name,
                effect.stage,
                0.99,
                tuple(ParameterEstimate(p.named("column"), 1.0, 0.9, None) for p in effect.free),
            )
            for effect in effects
        ),
        rivals=(),
        settings=(),
        budget=(),
        shrink=Shrink(held, (held,)),
        nominal=nominal,
        improved=fitted.rig,
        records={"r.csv": record},
        outputs=outputs,
        choice=Choice(steps, fitted, fit_of(nominal, []), {}, rounds),
    )


def fit_of(nominal: Rig, effects: list[Effect]) -> Fit:
    values = {e.value_key(p): p.starts[0] for e in effects for p in e.free}
    rig = apply(nominal, "column", effects, values)
    return Fit(tuple(effects), values, values, values, (), rig)


def needs_flight(effect: Effect) -> bool:
    flown = any(p.key.startswith("flight.") for p in effect.parameters)
    return flown or effect.stage == "surface" or effect.name == "bob_weight"


def labels(figure: Figure) -> list[str]:
    """Return the labels of all axes that are drawn with a scale."""
    shown = [axes for axes in figure.axes if axes.axison and axes.get_visible()]
    return [text for axes in shown for text in (axes.get_xlabel(), axes.get_ylabel()) if text]


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect",
    # Drawn where a rig has them: test_gravity (a wheel), test_regressor (a channel in the file).
    [e for e in EFFECTS if e.name != "gravity" and not keys_of([e]) & {*BY_REGRESSOR}],
    ids=lambda effect: effect.name,
)
def test_every_effect_has_a_signature_with_units(
    cases: Mapping[bool, Case], lateral: Case, effect: Effect
) -> None:
    case = lateral if {*LATERAL} & {*effect.needs} else cases[needs_flight(effect)]
    figure = draw_signature(View(diagnosis_of(case, [effect])))
    figure.draw_without_rendering()
    assert effect.name.replace("_", " ") in figure.subfigs[0].get_suptitle()
    found = labels(figure)
    assert len(found) == 4
    assert all(UNIT.search(label) for label in found), found


def test_the_library_draws_by_every_signal_and_no_other() -> None:
    used = {name for e in EFFECTS for name in (e.signature.x, e.signature.y) if name}
    assert used == set(SIGNALS)


@pytest.mark.slow
def test_the_files_differ_as_the_diagnoses_do(cases: Mapping[bool, Case], tmp_path: Path) -> None:
    case = cases[False]
    pair = ("coulomb_friction", "backlash")
    diagnoses = [
        diagnosis_of(case, []),
        diagnosis_of(case, [BY_NAME["coulomb_friction"]]),
        diagnosis_of(case, [BY_NAME[n] for n in pair], BY_NAME["servo_lag"]),
    ]
    written: dict[str, set[bytes]] = {name: set() for name in FIGURES}
    for diagnosis in diagnoses:
        for name, figure in draw_diagnosis(diagnosis).items():
            assert all(UNIT.search(label) for label in labels(figure) if not stands_alone(label))
            save(figure, tmp_path / name)
            written[name].add((tmp_path / name).read_bytes())
    assert all(len(files) == len(diagnoses) for files in written.values())


def stands_alone(label: str) -> bool:
    """Tell whether a label is of the ladder's list of effects, whose axis is shared."""
    return label.startswith("screened out")


@pytest.mark.slow
def test_a_residual_that_nothing_explains_is_held_against_everything(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    record = made(tmp_path, nominal, {}, 5).between(0.0, 12.0)
    data = record.data.copy()
    at = record.channels.index("column_deflection_m")
    jumps = np.where(np.sin(record.time_s * 9.0) > 0.6, 2e-3, 0.0)
    data[:, at] += jumps - jumps.mean()  # a mean would be a zero that is off
    spoiled = Record(record.channels, data)
    (diagnosis,) = diagnose(nominal, {"r.csv": spoiled}, "column").parts
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.choice.steps == ()  # none was worth a fit, and those made all the same fail
    figures = draw_diagnosis(diagnosis)
    figure = figures["signature.png"]
    figure.draw_without_rendering()
    titles = [axes.get_title("left") for axes in figure.axes]
    assert "power at 1.4" in titles[0]  # 9 rad/s
    shares = [float(re.findall(r"(\d+) %", title)[0]) for title in titles]
    assert shares == sorted(shares, reverse=True)
    assert len(shares) == 6


def test_what_was_lost_on_the_way_is_drawn_without_it(cases: Mapping[bool, Case]) -> None:
    """A record without load factor, and one whose host does not compute as it should."""
    nominal, _, outputs = cases[False]
    diagnosis = diagnosis_of(cases[False], [BY_NAME["bob_weight"]])
    figure = draw_signature(View(diagnosis))
    assert "lacks load_factor" in figure.axes[0].texts[0].get_text()
    guilty = (StageResult("compensation", 40.0, limit=1.2, guilty=True),)
    host = replace(diagnosis_of(cases[False], []), verdict="unexplained", stages=guilty)
    figure = draw_diagnosis(host)["signature.png"]
    assert "compensation" in figure.subfigs[0].get_suptitle()
    assert outputs and nominal.flight is None


def drawn_x(figure: Figure) -> float:
    """Return how far the law's dots go along the bottom."""
    return float(np.nanmax(np.abs(np.asarray(figure.axes[0].lines[0].get_xdata(), float))))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "surface"),
    [("roll_damping", "aileron"), ("yaw_damping", "rudder")],
)
def test_motion_is_drawn_beside_the_surface_that_turns_it(
    lateral: Case, effect: str, surface: str
) -> None:
    nominal, *_ = lateral
    other = fly_force(
        noisy(nominal).changed({f"flight.{effect}": 0.4}), pulses(nominal, 12.0), seed=3
    )
    outputs = (*airframe_outputs(nominal, other),)
    figure = draw_signature(View(diagnosis_of((nominal, other, outputs), [BY_NAME[effect]])))
    axes = figure.axes[1]
    assert axes.get_legend_handles_labels()[1][0].startswith(f"{surface}, ")
    drawn, motion = (np.asarray(line.get_ydata(), float) for line in axes.lines[:2])
    assert np.corrcoef(drawn[6:-6], motion[12:] - motion[:-12])[0, 1] > 0.3


@pytest.mark.slow
def test_restarts_of_a_replay_do_not_set_the_scale_of_a_signature() -> None:
    """A machine without a spring is replayed between restarts, where its speed jumps."""
    found = diagnose(slider_rig(), {"r": slider(1, 0.6)})
    [part] = found.parts
    law = draw_signature(View(part)).axes[0]
    measured, *rigs, medians = (np.asarray(line.get_xydata()) for line in law.lines)
    wide, high = np.ptp(measured, axis=0)
    assert np.ptp(law.get_xlim()) < 4.0 * wide and np.ptp(law.get_ylim()) < 4.0 * high
    middle = np.median(rigs[1], axis=0)
    assert middle == pytest.approx(np.median(medians, axis=0), rel=0.2)


def test_rivals_of_an_effect_are_named_once_above_its_gains(cases: Mapping[bool, Case]) -> None:
    diagnosis = diagnosis_of(cases[False], [BY_NAME["bend"]], BY_NAME["soft_backlash"])
    (step,) = diagnosis.choice.steps
    twice = replace(step, rivals=step.rivals * 2)
    figure = draw_diagnosis(replace(diagnosis, choice=replace(diagnosis.choice, steps=(twice,))))
    titles = [axes.get_title(loc="left") for axes in figure["ladder.png"].axes]
    assert titles[0] == "depth 1: bend (rivals: soft backlash)"


def test_a_signature_is_drawn_in_us_units(cases: Mapping[bool, Case]) -> None:
    effect = "backlash"
    diagnosis = diagnosis_of(cases[needs_flight(BY_NAME[effect])], [BY_NAME[effect]])
    si, us = (draw_signature(View(diagnosis, system)) for system in SYSTEMS)
    assert labels(si)[0].endswith(", mm") and labels(us)[0].endswith(", in")
    assert drawn_x(us) == pytest.approx(drawn_x(si) / 25.4)
    assert not [label for label in labels(us) if re.search(r"\bN\b|\bmm\b|\bcm\b", label)]
    names = [
        label for figure in draw_diagnosis(diagnosis, "us").values() for label in labels(figure)
    ]
    assert not [label for label in names if re.search(r"\bN\b|\bmm\b|\bcm\b", label)]


def test_us_units_of_channels() -> None:
    assert channel_shown("column_gradient_N_per_m", "us").unit == "lb/in"
    shown = channel_shown("column_deflection_m", "us")
    assert (round(shown.factor, 4), shown.unit) == (39.3701, "in")
    assert channel_shown("column_deflection_m", "us", fine=True).unit == "in"
    shown = channel_shown("column_deflection_m", fine=True)
    assert (shown.factor, shown.unit) == (1000.0, "mm")
    assert channel_shown("load_factor", "us").unit == "g"


def test_channels_have_labels_and_units() -> None:
    assert channel_label("column_gradient_N_per_m") == "scheduled gradient G_T"
    for name, unit in (
        ("column_gradient_N_per_m", "N/m"),
        ("column_deflection_m", "cm"),
        ("wheel_deflection_rad", "°"),
        ("pitch_rate_rad_per_s", "°/s"),
        ("dynamic_pressure_Pa", "kPa"),
        ("load_factor", "g"),
    ):
        assert channel_shown(name).label == f"{channel_label(name)}, {unit}"


@pytest.mark.slow
def test_plots_on_the_command_line(tmp_path: Path) -> None:
    nominal = nominal_rig(True)
    write_record(made(tmp_path, nominal, {}, 8).between(0.0, 12.0), tmp_path / "r.csv")
    us = ("--units", "us", "--report", "us.html")
    asked = ("diagnose", "r.csv", "--rig", "report-column", "--plots")
    done = coupled(tmp_path, *asked, "figures", *us)
    assert done.returncode == 0, done.stderr
    assert "Each stage of the chain" in (tmp_path / "us.html").read_text(encoding="utf-8")
    for name in FIGURES:
        assert f"figure: figures/{name}" in done.stdout
        assert (tmp_path / "figures" / name).read_bytes()[:4] == b"\x89PNG"
    (tmp_path / "taken").write_text("")
    refused = coupled(tmp_path, *asked, "taken")
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
