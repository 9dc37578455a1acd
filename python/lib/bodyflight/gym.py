"""Gymnasium environments with one skydiver, or with many that fly in parallel.

``import bodyflight.gym`` registers ``bodyflight/Skydiver-v0``: ``gymnasium.make("bodyflight/Skydiver-v0", task="turn")``.
``SkydiverVectorEnv`` flies thousands of skydivers at once. An action (8 numbers, -1 to 1) sets the movement patterns
``Skydivers.controls`` to shares of a person's range; joints follow no faster than a person moves them. An observation (17
numbers) holds what a motion-capture suit measures and the goal of the task, scaled to about one; ``OBSERVED`` names them.

``info`` holds the terms whose sum is the reward, ``reward_upright`` and so on, and ``is_success``: whether the body is still and
where the task wants it to be. Environments can be copied and pickled in the middle of an episode. With
``render_mode="rgb_array"``, ``render`` draws the body from outside; a green mark points to the goal. ``bodyflight.goal`` has
environments with goal dictionaries.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ._native import Environments, Skydivers

#: Largest magnitude of a component of an observation, after scaling; far beyond what a person flies.
LIMIT = Environments.limit
#: Time after which an episode is truncated (s).
DURATION = 10.0
#: Keys of the terms of a reward in ``info``.
REWARD_TERMS = [f"reward_{name}" for name in Environments.reward_terms]

_Observation = NDArray[np.float32]


@dataclass(frozen=True)
class Task:
    """How an episode starts, and which attitude, heading and place are rewarded."""

    start: str
    #: Wanted upward direction in body axes (left, dorsal, cranial).
    up: tuple[float, float, float]
    #: Range from which the wanted heading is drawn, relative to the heading at the start (rad).
    turn: tuple[float, float] = (0.0, 0.0)
    #: Largest horizontal distance at which a target is drawn (m); 0 for tasks without a target.
    reach: float = 0.0


TASKS = {
    "hold": Task("neutral", (0.0, 1.0, 0.0)),
    "turn": Task("neutral", (0.0, 1.0, 0.0), turn=(-np.pi, np.pi)),
    "dock": Task("neutral", (0.0, 1.0, 0.0), reach=5.0),
    "transition": Task("neutral", (0.0, -1.0, 0.0)),
}

#: Names of the 17 components of an observation, with the units they have before scaling: the body's attitude, angular velocity
#: and velocity, the remaining turn, and the place of the target as seen from the body.
OBSERVED = Environments.observed


class _Flights:
    """n environments with their goals, shared by the single and the vector environment."""

    def __init__(self, count: int, task: str, max_episode_steps: int | None = None, **options: Any) -> None:
        if task not in TASKS:
            raise ValueError(f"unknown task {task!r}; expected one of: {', '.join(TASKS)}")
        self.task = TASKS[task]
        docks = self.task.reach > 0.0
        seconds = DURATION
        if max_episode_steps is not None:
            seconds = max_episode_steps * Skydivers(1, **options).time_step
        self.environments = Environments(
            count,
            up=self.task.up,
            faces=not docks and self.task.up[1] > 0.0,
            docks=docks,
            seconds=seconds,
            start=self.task.start,
            **options,
        )
        self.limit = self.environments.episode_steps
        self.action_space = spaces.Box(-1.0, 1.0, (len(Skydivers.controls),), np.float32)
        self.observation_space = spaces.Box(-LIMIT, LIMIT, (len(OBSERVED),), np.float32)

    def begin(self, random: np.random.Generator, which: np.ndarray) -> None:
        """Draws goals for the environments whose entry of ``which`` (n) is true, and restarts them."""
        count = int(which.sum())
        headings = np.zeros(len(which), dtype=np.float32)
        targets = np.zeros((len(which), 2), dtype=np.float32)
        headings[which] = random.uniform(*self.task.turn, size=count)
        angle = random.uniform(0.0, 2.0 * np.pi, size=count)
        distance = self.task.reach * np.sqrt(random.uniform(0.0, 1.0, size=count))
        targets[which] = np.stack([np.cos(angle), np.sin(angle)], axis=1) * distance[:, None]
        self.environments.begin(which, headings, targets)

    def restart(self, random: np.random.Generator) -> None:
        """Restarts everything, with goals drawn from ``random``."""
        self.begin(random, np.ones(len(self.environments), dtype=bool))


def _check(render_mode: str | None, known: list[str]) -> None:
    if render_mode is not None and render_mode not in known:
        raise ValueError(
            f"render_mode: expected one of metadata['render_modes'], which is {known}, or None, found {render_mode!r}"
        )


class SkydiverEnv(gymnasium.Env[_Observation, _Observation]):
    """One skydiver with 30 actions a second. Tasks: ``hold``, ``turn``, ``dock``, ``transition``.

    An episode is truncated after ten seconds, and terminated as soon as the body tumbles. ``gymnasium.make`` counts steps: those
    of ten seconds with the usual 30 actions a second, unless it is given ``max_episode_steps``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 30}  # type: ignore[misc]

    def __init__(
        self,
        task: str = "hold",
        *,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
        **options: Any,
    ) -> None:
        _check(render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        #: Size of a picture (pixels).
        self.width, self.height = width, height
        self._flights = _Flights(1, task, **options)
        self._flies = np.zeros(1, dtype=bool)
        self.action_space = self._flights.action_space
        self.observation_space = self._flights.observation_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Observation, dict[str, Any]]:
        super().reset(seed=seed)
        self._flights.restart(self.np_random)
        return self._flights.environments.observe()[0], {}

    def step(self, action: ArrayLike) -> tuple[_Observation, float, bool, bool, dict[str, Any]]:
        flown = self._flights.environments.step(np.asarray(action)[None], self._flies)
        seen, reward, terminated, truncated, terms, success = flown
        info = dict(zip(REWARD_TERMS, map(float, terms[0])), is_success=bool(success[0]))
        return seen[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Returns a picture, ``height`` by ``width`` by 3; None without a ``render_mode``."""
        if self.render_mode is None:
            return None
        return self._flights.environments.render(0, self.width, self.height)

    def get_state(self) -> NDArray[np.float32]:
        """Returns everything that the flight consists of, in the order of ``Environments.state_names``."""
        state: NDArray[np.float32] = self._flights.environments.get_state()[0]
        return state

    def set_state(self, state: ArrayLike) -> _Observation:
        """Continues the flight from a state, to the bit. Returns the observation."""
        self._flights.environments.set_state(np.asarray(state)[None])
        seen: _Observation = self._flights.environments.observe()[0]
        return seen


class SkydiverVectorEnv(VectorEnv):
    """Many skydivers in parallel, on all cores. An environment whose episode has ended is reset by the next step."""

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": ["rgb_array"],
        "render_fps": 30,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int,
        task: str = "hold",
        *,
        render_mode: str | None = None,
        width: int = 480,
        height: int = 480,
        max_episode_steps: int | None = None,
        **options: Any,
    ) -> None:
        _check(render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        #: Size of a picture (pixels).
        self.width, self.height = width, height
        self.num_envs = num_envs
        self._flights = _Flights(num_envs, task, max_episode_steps, **options)
        self._ended = np.zeros(num_envs, dtype=bool)
        self.single_action_space = self._flights.action_space
        self.single_observation_space = self._flights.observation_space
        #: Steps after which an episode is truncated.
        self.episode_steps = self._flights.limit
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Observation, dict[str, Any]]:
        super().reset(seed=seed)
        self._ended = np.zeros(self.num_envs, dtype=bool)
        self._flights.restart(self.np_random)
        return self._flights.environments.observe(), {}

    def step(
        self, actions: ArrayLike
    ) -> tuple[_Observation, NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        resting = self._ended
        if resting.any():
            self._flights.begin(self.np_random, resting)
        flown = self._flights.environments.step(actions, resting)
        seen, reward, terminated, truncated, terms, success = flown
        self._ended = terminated | truncated
        info: dict[str, Any] = {"is_success": success, **dict(zip(REWARD_TERMS, terms.T))}
        # Gymnasium's masks: which environments say something.
        info.update({f"_{key}": ~resting for key in list(info)})
        return seen, reward, terminated, truncated, info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:  # type: ignore[override]
        """Returns a picture of each environment, ``height`` by ``width`` by 3; None without a ``render_mode``."""
        if self.render_mode is None:
            return None
        size = (self.width, self.height)
        return tuple(self._flights.environments.render(index, *size) for index in range(self.num_envs))

    def get_state(self) -> NDArray[np.float32]:
        """Returns everything that the flights consist of, n by 35 in the order of ``Environments.state_names``."""
        return self._flights.environments.get_state()

    def set_state(self, state: ArrayLike) -> _Observation:
        """Continues the flights from a state, to the bit. Returns the observations."""
        self._flights.environments.set_state(state)
        self._ended = np.zeros(self.num_envs, dtype=bool)
        return self._flights.environments.observe()


gymnasium.register(
    id="bodyflight/Skydiver-v0",
    entry_point="bodyflight.gym:SkydiverEnv",
    vector_entry_point="bodyflight.gym:SkydiverVectorEnv",
    max_episode_steps=_Flights(1, "hold").limit,
)
