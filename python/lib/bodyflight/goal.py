"""Environments with goal dictionaries, as hindsight experience replay and gymnasium-robotics have them.

``import bodyflight.goal`` registers ``bodyflight/SkydiverGoal-v0``: ``gymnasium.make("bodyflight/SkydiverGoal-v0",
task="turn")``. An observation is a dictionary with ``observation`` (13 numbers, what a motion-capture suit measures),
``achieved_goal`` and ``desired_goal``. A goal of ``turn`` is a heading as sine and cosine; one of ``dock`` is a place, north and
west of the start in units of ten metres. The reward follows from the two goals alone: 0 where the goal is reached and -1
elsewhere, or minus their distance with ``reward="dense"``.
"""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from ._native import Environments, Skydivers
from .gym import LIMIT, OBSERVED, SkydiverEnv

#: Tasks with a goal: distance between the two goals below which one is reached, and metres or radians per unit.
TASKS = {"turn": 2.0 * np.sin(np.radians(10.0) / 2.0), "dock": 0.05}
#: What is observed besides the goals.
BODY = [name for name in OBSERVED if name not in ("turn_left_sin", "turn_left_cos", "target_ahead_m", "target_left_m")]
#: Metres per unit of a place.
PLACE = 10.0

_STATE = {name: index for index, name in enumerate(Environments.state_names)}
_Goals = dict[str, NDArray[np.float32]]


class SkydiverGoalEnv(gymnasium.Env[_Goals, NDArray[np.float32]]):
    """One skydiver with a goal. Tasks: ``turn``, ``dock``. Options are those of ``bodyflight.gym.SkydiverEnv``."""

    metadata: ClassVar[dict[str, Any]] = SkydiverEnv.metadata  # type: ignore[misc]

    def __init__(self, task: str = "turn", *, reward: str = "sparse", **options: Any) -> None:
        if task not in TASKS:
            raise ValueError(f"unknown task {task!r}; expected one of: {', '.join(TASKS)}")
        if reward not in ("sparse", "dense"):
            raise ValueError(f"reward: expected 'sparse' or 'dense', found {reward!r}")
        self.task, self.reward = task, reward
        #: Distance between the goals below which one is reached.
        self.near = TASKS[task]
        self._env = SkydiverEnv(task, **options)
        self.render_mode = self._env.render_mode
        self.action_space = self._env.action_space
        goal = spaces.Box(-LIMIT, LIMIT, (2,), np.float32)
        body = spaces.Box(-LIMIT, LIMIT, (len(BODY),), np.float32)
        self.observation_space = spaces.Dict({"observation": body, "achieved_goal": goal, "desired_goal": goal})
        self._begun = np.zeros(2, dtype=np.float32)

    def _seen(self, observation: NDArray[np.float32]) -> _Goals:
        state = self.get_state()

        def taken(*names: str) -> NDArray[np.float32]:
            return state[[_STATE[name] for name in names]]

        if self.task == "turn":
            achieved = observation[[OBSERVED.index("heading_sin"), OBSERVED.index("heading_cos")]]
            desired = taken("wanted_heading_sin", "wanted_heading_cos")
        else:
            achieved = (taken("position_north_m", "position_west_m") - self._begun) / PLACE
            desired = (taken("target_north_m", "target_west_m") - self._begun) / PLACE
        kept = np.clip(achieved, -LIMIT, LIMIT).astype(np.float32)
        return {"observation": observation[: len(BODY)], "achieved_goal": kept, "desired_goal": desired}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Goals, dict[str, Any]]:
        super().reset(seed=seed)
        observation, info = self._env.reset(seed=seed, options=options)
        state = self.get_state()
        self._begun = state[[_STATE["position_north_m"], _STATE["position_west_m"]]]
        return self._seen(observation), info

    def step(self, action: ArrayLike) -> tuple[_Goals, float, bool, bool, dict[str, Any]]:
        observation, _, terminated, truncated, info = self._env.step(action)
        seen = self._seen(observation)
        info["is_success"] = bool(self._distance(seen["achieved_goal"], seen["desired_goal"]) < self.near)
        reward = float(self.compute_reward(seen["achieved_goal"], seen["desired_goal"], info))
        return seen, reward, terminated, truncated, info

    @staticmethod
    def _distance(achieved: ArrayLike, desired: ArrayLike) -> NDArray[np.float64]:
        apart = np.asarray(achieved, dtype=float) - np.asarray(desired, dtype=float)
        distance: NDArray[np.float64] = np.linalg.norm(apart, axis=-1)
        return distance

    def compute_reward(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any) -> NDArray[np.float64]:
        """Returns the rewards of goals (2, or n by 2). ``info`` is not used."""
        distance = self._distance(achieved_goal, desired_goal)
        if self.reward == "dense":
            return -distance
        return -(distance >= self.near).astype(float)

    def compute_terminated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any) -> bool:
        """Returns False: reaching a goal ends no episode, and tumbling does not follow from the goals."""
        return False

    def compute_truncated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any) -> bool:
        """Returns False: episodes are truncated by their time."""
        return False

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Returns a picture, as ``SkydiverEnv`` draws it."""
        return self._env.render()

    def get_state(self) -> NDArray[np.float32]:
        """Returns everything that the flight consists of, in the order of ``Environments.state_names``."""
        return self._env.get_state()


gymnasium.register(
    id="bodyflight/SkydiverGoal-v0",
    entry_point="bodyflight.goal:SkydiverGoalEnv",
    max_episode_steps=round(10.0 / Skydivers(1).time_step),
)
