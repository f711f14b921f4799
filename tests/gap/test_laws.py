"""An aircraft whose control laws move its elevator: an F-16, by the rig that `new rig` writes.

Judged by its command, open loop, its healthy record was once answered with an elevator that does a
tenth of what it should.
"""

from __future__ import annotations

import pytest

from coupled.flight.airframe import JSBSimAirframe
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.flown import fly_force
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.surfaces import _moves_itself, surface_points
from coupled.record.channels import LONGITUDINAL
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.surveying.draft import draft
from coupled.surveying.survey import chosen_model, survey
from tests.support.gaps import pushes
from tests.support.records import NOISE


@pytest.fixture(scope="module")
def falcon(tmp_path_factory: pytest.TempPathFactory) -> Rig:
    file = tmp_path_factory.mktemp("f16") / "f16.toml"
    found = survey(chosen_model("f16"), speeds=True)
    file.write_text(draft(found, "f16"), encoding="utf-8")
    rig = read_rig(file)
    return rig.changed({"controls": {"column": rig.controls["column"]}})


def flown(rig: Rig) -> Record:
    _, force = pushes(4, 20.0)
    record = fly_force(rig.changed({"noise": NOISE}), {"column": force[: 120 * 20]}, seed=7)
    assert not record.manifest["ended_early"]
    return record


def test_a_surface_that_laws_move_has_no_map() -> None:
    """An F-16's elevator moves as the air rises, a T-37's does not."""
    trainer = read_rig(shipped_rigs()["t37"])
    assert trainer.flight is not None
    aircraft = {"model": "f16", "altitude_m": 1500.0, "calibrated_airspeed_m_per_s": 106.5}
    by_laws = {**aircraft, "direct_controls": False}
    assert surface_points(trainer, "column") is not None
    assert surface_points(trainer.changed({"flight": by_laws}), "column") is None


@pytest.mark.parametrize(("law", "moves"), [(0.0, False), (0.02, True)])
def test_a_surface_that_moves_with_the_air_is_moved_by_laws(law: float, moves: bool) -> None:
    """Still in trim, and with no other control to be moved."""

    class Held(JSBSimAirframe):
        gust = position = 0.0

        def __init__(self) -> None:
            self.motion = lambda: tuple(self.position for _ in LONGITUDINAL)
            self.step = self.answer

        def set_gust(self, up_m_per_s: float) -> None:
            self.gust = up_m_per_s

        def answer(self, commands: tuple[float, float, float], /) -> None:
            self.position = 0.3 * commands[0] + law * self.gust

    assert _moves_itself(Held(), ["column"], 120.0, "column") is moves


@pytest.mark.slow
def test_a_healthy_record_has_no_gap(falcon: Rig) -> None:
    record = flown(falcon)
    found = diagnose(falcon, {"r.csv": record})
    assert (found.verdict, found.effects) == ("no_gap", ())
    surface = found.stage("surface")
    assert not surface.judged
    assert surface.why == "control laws of the aircraft also move it; judged with the airframe"
    compared = {output.channel: output for output in airframe_outputs(falcon, record)}
    assert compared["elevator_rad"].gap(falcon) < 1.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [("viscous_damping", "factor", 1.4), ("mass", "factor", 1.1)],
)
def test_an_effect_is_found_there(falcon: Rig, name: str, parameter: str, value: float) -> None:
    effect = BY_NAME[name]
    real = apply(falcon, "column", [effect], {f"{name}.{parameter}": value})
    found = diagnose(falcon, {"r.csv": flown(real)})
    assert found.verdict == "effect"
    assert [(one.name, one.stage) for one in found.effects] == [(name, effect.stage)]
    assert found.effects[0].value == pytest.approx(value, rel=0.03)
