"""A gymnasium environment: an aircraft flown through a compliant control loader.

    import gymnasium, coupled.envs
    env = gymnasium.make("coupled/Loader-v0", rig="t37", configuration="uncompensated")

The package `gymnasium` is that of the extra `coupled[gym]`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from coupled.api.sessions import Session
from coupled.arguments import checks_itself, public
from coupled.errors import InputError, nearest
from coupled.flight.manoeuvre import Configuration, Manoeuvre
from coupled.flight.pilot.base import STRONGEST
from coupled.flight.state import State
from coupled.record.channels import ATTITUDE, ControlName
from coupled.rig.rig import Rig
from coupled.schema import LARGEST

try:
    import gymnasium
    from gymnasium import spaces
except ImportError:
    raise InputError("coupled.envs", "", "needs gymnasium: pip install 'coupled[gym]'") from None

NAME = "coupled/Loader-v0"
_ENV = "coupled.LoaderEnv"
_MOST_FRAMES = 10_000  # of a step, over a minute
_STEPS = 400  # of an episode, after which it is truncated
Floats = NDArray[np.float64]
Stepped = tuple[Floats, SupportsFloat, bool, bool, dict[str, Any]]
Reward = Callable[[State, Floats], float]


@public
class LoaderEnv(gymnasium.Env[Floats, Floats]):
    """A flight as an environment: forces of the hands in, a state out.

    rig, configuration, terms   as those of `Session`: `terms` are its further keywords
    controls       that the action moves; all of the rig by default
    force_limit_N  of each, largest force; an action is from −1 to 1 of it, a pull positive
    observed       channels of the observation; by default the motion, and each control's δ and F
    reward         function of the state and the action; by default the task's
    change_rad     the default task: capture this change of the attitude of the first control
    frames         of the flight for one step

    The default reward is −(attitude error/0.1 rad)² − 0.01·|action|², a step. An episode terminates
    where the flight ends early, and is truncated after `max_episode_steps` of `gymnasium.make`
    (400). `reset(seed=…)` is the seed of noise, turbulence and gusts.
    Raises InputError as `Session` does.

    >>> import coupled.envs
    >>> env = coupled.envs.LoaderEnv("report-column", observed=["pitch_rad", "column_force_N"])
    >>> seen, _ = env.reset(seed=1)
    >>> seen, reward, ended, over, _ = env.step([0.2])
    >>> float(seen[1]), env.session.time_s
    (30.0, 0.05)
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        rig: Manoeuvre | Rig | str = "t37",
        configuration: Configuration | None = None,
        controls: Sequence[ControlName] | None = None,
        force_limit_N: float = 150.0,
        observed: Sequence[str] | None = None,
        reward: Reward | None = None,
        change_rad: float = 0.05,
        frames: int = 6,
        terms: Mapping[str, Any] | None = None,
    ) -> None:
        limits = {"force_limit_N": (force_limit_N, STRONGEST), "frames": (frames, _MOST_FRAMES)}
        for key, (value, most) in limits.items():
            if not 0.0 < value <= most:
                problem = f"is {value!r:.40}; give more than 0, at most {most:g}"
                raise InputError(_ENV, key, problem)
        if not abs(change_rad) <= math.pi:
            raise InputError(_ENV, "change_rad", f"is {change_rad}; give an angle from -π to π")
        given = dict(terms or {})
        if "configuration" in given:
            raise InputError(_ENV, "terms.configuration", "is an option itself; give it there")
        self._session = Session(rig, configuration=configuration, **given)
        known, free = self._session.rig.controls, self._session.controls
        self._controls = list(dict.fromkeys(free if controls is None else controls))
        for control in self._controls:
            if control not in free:
                problem = "has a pilot" if control in known else f"the rig has no {control}"
                raise InputError(_ENV, "controls", f"{problem}; {nearest(control, free)}")
        if not self._controls:
            raise InputError(_ENV, "controls", "needs at least one without a pilot")
        state = self._session.state
        self.observed = tuple(_usual(state, self._controls) if observed is None else observed)
        if not self.observed:
            raise InputError(_ENV, "observed", "needs at least one channel")
        for channel in self.observed:
            state[channel]  # raises InputError for an unknown channel
        self._limit_N, self._frames = force_limit_N, frames
        self._angle, self._change_rad = ATTITUDE[self._controls[0]], change_rad
        if reward is None and self._angle not in state:
            problem = f"is needed: {self._session.rig.name} has no aircraft whose attitude to hold"
            raise InputError(_ENV, "reward", problem)
        self._reward = reward or self._task
        self._started_rad = state.as_dict().get(self._angle, 0.0)
        moved, seen = (len(self._controls),), (len(self.observed),)
        self.action_space = spaces.Box(-1.0, 1.0, moved, np.float64)
        self.observation_space = spaces.Box(-LARGEST, LARGEST, seen, np.float64)

    @property
    def session(self) -> Session:
        """The flight: its record, its switches and services."""
        return self._session

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Return to trim; return the first observation, and no further information.

        Without a seed it is drawn from the environment's generator.
        """
        super().reset(seed=None if seed is None else int(seed))  # not numpy.int64
        own = int(self.np_random.integers(2**31)) if seed is None else seed
        state = self._session.reset(own)
        self._started_rad = state.as_dict().get(self._angle, 0.0)
        return self._seen(state), {}

    @checks_itself
    def step(self, action: Floats | Sequence[float]) -> Stepped:
        """Fly one step with constant forces.

        Return the observation, the reward, whether the flight ended early, False (`gymnasium.make`
        truncates), and under `ended_early` the reason.
        """
        try:
            share = np.asarray(action, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):  # not numbers
            share = np.zeros(0)
        if share.shape != (len(self._controls),) or not np.all(np.abs(share) <= 1.0):
            problem = f"is {action!r:.60}; give {len(self._controls)} from -1 to 1"
            raise InputError(_ENV, "action", problem)
        session, forces = self._session, (self._limit_N * share).tolist()
        named: dict[str, Any] = {
            f"{name}_force_N": force for name, force in zip(self._controls, forces, strict=True)
        }
        state = session.state
        for _ in range(self._frames):
            state = session.step(**named)
            if session.ended_early:
                break
        ended = session.ended_early
        information = {"ended_early": ended} if ended else {}
        reward = self._reward(state, share)
        if not isinstance(reward, Real) or not math.isfinite(reward):
            raise InputError(_ENV, "reward", f"returned {reward!r:.60}; return a number")
        return self._seen(state), float(reward), bool(ended), False, information

    def close(self) -> None:
        """End the flight."""
        self._session.close()

    def _seen(self, state: State) -> Floats:
        return np.array([state[channel] for channel in self.observed])

    def _task(self, state: State, action: Floats) -> float:
        """Return the reward of capturing a change of attitude."""
        error = state[self._angle] - self._started_rad - self._change_rad
        return -((error / 0.1) ** 2) - 0.01 * float(action @ action)


def _usual(state: State, controls: Sequence[str]) -> list[str]:
    """Return the channels of the motion, and of each control's deflection and force as measured."""
    moving = [name for name in state if not name.startswith(("column_", "wheel_", "pedals_"))]
    hands = [
        name
        for name in state
        for control in controls
        if name.startswith((f"{control}_deflection_", f"{control}_force_N"))
    ]
    return [name for name in moving if name != "time_s"] + hands


gymnasium.register(NAME, entry_point="coupled.envs:LoaderEnv", max_episode_steps=_STEPS)
