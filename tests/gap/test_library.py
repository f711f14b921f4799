"""The library is complete: what an effect needs elsewhere is there, and no list names it again."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from coupled.blind.twin.effects import EFFECTS as TWINS
from coupled.blind.twin.revision2 import REVISION_2
from coupled.errors import InputError
from coupled.gap.chain import STAGES, stage_of
from coupled.gap.effects.effect import Effect, apply, possible, value_of
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.effects.settings import settings
from coupled.gap.findings.answer import estimate
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.plots.signals import SIGNALS
from coupled.record.channels import CONTROL_NAMES
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from tests.support.gaps import nominal_rig
from tests.support.joined import joined
from tests.support.rigs import bench
from tests.support.twin import WITHOUT_TWIN

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "coupled"
# Modules of `gap/effects` that hold entries, where an effect's name is spelled.
ENTRIES = ("library", "airframe", "loader", "linkage", "sensing", "frictions")
# Effects of machines of others, which are none of the contract's.
IN_NO_TRIAL = {
    *WITHOUT_TWIN,
    *("servo_delay", "servo_tuning", "servo_acceleration_limit"),
}
OF_A_WHEEL, WHEEL = {"gravity"}, CONTROL_NAMES[1]
TWIN_OF = {kind.name: kind for kind in (*TWINS, *REVISION_2)}


@pytest.fixture(scope="module")
def flown() -> Rig:
    return nominal_rig(True).changed({"controls.column.loader.regressor": "motor_K"})


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_what_an_effect_needs_elsewhere_is_there(effect: Effect, flown: Rig) -> None:
    assert effect.stage in STAGES
    assert {stage_of(output) for output in effect.shows_in} <= set(STAGES)
    if effect.name not in IN_NO_TRIAL:
        assert TWIN_OF[effect.name].stage == effect.stage
    drawn = {effect.signature.x, effect.signature.y} - {""}
    assert drawn <= set(SIGNALS)
    files = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    diagnosis = (ROOT / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    assert f"\n`{effect.name}`| " in diagnosis
    for p in effect.parameters:
        assert f"`{p.key.split('.')[-1]}`" in files, p.key
        if p.name:
            assert f"`{p.name}`" in diagnosis, p.name
        value_of(flown, "column", p.key)  # the rig has it


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_an_effect_is_entered_under_its_keys_and_nothing_else(effect: Effect, flown: Rig) -> None:
    rig, control = (joined(), WHEEL) if effect.name in OF_A_WHEEL else (flown, "column")
    starts = {effect.value_key(p): p.starts[0] + p.base(rig, control) for p in effect.free}
    changed = apply(rig, control, [effect], starts)
    for p in effect.parameters:
        value = starts.get(effect.value_key(p), 0.0)
        assert value_of(changed, control, p.key) == p.entered(p.nominal(rig, control), value)
    neutral = {effect.value_key(p): float(p.mode == "factor") for p in effect.free}
    if all(p.mode in ("factor", "added") for p in effect.parameters):
        same = apply(rig, control, [effect], neutral)
        for p in effect.parameters:
            assert value_of(same, control, p.key) == value_of(rig, control, p.key)


@pytest.mark.parametrize(
    ("name", "number", "ends"),
    [
        ("presliding_friction", "elastic_share", (0.0, 0.99)),
        ("load_friction", "factor", (0.0, 0.9)),
        ("bend_hysteresis", "share", (0.0, 1.0)),
        ("transport_delay", "delay_s", (0.0, 0.2)),
        ("crosstalk", "factor", (-1.0, 1.0)),
        ("force_skew", "delay_s", (-0.5, 0.5)),
        ("pitch_damping", "factor", (-10.0, 10.0)),
        ("inertia", "factor", (0.0, None)),
        ("force_offset", "offset_N", (None, None)),
    ],
)
def test_an_interval_has_only_values_that_a_rig_file_accepts(
    name: str, number: str, ends: tuple[float | None, float | None], flown: Rig
) -> None:
    """The ends are those of docs/files.md, less the filed value of a parameter that is added."""
    effect = BY_NAME[name]
    [p] = [one for one in effect.free if one.name == number]
    key, start, wide = effect.value_key(p), p.starts[0], 1e3
    fit = Fit((effect,), {key: start}, {key: start - wide}, {key: start + wide}, (), flown)
    for filed in (0.0, 0.05) if p.mode == "added" else (p.nominal(flown, "column"),):
        rig = apply(flown, "column", [effect], {key: filed}) if p.mode == "added" else flown
        found = estimate(fit, effect, p, Case(rig, "column", []), 0.0)
        for end, left, of_rig in zip(
            ends, (-1, 1), (found.found_low, found.found_high), strict=True
        ):
            assert of_rig is not None
            if end is None:
                assert left * of_rig > 0.9 * wide
            else:
                assert of_rig == pytest.approx(end)


def test_every_stage_and_name_is_listed_once(flown: Rig) -> None:
    assert len(BY_NAME) == len(EFFECTS)
    with_tolerance = {e.name for e in EFFECTS if any(p.tolerance for p in e.free)}
    assert set(settings(flown, "column")) == with_tolerance
    assert set(BY_NAME) - IN_NO_TRIAL <= set(TWIN_OF)
    for effect in EFFECTS:
        assert set(effect.contains) <= set(BY_NAME)
        assert effect.name not in effect.contains


def test_no_other_module_spells_an_effect() -> None:
    """Names that are fields of a rig as well, such as `bend`, are left out."""
    fields = {p.key.split(".")[-1] for e in EFFECTS for p in e.parameters}
    fields |= {*Control.model_fields}
    own = {name for name in BY_NAME if not any(field.startswith(name) for field in fields)}
    assert len(own) > 15
    for room in ("gap", "plots", "cli"):
        for path in sorted((PACKAGE / room).rglob("*.py")):
            if path.parent.name == "effects" and path.stem in ENTRIES:
                continue
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    assert node.value not in own, (path.name, node.lineno, node.value)


def test_numbers_that_the_physics_cannot_give_are_refused_as_a_file_would_be() -> None:
    rig = bench({"controls.column.compensation.bend_m_per_N": 0.0})
    stiff = {"bend.bend_{d}_per_N": 5e-4}  # K·G_T = 1.09
    with pytest.raises(InputError, match=r"K·G_T = 1\.09"):
        apply(rig, "column", [BY_NAME["bend"]], stiff)
    assert possible(rig, "column", [BY_NAME["bend"]], stiff) is None


def test_more_running_friction_leaves_the_excess_of_the_breakaway_force() -> None:
    """Friction that is added acts at rest, too: an axis with a third more has that there."""
    rig = bench({"friction_N": 1.0, "breakaway_N": 2.0})
    effect = BY_NAME["coulomb_friction"]
    more = apply(rig, "column", [effect], {"coulomb_friction.friction_N": 3.0})
    loader = more.controls["column"].loader
    assert (loader.friction, loader.breakaway) == (4.0, 5.0)


def test_wheel_and_pedals_have_the_same_keys(flown: Rig) -> None:
    assert CONTROL_NAMES[1] == "wheel"
    assert BY_NAME["backlash"].free[0].named("wheel") == "play_rad"


def test_the_guide_counts_the_effects() -> None:
    text = (Path(__file__).parents[2] / "docs" / "guides" / "diagnose.md").read_text(
        encoding="utf-8"
    )
    assert f"one of {len(EFFECTS)} effects" in text
