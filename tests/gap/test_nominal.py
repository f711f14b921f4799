"""A nominal rig from records: the numbers that made them, and what they do not tell."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.gap.diagnose import diagnose
from coupled.gap.nominal import NominalFit, Number, fit_nominal, random_effects
from coupled.record.record import Record, read_record, write_record
from coupled.rig.rig import Rig
from coupled.rig.rigedit import differences, edited
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text
from tests.support.commands import coupled
from tests.support.gaps import made, nominal_rig
from tests.support.machines import duffing, plain_rig, recorded
from tests.support.rigs import bench

FOUNDERS = Path(__file__).parents[3] / "shared" / "real"
RATE_Hz, MASS_kg, DAMPING, FRICTION_N = 100.0, 8.0, 30.0, 4.0
FRICTION = "controls.column.loader.friction_N"
SLIDE = "controls.column.schedule.total_gradient_N_per_m"


def slide() -> Rig:
    """Return a slide without a spring, its numbers a third off."""
    guess = {"mass_kg": 10.0, "damping_N_s_per_m": 40.0, "friction_N": 3.0}
    guess |= {"basic_gradient_N_per_m": 0.0, "bend_m_per_N": 0.0}
    lists = {SLIDE: [0.0, 0.0], "controls.column.travel_m": 1.0}
    return bench({**guess, **lists, "controls.column.length_m": 2.0})


def moved(speeds_m_per_s: list[float], dry_N: float = FRICTION_N) -> Record:
    """Return a record of a slide that goes to and fro, each way at one speed of a list."""
    rng = np.random.default_rng(2)
    speed = np.repeat([s * side for s in speeds_m_per_s for side in (1, -1)], round(RATE_Hz))
    edge = np.hanning(21)
    speed = np.convolve(np.concatenate((np.zeros(50), speed)), edge / edge.sum(), "same")
    place = (np.cumsum(speed) - 0.5 * speed) / RATE_Hz
    pull = MASS_kg * np.gradient(speed) * RATE_Hz + DAMPING * speed
    pull += dry_N * np.tanh(speed / 1e-3) + rng.normal(0.0, 0.02, len(speed))
    place += rng.normal(0.0, 1e-6, len(place))
    time = np.arange(len(speed)) / RATE_Hz
    names = ("time_s", "column_force_N", "column_computed_m", "dynamic_pressure_Pa")
    return Record(names, np.column_stack((time, pull, place, 0.0 * time)))


DAMPING_KEY = "damping_N_s_per_m"
KEYS = ("loader.mass_kg", "loader.damping_N_s_per_m", "loader.friction_N")


def found(fitted: NominalFit) -> dict[str, float]:
    return {one.key: one.found for one in fitted.numbers}


def test_motion_at_several_speeds_tells_friction_from_damping() -> None:
    fitted = fit_nominal(slide(), {"r": moved([0.02, 0.05, 0.1, 0.03, 0.08, 0.15])}, KEYS)
    assert found(fitted) == pytest.approx(dict(zip(KEYS, (8.0, 30.0, 4.0), strict=True)), rel=0.03)
    assert fitted.alike == ()


def test_motion_at_one_speed_does_not_tell_friction_from_damping() -> None:
    fitted = fit_nominal(slide(), {"r": moved([0.1] * 5)}, KEYS)
    [one] = fitted.alike
    assert set(one.keys) == {"loader.damping_N_s_per_m", "loader.friction_N"}
    assert one.words.startswith("the speeds differ too little: ")
    numbers = found(fitted)
    both = numbers["loader.friction_N"] + 0.1 * numbers["loader.damping_N_s_per_m"]
    assert both == pytest.approx(FRICTION_N + 0.1 * DAMPING, rel=0.03)
    assert numbers["loader.mass_kg"] == pytest.approx(MASS_kg, rel=0.03)


def rubbed_by_direction(aft_N: float, forward_N: float, offset_N: float) -> Record:
    """Return the record of a slide with friction by direction and a constant force."""
    level = 0.5 * (aft_N + forward_N)
    plain = moved([0.02, 0.05, 0.1, 0.03, 0.08, 0.15], level)
    by_direction = 0.5 * (aft_N - forward_N) - offset_N
    names = ("time_s", "column_force_N", "column_computed_m", "dynamic_pressure_Pa")
    force = plain["column_force_N"] + by_direction
    data = [force if name == "column_force_N" else plain[name] for name in names]
    return Record(names, np.column_stack(data))


@pytest.mark.parametrize(
    ("free", "machine", "told"),
    [
        ("offset_N", (5.0, 3.0, 0.0), True),
        ("offset_N", (4.0, 4.0, -1.0), True),  # of the same record
        ("offset_N", (4.0, 4.0, 0.0), False),
        ("offset_N", (4.0, 4.0, 6.0), False),  # friction forward would be negative
        ("friction_push_N", (3.0, 5.0, 0.0), True),
    ],
)
def test_a_constant_force_is_not_told_from_friction_by_direction(
    free: str, machine: tuple[float, float, float], told: bool
) -> None:
    """Friction of 5 N aft and 3 N forward was 4 N and -1 N of offset, without a word."""
    keys = ("loader.friction_N", f"loader.{free}")
    rig = slide().changed(
        {f"controls.column.loader.{k}": v for k, v in (("mass_kg", 8.0), (DAMPING_KEY, DAMPING))}
    )
    fitted = fit_nominal(rig, {"r": rubbed_by_direction(*machine)}, keys)
    words = [one.words for one in fitted.alike]
    assert any("friction by direction acts as a constant force" in each for each in words) is told


def imposed_with_rests(rest_N: float) -> Record:
    """Return a damper's record with Coulomb friction, moved and at rest by turns.

    At rest its friction holds `rest_N`.
    """
    rng = np.random.default_rng(5)
    time = np.arange(round(24.0 * RATE_Hz)) / RATE_Hz
    moves = time % 8.0 < 4.0
    place = np.where(moves, 0.05 * np.sin(np.pi * time) * np.sin(1.5 * np.pi * time), 0.0)
    speed = np.gradient(place) * RATE_Hz
    rubbing = np.where(moves, 5.0 * np.sign(speed), rest_N)
    pull = MASS_kg * np.gradient(speed) * RATE_Hz + DAMPING * speed + rubbing
    noisy = (pull, 0.02), (place, 1e-7)
    pull, place = (one + rng.normal(0.0, rms, len(time)) for one, rms in noisy)
    names = ("time_s", "column_force_N", "column_deflection_m")
    return Record(names, np.column_stack((time, pull, place)))


@pytest.mark.slow
@pytest.mark.parametrize("rest_N", [0.0, 1.5, -4.0])
def test_a_rest_does_not_count_as_sliding(rest_N: float) -> None:
    keys = ["loader.friction_N", "loader.damping_N_s_per_m"]
    known = {"mass_kg": MASS_kg, "servo_frequency_Hz": 0.0}
    start = slide().changed({f"controls.column.loader.{key}": v for key, v in known.items()})
    fitted = fit_nominal(start, {"r": imposed_with_rests(rest_N)}, keys)
    assert found(fitted) == pytest.approx(dict(zip(keys, (5.0, DAMPING), strict=True)), rel=0.03)


def sprung(
    seconds: float = 20.0,
    rate_Hz: float = 100.0,
    steps: int = 20,
    yields_m: float = 1e-4,
    dry_N: float = FRICTION_N,
) -> Record:
    """Return a record of a mass on a spring whose friction yields (Dahl), by Euler."""
    time = np.arange(round(seconds * rate_Hz * steps)) / (rate_Hz * steps)
    waves = ((25.0, 0.23), (14.0, 0.61), (8.0, 1.7), (5.0, 3.1))
    pull = np.sum([s * np.sin(2.0 * np.pi * at_Hz * time) for s, at_Hz in waves], axis=0)
    place = speed = held = 0.0
    read = np.empty((len(time) // steps, 2))
    for k, force in enumerate(pull.tolist()):
        if k % steps == 0:
            read[k // steps] = force, place
        speed += (force - DAMPING * speed - 1000.0 * place - held) / MASS_kg * time[1]
        place += speed * time[1]
        slips = math.copysign(dry_N, speed)
        held = slips + (held - slips) * math.exp(-abs(speed) * time[1] / yields_m)
    read += (0.05, 5e-6) * np.random.default_rng(7).standard_normal(read.shape)
    return recorded(rate_Hz, force_N=read[:, 0], computed_m=read[:, 1])


def test_friction_that_yields_before_it_slips_is_not_fitted_as_mass() -> None:
    """Of four machines with such friction, the interval of the mass excluded the mass."""
    rig = plain_rig(100.0, {"mass_kg": 6.0, "damping_N_s_per_m": 20.0}, 1000.0)
    fitted = fit_nominal(rig, {"r": sprung()}, KEYS)
    for number, real in zip(fitted.numbers, (MASS_kg, DAMPING, FRICTION_N), strict=True):
        assert number.interval is not None
        assert number.interval[0] < real < number.interval[1]
        assert number.width < 0.05
    assert fitted.channels[0].after < 1.1 * fitted.channels[0].floor
    assert fitted.rig.controls["column"].loader.friction_stiffness == 0.0  # as in a diagnosis


@pytest.mark.slow
def test_friction_that_differs_between_records_is_not_fitted_as_mass() -> None:
    """One friction for all gave a mass of 7.7 kg for 8, and its interval excluded 8."""
    rig = plain_rig(100.0, {"mass_kg": 6.0, "damping_N_s_per_m": 20.0}, 1000.0)
    levels = (4.0, 4.5, 3.7, 4.4)
    fitted = fit_nominal(rig, {str(dry): sprung(dry_N=dry) for dry in levels}, KEYS)
    mass, damping, friction = fitted.numbers
    for number, real in ((mass, MASS_kg), (damping, DAMPING), (friction, np.mean(levels))):
        assert number.interval is not None
        assert number.interval[0] < real < number.interval[1]
    assert mass.width < 0.03
    assert friction.interval is not None
    assert friction.interval[0] < min(levels)
    assert friction.interval[1] > max(levels)


def test_the_mean_of_random_effects_weighs_values_by_their_errors() -> None:
    """Two values by hand: between² = (Q − 1)/(Σw − Σw²/Σw), 1/s² = 1/(error² + between²)."""
    mean, error, scatter = random_effects(np.array([1.0, 3.0]), np.array([0.5, 0.5]))
    assert (mean, error, scatter) == pytest.approx((2.0, 1.0, math.sqrt(1.75)))
    mean, error, scatter = random_effects(np.array([1.0, 1.1]), np.array([0.1, 10.0]))
    assert (mean, error, scatter) == pytest.approx((1.00001, 0.1, 0.0), rel=1e-3)


@pytest.mark.parametrize(("late_s", "play_m"), [(2e-5, 0.0), (0.0, 2e-5), (2e-5, 2e-5)])
def test_a_grip_that_is_read_late_has_no_play(late_s: float, play_m: float) -> None:
    """A delay of 20 µs was a play of 3 µm, with an interval of 2.4 to 3.4 µm."""
    rng = np.random.default_rng(4)
    time = np.arange(round(20.0 * RATE_Hz)) / RATE_Hz

    def way(at: np.ndarray) -> np.ndarray:
        return 0.03 * np.sin(1.5 * at) + 0.005 * np.sin(11.0 * at)

    fine = np.arange(10 * len(time)) / (10 * RATE_Hz) - late_s
    grip, grips = 0.0, np.empty(len(fine))
    for k, at in enumerate(way(fine).tolist()):
        grip = grips[k] = min(max(grip, at - 0.5 * play_m), at + 0.5 * play_m)
    pull = 1000.0 * way(time)
    record = recorded(
        RATE_Hz,
        force_N=pull + rng.normal(0.0, 0.01, len(time)),
        computed_m=way(time) + rng.normal(0.0, 1e-6, len(time)),
        deflection_m=grips[::10] + 1e-5 * pull + rng.normal(0.0, 1e-6, len(time)),
    )
    keys, none = ["loader.bend_m_per_N", "loader.play_m"], {"servo_frequency_Hz": 0.0}
    bend, play = fit_nominal(plain_rig(RATE_Hz, none, 1000.0), {"r": record}, keys).numbers
    assert bend.found == pytest.approx(1e-5, rel=0.01)
    assert play.found == pytest.approx(play_m, rel=0.1)
    assert (play.half is None) is (play_m == 0.0)


STIFFNESS_KEY = "loader.friction_stiffness_N_per_m"


@pytest.mark.slow
def test_friction_may_yield_further_than_in_a_diagnosis() -> None:
    """With at most 0.5 mm the mass was 6.9 kg, its interval without 8 kg; a free stiffness was
    undetermined, since its range ended at 1000 N/m, and the friction was 0."""
    rig = plain_rig(100.0, {"mass_kg": 6.0, "damping_N_s_per_m": 20.0}, 1000.0)
    records = {"r": sprung(yields_m=3e-3)}
    nuisance = fit_nominal(rig, records, KEYS)
    (doubt,) = nuisance.doubts
    assert doubt.endswith(f"add --free {STIFFNESS_KEY}")
    for number, real in zip(nuisance.numbers, (MASS_kg, DAMPING, FRICTION_N), strict=True):
        assert number.interval is not None
        assert number.interval[0] < real < number.interval[1]
    free = fit_nominal(rig, records, [*KEYS, STIFFNESS_KEY])
    assert free.doubts == ()
    assert found(free)["loader.mass_kg"] == pytest.approx(MASS_kg, rel=0.03)
    assert found(free)[STIFFNESS_KEY] == pytest.approx(FRICTION_N / 3e-3, rel=0.2)
    assert free.rig.controls["column"].loader.friction_stiffness == found(free)[STIFFNESS_KEY]


@pytest.mark.slow
def test_a_fit_that_lacks_what_the_machine_has_is_doubtful() -> None:
    """The interval of the gradient excluded it beside a spring that hardens, without a word."""
    rig = plain_rig(100.0, {"mass_kg": 0.8, "damping_N_s_per_m": 2.0}, 3000.0)
    keys = [f"loader.{key}" for key in ("mass_kg", "damping_N_s_per_m", "basic_gradient_N_per_m")]
    records = {"r": duffing()}
    (doubt,) = fit_nominal(rig, records, keys).doubts
    assert doubt.startswith("the residual of column_computed_m is ")
    assert not fit_nominal(rig, records, [*keys, "loader.cubic_N_per_m3"]).doubts


@pytest.mark.slow
def test_what_differs_between_records_is_no_reason_for_doubt() -> None:
    """Friction of 4 and of 5 N: the fit to both misses each, and its interval holds both."""
    fitted = fit_nominal(
        slide(), {str(dry_N): moved([0.05, 0.1, 0.2], dry_N) for dry_N in (4.0, 5.0)}, KEYS
    )
    assert max(one.after / one.floor for one in fitted.channels) > 3.0
    assert not fitted.doubts


def yielding(seconds: float = 20.0, steps: int = 20) -> Record:
    """Return a record of an imposed motion against friction that yields by 0.3 mm."""
    time = np.arange(round(seconds * RATE_Hz * steps)) / (RATE_Hz * steps)
    place, speed, gained = (np.zeros_like(time) for _ in range(3))
    for most, turn in ((0.06, 0.5), (0.03, 1.4), (0.01, 3.1), (0.004, 7.0)):
        place += most * (1.0 - np.cos(turn * time))
        speed += most * turn * np.sin(turn * time)
        gained += most * turn**2 * np.cos(turn * time)
    bent, bends = 0.0, np.empty_like(time)
    for k, step in enumerate(np.diff(place, prepend=0.0).tolist()):
        bent = min(max(bent + step, -3e-4), 3e-4)
        bends[k] = bent
    pull = MASS_kg * gained + DAMPING * speed + FRICTION_N * bends / 3e-4
    read = np.column_stack((pull, place))[::steps]
    read += (0.02, 2e-6) * np.random.default_rng(3).standard_normal(read.shape)
    return recorded(RATE_Hz, force_N=read[:, 0], computed_m=read[:, 1])


@pytest.mark.slow
def test_friction_that_yields_is_not_fitted_as_play_and_delay() -> None:
    """A rigid friction with both is a local minimum, from which the fit did not come back."""
    rig = slide().changed({"controls.column.drive": "displacement", FRICTION: 0.0})
    keys = (*KEYS, "loader.delay_s", "loader.play_m")
    fitted = fit_nominal(rig, {"r": yielding()}, keys)
    real = dict(zip(keys, (MASS_kg, DAMPING, FRICTION_N, 0.0, 0.0), strict=True))
    assert found(fitted) == pytest.approx(real, rel=0.02, abs=2e-5)
    assert fitted.channels[0].after < 1.1 * fitted.channels[0].floor


def test_a_number_that_the_records_do_not_determine_stays_as_filed(tmp_path: Path) -> None:
    """A mass of 8 kg in motion whose inertia is a ten-thousandth of the force."""
    rng = np.random.default_rng(6)
    time = np.arange(round(50.0 * RATE_Hz)) / RATE_Hz
    rate = 2.0 * np.pi * 0.02
    place, speed = 0.2 * np.sin(rate * time), 0.2 * rate * np.cos(rate * time)
    pull = 300.0 * speed - MASS_kg * rate**2 * place + rng.normal(0.0, 10.0, len(time))
    names = ("time_s", "column_force_N", "column_deflection_m")
    record = Record(names, np.column_stack((time, pull, place + rng.normal(0, 1e-6, len(time)))))
    absent = {"friction_N": 0.0, "servo_frequency_Hz": 0.0}
    start = slide().changed({f"controls.column.loader.{key}": v for key, v in absent.items()})
    fitted = fit_nominal(start, {"r": record}, KEYS[:2])
    assert fitted.unknown == ("loader.mass_kg",)
    mass, damping = fitted.numbers
    assert (mass.found, mass.half) == (10.0, None)
    least_N_s_per_m = 1.96 * 10.0 / np.sqrt(speed @ speed)  # half the interval by the noise alone
    assert damping.half == pytest.approx(least_N_s_per_m, rel=0.3)
    assert damping.found == pytest.approx(300.0, abs=damping.half)
    assert set(fitted.rig.controls["column"].tolerance) == {"loader.damping_N_s_per_m"}
    write_record(record, tmp_path / "r.csv")
    (tmp_path / "start.toml").write_text(rig_text(start))
    words = "fit r.csv --rig start.toml --free loader.mass_kg --free loader.damping_N_s_per_m"
    said = coupled(tmp_path, *words.split()).stdout
    assert "not determined by these records: loader.mass_kg; it stays as filed" in said


@pytest.mark.slow
def test_the_numbers_of_a_loader_and_a_servo_are_found_and_kept_for_a_diagnosis(
    tmp_path: Path,
) -> None:
    real = nominal_rig(False)
    record = made(tmp_path, real, {}, 5).between(0.0, 20.0)
    loader = "controls.column.loader."
    off = {"mass_kg": 5.0, "damping_N_s_per_m": 60.0, "servo_frequency_Hz": 14.0, "friction_N": 1.0}
    start = real.changed({loader + key: value for key, value in off.items()})
    keys = [f"loader.{key}" for key in off]
    fitted = fit_nominal(start, {"r": record}, keys)
    truth = {"mass_kg": 4.0, "damping_N_s_per_m": 75.0, "servo_frequency_Hz": 18.0}
    for number in fitted.numbers:
        wanted = truth.get(number.key.removeprefix("loader."), 0.0)
        assert number.interval is not None
        low, high = number.interval
        assert low - 1e-9 <= wanted <= high
    known = fitted.rig.controls["column"].tolerance
    assert set(known) == set(keys)
    assert known["loader.mass_kg"] < 0.2
    assert all(one.after < 1.1 * one.floor for one in fitted.channels)
    # A machine whose mass is off by no more than it is known is as it was; then by more.
    text = rig_text(fitted.rig)
    (tmp_path / "fitted.toml").write_text(text)
    assert read_rig(tmp_path / "fitted.toml") == fitted.rig
    loose = fitted.rig.changed({"controls.column.tolerance": {"loader.mass_kg": 1.2}})
    heavy = made(tmp_path, real.changed({loader + "mass_kg": 4.8}), {}, 6).between(0.0, 15.0)
    assert diagnose(loose, {"r": heavy}).verdict == "no_gap"
    diagnosed = diagnose(fitted.rig, {"r": heavy})
    assert [effect.name for effect in diagnosed.effects] == ["inertia"]
    assert diagnosed.verdict == "effect"


def test_a_rig_file_keeps_its_comments_and_order() -> None:
    text = '# mine\nname = "a"  # a name\n\n[b]\nx = 1.0 # of x\ny = 2.0\n'
    new = edited(text, {("b", "x"): 3.0, ("b", "t", "loader.m"): 0.5}, "said\nof it")
    assert new.startswith('# said\n# of it\n# mine\nname = "a"  # a name\n')
    assert "x = 3.0 # of x\ny = 2.0\n" in new
    assert '[b.t]\n"loader.m" = 0.5\n' in new
    between = edited("[a]\nx = 1\n\n[c]\ny = 2\n", {("a", "t", "m"): 0.5})
    assert between == "[a]\nx = 1\n\n[a.t]\nm = 0.5\n\n[c]\ny = 2\n"
    rig = slide()
    other = rig.changed({"controls.column.loader.mass_kg": 11.0, "noise": {"column_force_N": 0.1}})
    assert differences(rig, other) == {
        ("controls", "column", "loader", "mass_kg"): 11.0,
        ("noise", "column_force_N"): 0.1,
    }


def test_what_cannot_be_fitted_is_refused() -> None:
    record = moved([0.1] * 5)
    for key, why in (
        ("loader.mass", "unknown key"),
        ("loader.servo_frequency_Hz", "they lack column_deflection_m"),
        ("loader.multiplier", "not a single number"),
        ("hand.mass_kg", "no number to fit"),
    ):
        with pytest.raises(InputError, match=why):
            fit_nominal(slide(), {"r": record}, [key])


def test_the_command_writes_a_rig_that_a_diagnosis_takes(tmp_path: Path) -> None:
    write_record(moved([0.02, 0.05, 0.1, 0.03, 0.08, 0.15]), tmp_path / "well.csv")
    (tmp_path / "start.toml").write_text("# my slide\n" + rig_text(slide()))
    words = "fit well.csv --rig start.toml -o new.toml --json new.json"
    words += " --free loader.mass_kg --free loader.friction_N"
    done = coupled(tmp_path, *words.split())
    assert done.returncode == 0, done.stderr
    assert "# my slide" in (tmp_path / "new.toml").read_text()
    table = json.loads((tmp_path / "new.json").read_text())
    mass = read_rig(tmp_path / "new.toml").controls["column"].loader.mass
    assert mass == table["numbers"]["loader.mass_kg"]["found"]
    assert "loader.mass_kg" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(not FOUNDERS.is_dir(), reason="the measured records lie beside the project")
def test_a_measured_axis_has_the_published_numbers() -> None:
    """EMPS: M = 95.1 kg, Fv = 203.5 N·s/m, Fc = 20.4 N, offset −3.2 N on the other side."""
    start = read_rig(FOUNDERS / "emps-train.toml")
    fitted = fit_nominal(start, {"r": read_record(FOUNDERS / "emps-train.csv")})
    published = {"mass_kg": 95.1, "damping_N_s_per_m": 203.5, "friction_N": 20.4, "offset_N": 3.2}
    for number in fitted.numbers:
        wanted = published.get(number.key.removeprefix("loader."))
        if wanted is not None:
            assert number.interval is not None
            assert number.interval[0] < wanted < number.interval[1]


def test_an_interval_of_a_fit_ends_where_a_rig_file_does() -> None:
    """Of `friction_elastic_share`, 0 to 0.99, which a record of brief slips hardly determines."""
    number = Number("loader.friction_elastic_share", 0.3, 0.4, 2.0, least=0.0, greatest=0.99)
    assert number.interval == (0.0, 0.99)
    assert number.as_dict()["high"] == 0.99
