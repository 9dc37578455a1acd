"""Gymnasium environments: one skydiver, or many in step.

``gymnasium.make("bodyflight/Skydiver-v0", task="turn")`` after ``import bodyflight.gym``; ``SkydiverVectorEnv`` flies
thousands at once. An action holds movement patterns (``Skydivers.controls``) as shares of a person's range; joints follow
as fast as a person's. An observation is what a suit sees (``observed`` below), scaled to about one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ._native import Skydivers

#: Largest component of an observation, in its scale; far beyond what a person flies.
LIMIT = 100.0
#: Seconds of flight until an episode is truncated.
DURATION = 10.0


@dataclass(frozen=True)
class Task:
    """What is rewarded: the errors of an attitude, a heading, a place, each over its scale."""

    start: str
    #: Component of the upwards direction in body axes (left, dorsal, cranial) that is wanted.
    up: tuple[float, float, float]
    #: Heading that is wanted against that of the start (rad), drawn within this range.
    turn: tuple[float, float] = (0.0, 0.0)
    #: Largest distance over ground at which a place to fly to is drawn (m).
    reach: float = 0.0


TASKS = {
    "hold": Task("neutral", (0.0, 1.0, 0.0)),
    "turn": Task("neutral", (0.0, 1.0, 0.0), turn=(-np.pi, np.pi)),
    "dock": Task("neutral", (0.0, 1.0, 0.0), reach=5.0),
    "transition": Task("neutral", (0.0, -1.0, 0.0)),
}

_SCALE = np.array([1, 1, 1, 1, 1, 5, 5, 5, 60, 60, 60, 10, 10, 10, 20, 60], dtype=np.float32)
_PLACE = [Skydivers.observed.index(name) for name in ("position_north_m", "position_west_m", "position_up_m")]
_SPIN = slice(5, 8)
#: Observed by every task: the suit's numbers without the place, the turn that is left, the place against the target.
OBSERVED = [name for i, name in enumerate(Skydivers.observed) if i not in _PLACE] + [
    "turn_left_sin",
    "turn_left_cos",
    "target_ahead_m",
    "target_left_m",
]


class _Flights:
    """n flights with their targets: what both environments share."""

    def __init__(self, count: int, task: str, **options: Any) -> None:
        if task not in TASKS:
            raise ValueError(f"no task {task!r}; there are: {', '.join(TASKS)}")
        self.task = TASKS[task]
        self.skydivers = Skydivers(count, start=self.task.start, **options)
        self.limit = round(DURATION / self.skydivers.time_step)
        self.steps = np.zeros(count, dtype=np.int64)
        self.heading = np.zeros(count, dtype=np.float32)
        self.target = np.zeros((count, 2), dtype=np.float32)
        self.origin = np.zeros((count, 2), dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(Skydivers.controls),), np.float32)
        self.observation_space = spaces.Box(-LIMIT, LIMIT, (len(OBSERVED),), np.float32)

    def reset(self, random: np.random.Generator, which: np.ndarray | None = None) -> np.ndarray:
        seen = self.skydivers.reset(which)
        again = np.ones(len(seen), dtype=bool) if which is None else which
        count = int(again.sum())
        self.steps[again] = 0
        self.heading[again] = random.uniform(*self.task.turn, size=count)
        angle = random.uniform(0.0, 2.0 * np.pi, size=count)
        distance = self.task.reach * np.sqrt(random.uniform(0.0, 1.0, size=count))
        self.origin[again] = seen[again][:, _PLACE[:2]]
        self.target[again] = self.origin[again] + np.stack([np.cos(angle), np.sin(angle)], axis=1) * distance[:, None]
        return self._observation(seen)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        actions = np.ascontiguousarray(actions, dtype=np.float32)
        seen = self.skydivers.step(actions)
        self.steps += 1
        finite = np.isfinite(seen).all(axis=1)
        tumbling = np.abs(seen[:, _SPIN]).max(axis=1, initial=0.0, where=np.isfinite(seen[:, _SPIN])) > 15.0
        terminated = ~finite | tumbling
        return self._observation(seen), self._reward(seen, actions, terminated), terminated, self.steps >= self.limit

    def _turn_left(self, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sine and cosine of the wanted heading minus that flown."""
        sin, cos = seen[:, 3], seen[:, 4]
        wanted_sin, wanted_cos = np.sin(self.heading), np.cos(self.heading)
        return wanted_sin * cos - wanted_cos * sin, wanted_cos * cos + wanted_sin * sin

    def _observation(self, seen: np.ndarray) -> np.ndarray:
        sin, cos = self._turn_left(seen)
        way = self.target - seen[:, _PLACE[:2]]
        ahead = way[:, 0] * seen[:, 4] + way[:, 1] * seen[:, 3]
        left = way[:, 1] * seen[:, 4] - way[:, 0] * seen[:, 3]
        scaled = np.delete(seen / _SCALE, _PLACE, axis=1)
        extra = np.stack([sin, cos, ahead / 10.0, left / 10.0], axis=1)
        observed = np.concatenate([scaled, extra], axis=1)
        return np.clip(np.nan_to_num(observed), -LIMIT, LIMIT).astype(np.float32)

    def _reward(self, seen: np.ndarray, actions: np.ndarray, terminated: np.ndarray) -> np.ndarray:
        upright = seen[:, :3] @ np.array(self.task.up, dtype=np.float32)
        _, facing = self._turn_left(seen)
        distance = np.linalg.norm(self.target - seen[:, _PLACE[:2]], axis=1)
        reward = 0.5 * (1.0 + upright) - 0.01 * np.square(actions).mean(axis=1)
        if self.task.reach:
            reward += np.exp(-distance / 2.0)
        elif self.task.up[1] > 0.0:
            reward += 0.5 * (1.0 + facing)
        return np.where(terminated, -10.0, np.nan_to_num(reward)).astype(np.float32)


class SkydiverEnv(gymnasium.Env):
    """One skydiver; 30 actions a second. Tasks: ``hold``, ``turn``, ``dock``, ``transition``.

    An episode ends after ten seconds (truncated), or as soon as the body tumbles (terminated).
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, task: str = "hold", **options: Any) -> None:
        self._flights = _Flights(1, task, **options)
        self.action_space = self._flights.action_space
        self.observation_space = self._flights.observation_space

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        super().reset(seed=seed)
        return self._flights.reset(self.np_random)[0], {}

    def step(self, action):
        seen, reward, terminated, truncated = self._flights.step(np.asarray(action)[None, :])
        return seen[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), {}


class SkydiverVectorEnv(VectorEnv):
    """Many skydivers in step, on all cores; those whose episode has ended begin anew with the next step."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, num_envs: int, task: str = "hold", **options: Any) -> None:
        self.num_envs = num_envs
        self._flights = _Flights(num_envs, task, **options)
        self._ended = np.zeros(num_envs, dtype=bool)
        self.single_action_space = self._flights.action_space
        self.single_observation_space = self._flights.observation_space
        #: Steps of an episode that is not ended before.
        self.episode_steps = self._flights.limit
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        super().reset(seed=seed)
        self._ended[:] = False
        return self._flights.reset(self.np_random), {}

    def step(self, actions):
        begun = self._ended.copy()
        seen, reward, terminated, truncated = self._flights.step(actions)
        if begun.any():
            seen = self._flights.reset(self.np_random, begun)
            reward[begun] = 0.0
            terminated[begun] = False
            truncated[begun] = False
        self._ended = terminated | truncated
        return seen, reward, terminated, truncated, {}


gymnasium.register(id="bodyflight/Skydiver-v0", entry_point=SkydiverEnv, vector_entry_point=SkydiverVectorEnv)
