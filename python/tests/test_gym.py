"""The environments follow Gymnasium's rules and simulate the model."""

import copy
import inspect
import pickle

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import bodyflight  # noqa: E402
import bodyflight.goal as goal  # noqa: E402
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


def test_many_fly_like_one():
    """Skydivers side by side and those left over have the bits of each alone, pushed or not, restarted or not."""
    many, ones = bodyflight.Skydivers(10), [bodyflight.Skydivers(1) for _ in range(10)]
    random = np.random.default_rng(5)
    for step in range(30):
        if step == 20:
            again = random.random(10) < 0.5
            many.reset(again)
            for one, begins in zip(ones, again):
                one.reset([begins])
        actions = random.uniform(-1.0, 1.0, (10, 8)).astype(np.float32)
        actions[random.random((10, 8)) < 0.3] = 0.0
        force = random.normal(0.0, 50.0, (10, 3)) if step % 3 == 0 else None
        together = many.step(actions, force=force)
        for row, one in enumerate(ones):
            alone = one.step(actions[[row]], force=None if force is None else force[[row]])
            np.testing.assert_array_equal(together[row], alone[0])
    np.testing.assert_array_equal(many.get_state(), np.concatenate([one.get_state() for one in ones]))


def test_vector_environments_restart_when_an_episode_ends():
    env = gym.SkydiverVectorEnv(4, task="turn")
    first, _ = env.reset(seed=1)
    assert first.shape == env.observation_space.shape
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    for _ in range(env.episode_steps):
        _, _, terminated, truncated, _ = env.step(action)
    assert truncated.all() and not terminated.any()
    again, reward, terminated, truncated, _ = env.step(action)
    assert not truncated.any() and (reward == 0.0).all()
    # The same motion as at the start, with another wanted heading.
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
    """Geometry once per action against geometry for every step of the model, over several seconds of movement."""
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


@pytest.mark.parametrize("task", gym.TASKS)
def test_one_environment_and_a_vector_of_one_agree(task):
    """The same seed and actions give the same numbers, beyond the end of an episode."""
    one, many = gym.SkydiverEnv(task), gym.SkydiverVectorEnv(1, task)
    alone, _ = one.reset(seed=11)
    together, _ = many.reset(seed=11)
    np.testing.assert_array_equal(together[0], alone)
    random, ends = np.random.default_rng(6), 0
    for _ in range(many.episode_steps + 20):
        action = random.uniform(-0.3, 0.3, one.action_space.shape).astype(np.float32)
        wanted = one.step(action)
        found = many.step(action[None])
        for part, expected in zip(found[:4], wanted[:4]):
            np.testing.assert_array_equal(part[0], expected)
        if wanted[2] or wanted[3]:
            ends += 1
            alone, _ = one.reset()
            together, reward, terminated, truncated, _ = many.step(action[None])
            np.testing.assert_array_equal(together[0], alone)
            assert reward[0] == 0.0 and not terminated[0] and not truncated[0]
    assert ends > 0


def test_a_vector_environment_flies_what_single_ones_fly():
    """More skydivers than one thread flies in a run, in a task without random goals; their episodes end one by one."""
    count = 70
    ones, many = [gym.SkydiverEnv("hold") for _ in range(count)], gym.SkydiverVectorEnv(count, "hold")
    many.reset(seed=1)
    flights, late = many._flights.environments, np.arange(count) % 30
    state = flights.get_state()
    state[:, flights.state_names.index("steps")] = many.episode_steps - 5 - late
    flights.set_state(state)
    for one, numbers in zip(ones, state):
        one.reset(seed=0)
        one._flights.environments.set_state(numbers[None])
    random, ended, ends = np.random.default_rng(8), [False] * count, 0
    for _ in range(40):
        actions = random.choice([-1.0, 0.0, 1.0], (count, 8)).astype(np.float32)
        found = many.step(actions)
        for row, one in enumerate(ones):
            wanted = (one.reset()[0], 0.0, False, False) if ended[row] else one.step(actions[row])[:4]
            ended[row] = wanted[2] or wanted[3]
            for part, expected in zip(found[:4], wanted):
                np.testing.assert_array_equal(part[row], np.asarray(expected, dtype=part.dtype))
        ends += sum(ended)
    assert ends == count


def test_observations_and_rewards_follow_from_the_motion():
    """The numbers of the turn task, computed independently from the observations of `Skydivers`."""
    env, flights = gym.SkydiverVectorEnv(3, "turn"), bodyflight.Skydivers(3)
    env.reset(seed=4)
    wanted = np.random.default_rng(4).uniform(*gym.TASKS["turn"].turn, size=3)
    random = np.random.default_rng(9)
    for _ in range(20):
        actions = random.uniform(-0.5, 0.5, env.action_space.shape).astype(np.float32)
        (seen, reward, *_), body = env.step(actions), flights.step(actions)
        named = dict(zip(flights.observed, body.astype(float).T))
        left = wanted - np.arctan2(named["heading_sin"], named["heading_cos"])
        np.testing.assert_allclose(seen[:, gym.OBSERVED.index("turn_left_sin")], np.sin(left), atol=1e-5)
        np.testing.assert_allclose(seen[:, gym.OBSERVED.index("turn_left_cos")], np.cos(left), atol=1e-5)
        np.testing.assert_allclose(seen[:, gym.OBSERVED.index("vertical_velocity_mps")], named["vertical_velocity_mps"] / 60, atol=1e-5)
        expected = 0.5 * (1 + named["up_dorsal"]) - 0.01 * (actions**2).mean(axis=1) + 0.5 * (1 + np.cos(left))
        np.testing.assert_allclose(reward, expected, atol=1e-5)


def test_arrays_of_another_shape_are_refused():
    env = gym.SkydiverVectorEnv(4)
    env.reset(seed=0)
    with pytest.raises(bodyflight.BadInput, match="4 by 8"):
        env.step(np.zeros((3, 8), dtype=np.float32))


@pytest.mark.parametrize("kind", [lambda: gym.SkydiverEnv("dock"), lambda: gym.SkydiverVectorEnv(3, "dock")])
def test_copies_fly_on_to_the_bit(kind):
    env = kind()
    env.reset(seed=3)
    random = np.random.default_rng(1)
    for _ in range(25):
        env.step(random.uniform(-1.0, 1.0, env.action_space.shape))
    others = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env), kind()]
    others[2].reset(seed=4)
    others[2].set_state(env.get_state())
    for _ in range(10):
        action = random.uniform(-1.0, 1.0, env.action_space.shape)
        wanted = env.step(action)
        for other in others:
            for part, expected in zip(other.step(action)[:4], wanted[:4]):
                np.testing.assert_array_equal(part, expected)
    # The goals of the next episode are those of the same seed.
    wanted, _ = env.reset()
    for other in others[:2]:
        np.testing.assert_array_equal(other.reset()[0], wanted)


def test_skydivers_continue_from_their_state_and_from_pickles():
    flights = bodyflight.Skydivers(2, start="sit", density=0.8, subject=bodyflight.Subject().scaled(drag=1.2))
    random = np.random.default_rng(1)
    for _ in range(10):
        flights.step(random.uniform(-1.0, 1.0, (2, 8)))
    other, kept = pickle.loads(pickle.dumps(flights)), flights.get_state()
    assert kept.shape == (2, len(flights.state_names)) and len(set(flights.state_names)) == 30
    action = random.uniform(-1.0, 1.0, (2, 8))
    wanted = flights.step(action)
    np.testing.assert_array_equal(other.step(action), wanted)
    flights.set_state(kept)
    np.testing.assert_array_equal(flights.step(action), wanted)
    kept[1, :4] = 0.0
    with pytest.raises(bodyflight.BadInput, match="state, row 1"):
        flights.set_state(kept)


def test_a_motion_that_is_set_is_flown():
    flights = bodyflight.Skydivers(2)
    velocity, spin = [[3.0, -2.0, -40.0]] * 2, [[0.1, 0.2, -0.3]] * 2
    half = np.sqrt(0.5)
    attitude = [[half, half, 0.0, 0.0]] * 2
    flights.set_motion(velocity=velocity, angular_velocity=spin, inertial_from_body=attitude, position=[[1, 2, 3]] * 2)
    motion = flights.motion
    np.testing.assert_allclose(motion.velocity, velocity, atol=1e-5)
    np.testing.assert_allclose(motion.angular_velocity, spin, atol=1e-6)
    np.testing.assert_allclose(motion.inertial_from_body, attitude, atol=1e-6)
    np.testing.assert_array_equal(motion.position, [[1, 2, 3]] * 2)
    flights.step(np.zeros((2, 8)))
    moved = flights.motion.position - motion.position
    np.testing.assert_allclose(moved, np.array(velocity) * flights.time_step, atol=0.02)


def test_a_force_accelerates_by_its_share_of_the_mass():
    mass, pushed, free = bodyflight.Subject().mass, bodyflight.Skydivers(1), bodyflight.Skydivers(1)
    still = np.zeros((1, 8))
    for _ in range(3):
        pushed.step(still, force=[[200.0, 0.0, 50.0]])
        free.step(still)
    gained = (pushed.motion.velocity - free.motion.velocity)[0]
    np.testing.assert_allclose(gained, np.array([200.0, 0.0, 50.0]) / mass * 3 * free.time_step, rtol=0.1, atol=0.02)
    turned = bodyflight.Skydivers(1)
    turned.step(still, moment=[[0.0, 0.0, 20.0]])
    # Up is the dorsal axis of a body that lies on its belly.
    assert turned.motion.angular_velocity[0, 1] > 0.02


def test_the_terms_add_up_to_the_reward_and_success_is_told():
    env = gym.SkydiverVectorEnv(4, "turn")
    env.reset(seed=2)
    actions = np.random.default_rng(1).uniform(-0.2, 0.2, env.action_space.shape)
    _, reward, _, _, info = env.step(actions)
    np.testing.assert_allclose(sum(info[name] for name in gym.REWARD_TERMS), reward, rtol=1e-6)
    assert info["_is_success"].all() and info["_reward_facing"].all()
    one = gym.SkydiverEnv("hold")
    one.reset(seed=0)
    *_, told = one.step(np.zeros(8))
    assert told["is_success"] is True and told["reward_facing"] == pytest.approx(1.0, abs=0.01)
    state, turned = one.get_state(), bodyflight.Skydivers(1)
    turned.set_motion(angular_velocity=[[0.0, 0.0, 60.0]])
    state[: len(turned.state_names)] = turned.get_state()[0]
    one.set_state(state)
    _, reward, terminated, _, told = one.step(np.zeros(8))
    assert terminated and reward == told["reward_fallen"] == -10.0 and told["is_success"] is False


def test_a_render_mode_is_refused_by_name_and_none_is_accepted():
    assert gym.SkydiverEnv(render_mode=None).render_mode is None
    for kind in (lambda: gym.SkydiverEnv(render_mode="human"), lambda: gym.SkydiverVectorEnv(2, render_mode="human")):
        with pytest.raises(ValueError, match="render_mode: expected one of"):
            kind()


def test_a_picture_shows_the_body_and_points_to_the_goal():
    env = gym.SkydiverEnv("turn", render_mode="rgb_array", width=120, height=90)
    env.reset(seed=1)
    first = env.render()
    assert first.shape == (90, 120, 3) and first.dtype == np.uint8
    np.testing.assert_array_equal(env.render(), first)
    state = env.get_state()
    names = bodyflight.gym.Environments.state_names

    def shown(**numbers):
        changed = state.copy()
        for name, number in numbers.items():
            changed[names.index(name)] = number
        env.set_state(changed)
        return env.render().astype(int)

    def green(picture):
        return (picture[..., 1] > picture[..., 0] + 30) & (picture[..., 1] > picture[..., 2] + 30)

    # The mark is at one side, and at the other for the opposite heading.
    sides = [np.argwhere(green(shown(wanted_heading_sin=side, wanted_heading_cos=0.0)))[:, 1].mean() for side in [1.0, -1.0]]
    assert (sides[0] - 60) * (sides[1] - 60) < 0

    # On its back, the body shows its front: more orange than grey.
    def orange(picture):
        return int((picture[..., 0] > picture[..., 2] + 40).sum())

    w, x, y, z = state[:4]
    belly = orange(shown())
    # Half a turn about the body's long axis.
    back = orange(shown(attitude_w=-z, attitude_x=y, attitude_y=-x, attitude_z=w))
    assert back > 3 * belly
    assert gym.SkydiverEnv("turn").render() is None
    many = gym.SkydiverVectorEnv(2, "turn", render_mode="rgb_array", width=40, height=30)
    many.reset(seed=1)
    assert [picture.shape for picture in many.render()] == [(30, 40, 3)] * 2
    with pytest.raises(bodyflight.BadInput, match="pixels"):
        gym.SkydiverEnv(render_mode="rgb_array", width=0).render()


@pytest.mark.parametrize("task", goal.TASKS)
def test_goals_and_rewards_are_those_of_the_flight(task):
    env = gymnasium.make("bodyflight/SkydiverGoal-v0", task=task)
    plain = gym.SkydiverEnv(task)
    seen, _ = env.reset(seed=5)
    wanted, _ = plain.reset(seed=5)
    achieved, desired, rewards, random = [], [], [], np.random.default_rng(2)
    for _ in range(60):
        action = random.uniform(-0.4, 0.4, env.action_space.shape)
        seen, reward, terminated, truncated, info = env.step(action)
        wanted, *_ = plain.step(action)
        assert env.observation_space.contains(seen)
        np.testing.assert_array_equal(seen["observation"], wanted[:13])
        assert reward == (0.0 if info["is_success"] else -1.0)
        for kept, part in [(achieved, seen["achieved_goal"]), (desired, seen["desired_goal"]), (rewards, reward)]:
            kept.append(part)
    # All rewards at once, as hindsight experience replay computes them.
    np.testing.assert_array_equal(env.unwrapped.compute_reward(np.array(achieved), np.array(desired), None), rewards)
    # A goal that is what was achieved is reached.
    assert (env.unwrapped.compute_reward(np.array(achieved), np.array(achieved), [{}] * 60) == 0.0).all()
    state = dict(zip(bodyflight.gym.Environments.state_names, plain.get_state()))
    if task == "turn":
        left = np.arctan2(desired[-1][0], desired[-1][1]) - np.arctan2(achieved[-1][0], achieved[-1][1])
        assert np.sin(left) == pytest.approx(wanted[gym.OBSERVED.index("turn_left_sin")], abs=1e-5)
    else:
        way = np.array([state["target_north_m"] - state["position_north_m"], state["target_west_m"] - state["position_west_m"]])
        np.testing.assert_allclose((desired[-1] - achieved[-1]) * 10.0, way, atol=1e-4)
    dense = goal.SkydiverGoalEnv(task, reward="dense")
    assert dense.compute_reward([0.0, 0.0], [3.0, 4.0], {}) == -5.0
    with pytest.raises(ValueError, match="expected 'sparse' or 'dense'"):
        goal.SkydiverGoalEnv(task, reward="often")


def test_the_registered_environment_states_its_limit():
    env = gymnasium.make("bodyflight/Skydiver-v0")
    assert env.spec.max_episode_steps == env.unwrapped._flights.limit == 300
    many = gymnasium.make_vec("bodyflight/Skydiver-v0", num_envs=2, vectorization_mode="vector_entry_point")
    assert many.reset(seed=1)[0].shape == (2, 17)
    short = gym.SkydiverVectorEnv(1, substeps=4, max_episode_steps=20)
    assert short.episode_steps == 20


def test_every_method_of_an_environment_is_typed():
    for kind in (gym.SkydiverEnv, gym.SkydiverVectorEnv, goal.SkydiverGoalEnv):
        for name, method in vars(kind).items():
            if inspect.isfunction(method):
                signature = inspect.signature(method)
                assert signature.return_annotation is not signature.empty, name
                hints = [it.annotation for it in signature.parameters.values() if it.name != "self"]
                assert inspect.Parameter.empty not in hints, name
