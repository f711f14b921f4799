"""The gymnasium environment: its own checks, its forces, and that seeds repeat."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import coupled
from coupled.envs import NAME, LoaderEnv
from coupled.flight.manoeuvre import CONFIGURATIONS, Configuration

COLUMN = "report-column"
TURBULENCE = {"wind_at_6m_m_per_s": 10.0}


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"rig": COLUMN, "configuration": "uncompensated", "observed": ["pitch_rad", "alpha_rad"]},
        {"rig": "737", "controls": ["wheel", "pedals"], "terms": {"turbulence": TURBULENCE}},
    ],
)
def test_gymnasium_s_own_check_passes(options: dict[str, Any]) -> None:
    made = gymnasium.make(NAME, **options)
    check_env(made.unwrapped)
    made.close()


def episode(env: LoaderEnv, seed: int | None) -> list[np.ndarray[Any, Any]]:
    rng, seen = np.random.default_rng(1), [env.reset(seed=seed)[0]]
    for _ in range(10):
        seen.append(env.step(rng.uniform(-0.3, 0.3, 1))[0])
    return seen


def test_a_seed_repeats_an_episode() -> None:
    noisy = coupled.load_rig(COLUMN).changed({"noise.column_force_N": 0.5})
    one, other = LoaderEnv(noisy), LoaderEnv(noisy)
    first, again, there, unseeded = (
        episode(env, seed) for env, seed in ((one, 3), (one, 3), (other, 3), (one, None))
    )
    assert np.array_equal(first, again) and np.array_equal(first, there)
    assert not np.array_equal(first, unseeded)
    drawn: Any = np.int64(3)
    assert np.array_equal(episode(one, drawn), first)
    episode(other, 3)
    assert np.array_equal(episode(other, None), unseeded)


def test_an_action_is_a_share_of_the_force_limit_and_the_reward_is_the_task_s() -> None:
    env = LoaderEnv(COLUMN, force_limit_N=80.0, change_rad=0.02, frames=3)
    env.reset(seed=1)
    started = env.session.state.pitch_rad
    _, reward, ended, over, said = env.step(np.array([0.5]))
    state = env.session.state
    assert state.column_hand_force_N == 40.0 and state.time_s == 3 / 120
    error = state.pitch_rad - started - 0.02
    assert reward == pytest.approx(-((error / 0.1) ** 2) - 0.01 * 0.25)
    assert (ended, over, said) == (False, False, {})


def test_a_reward_of_the_user_s_own_and_the_ground() -> None:
    low = coupled.load_rig(COLUMN).changed({"flight.altitude_m": 60.0})
    env = LoaderEnv(low, reward=lambda state, action: state.altitude_m)
    env.reset(seed=1)
    for _ in range(400):
        _, reward, ended, over, said = env.step(np.array([-0.5]))
        assert reward == env.session.state.altitude_m
        if ended:
            break
    assert (ended, over) == (True, False) and "met the ground" in said["ended_early"]


@pytest.mark.parametrize("configuration", CONFIGURATIONS)
def test_an_episode_is_a_flight_of_its_configuration(configuration: Configuration) -> None:
    env = LoaderEnv(COLUMN, configuration, observed=["column_surface_norm", "pitch_rad"])
    env.reset(seed=1)
    seen = [env.step(np.array([0.4]))[0].tolist() for _ in range(10)]
    with coupled.Session(COLUMN, configuration=configuration) as session:
        for k in range(60):
            state = session.step(column_force_N=60.0)
            if k % 6 == 5:
                assert seen[k // 6] == [state.column_surface_norm, state.pitch_rad]


def test_gymnasium_truncates_an_episode() -> None:
    made = gymnasium.make(NAME, rig=COLUMN, max_episode_steps=2)
    made.reset(seed=1)
    assert [made.step(np.array([0.0]))[3] for _ in range(2)] == [False, True]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"controls": ["wheel"]}, "controls: the rig has no wheel"),
        ({"observed": ["pitch_deg"]}, "no channel pitch_deg; did you mean"),
        ({"frames": 0}, "frames: is 0; give more than 0"),
        ({"frames": 10**9}, "frames: is 1000000000; give more than 0, at most 10000"),
        ({"frames": 10**400}, "frames: is 10000.*; give more than 0, at most 10000"),
        ({"force_limit_N": 6000.0}, "force_limit_N: is 6000.0; give more than 0, at most 5000"),
        ({"change_rad": np.nan}, "change_rad: is nan; give an angle from -π to π"),
        ({"change_rad": 1e200}, r"change_rad: is 1e\+200; give an angle"),
        ({"observed": []}, "observed: needs at least one channel"),
        ({"terms": {"configuration": "rigid"}}, "terms.configuration: is an option itself"),
        ({"terms": {"column": lambda state: 1.0}}, "controls: needs at least one without a pilot"),
        ({"force_limit_N": "x"}, "force_limit_N: is 'x'; give a number"),
        ({"configuration": "soft"}, "configuration: is 'soft'"),
        ({"controls": []}, "controls: needs at least one"),
    ],
)
def test_a_wrong_option_is_one_line(options: dict[str, Any], said: str) -> None:
    with pytest.raises(coupled.InputError, match=said):
        LoaderEnv(COLUMN, **options)


@pytest.mark.parametrize("value", [None, np.nan, "1"])
def test_a_reward_that_is_no_number_is_one_line(value: Any) -> None:
    env = LoaderEnv(COLUMN, reward=lambda state, action: value)
    env.reset(seed=1)
    with pytest.raises(coupled.InputError, match=r"reward: returned .*; return a number"):
        env.step([0.1])


def test_an_action_moves_the_controls_without_a_pilot_each_once() -> None:
    held: dict[str, Any] = {"column": lambda state: 0.0}
    assert LoaderEnv("c172p", terms=held).action_space.shape == (2,)
    with pytest.raises(coupled.InputError, match="controls: has a pilot; known"):
        LoaderEnv("c172p", controls=["column"], terms=held)
    assert LoaderEnv("c172p", controls=["wheel", "wheel"]).action_space.shape == (1,)


@pytest.mark.parametrize("action", [[2.0], [0.1, 0.1], "x", [np.nan], None])
def test_a_wrong_action_is_one_line(action: Any) -> None:
    env = LoaderEnv(COLUMN)
    env.reset()
    with pytest.raises(coupled.InputError, match=r"action: is .*; give 1 from -1 to 1"):
        env.step(action)


def test_without_gymnasium_one_line_says_how_to_install_it() -> None:
    code = "import sys; sys.modules['gymnasium'] = None; import coupled.envs"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert "coupled.envs: needs gymnasium: pip install 'coupled[gym]'" in done.stderr
