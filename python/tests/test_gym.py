"""The environments keep Gymnasium's rules and fly the model."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import bodyflight  # noqa: E402
import bodyflight.gym as gym  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402


@pytest.mark.parametrize("task", gym.TASKS)
def test_every_task_passes_the_checker(task):
    check_env(gymnasium.make("bodyflight/Skydiver-v0", task=task).unwrapped, skip_render_check=True)


def test_a_relaxed_skydiver_falls_at_the_trimmed_speed():
    flight = bodyflight.Skydivers(1)
    flight.reset()
    still = np.zeros((1, len(flight.controls)), dtype=np.float32)
    for _ in range(round(8.0 / flight.time_step)):
        seen = flight.step(still)
    speed = -seen[0, flight.observed.index("vertical_velocity_mps")]
    assert speed == pytest.approx(bodyflight.trim()["terminal_speed_mps"], rel=0.02)
    assert seen[0, flight.observed.index("up_dorsal")] > 0.95


def test_a_turn_turns_and_its_mirror_turns_the_other_way():
    flights = bodyflight.Skydivers(2)
    flights.reset()
    actions = np.zeros((2, len(flights.controls)), dtype=np.float32)
    actions[:, flights.controls.index("turn")] = [1.0, -1.0]
    for _ in range(round(1.5 / flights.time_step)):
        seen = flights.step(actions)
    sin = seen[:, flights.observed.index("heading_sin")]
    assert abs(sin[0]) > 0.1
    assert sin[0] == pytest.approx(-sin[1], abs=0.02)


def test_many_fly_as_one_does():
    one, many = bodyflight.Skydivers(1), bodyflight.Skydivers(50)
    one.reset()
    many.reset()
    random = np.random.default_rng(5)
    for _ in range(30):
        action = random.uniform(-1.0, 1.0, (1, len(one.controls))).astype(np.float32)
        alone = one.step(action)
        together = many.step(np.repeat(action, 50, axis=0))
        np.testing.assert_array_equal(together, np.repeat(alone, 50, axis=0))


def test_vector_environments_begin_anew_where_an_episode_ends():
    env = gym.SkydiverVectorEnv(4, task="turn")
    first, _ = env.reset(seed=1)
    assert first.shape == env.observation_space.shape
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    for _ in range(env.episode_steps):
        _, _, terminated, truncated, _ = env.step(action)
    assert truncated.all() and not terminated.any()
    again, reward, terminated, truncated, _ = env.step(action)
    assert not truncated.any() and (reward == 0.0).all()
    # The same motion as at first, with another turn to fly.
    np.testing.assert_array_equal(again[:, :13], first[:, :13])
    assert not np.array_equal(again[:, 13:15], first[:, 13:15])


def test_the_same_seed_is_the_same_episode():
    def fly():
        env = gymnasium.make("bodyflight/Skydiver-v0", task="dock")
        seen, _ = env.reset(seed=7)
        rewards = [env.step(np.full(env.action_space.shape, 0.1, dtype=np.float32))[1] for _ in range(20)]
        return seen, rewards

    (seen, rewards), (again, more) = fly(), fly()
    np.testing.assert_array_equal(seen, again)
    assert rewards == more


def test_the_geometry_of_an_action_is_fine_enough():
    """Geometry once an action, as flown, against geometry for every step of the model: seconds of moving about."""
    coarse, fine = bodyflight.Skydivers(32), bodyflight.Skydivers(32, substeps=1)
    coarse.reset()
    fine.reset()
    random = np.random.default_rng(2)
    for call in range(90):
        if call % 10 == 0:
            actions = random.uniform(-0.3, 0.3, (32, len(coarse.controls))).astype(np.float32)
        seen = coarse.step(actions)
        for _ in range(8):
            wanted = fine.step(actions)
    named = {name: (seen[:, i], wanted[:, i]) for i, name in enumerate(coarse.observed)}
    for name, (ours, theirs) in named.items():
        allowed = {"mps": 0.4, "_m": 0.5, "dps": 0.08}.get(next((end for end in ["mps", "dps", "_m"] if name.endswith(end)), ""), 0.05)
        assert np.median(np.abs(ours - theirs)) < allowed, name
