"""Learns to turn to a heading: a linear policy, found by a small evolution strategy with hundreds of parallel flights.

    python learn_turn.py [--generations 40] [--seed 1] [--out turn.mvnx]

Prints the mean heading error in the last two seconds of an episode, before and after learning, for headings that were not used in
learning. With --out, saves one flight of the learned policy as a recording for ``bodyflight view``.
"""

import argparse
import time

import bodyflight
import numpy as np
from bodyflight.gym import OBSERVED, SkydiverVectorEnv

#: Flights of each candidate in a generation, each with its own heading.
EPISODES = 8
SIN, COS = OBSERVED.index("turn_left_sin"), OBSERVED.index("turn_left_cos")
#: Inputs of the policy: sine and cosine of the remaining turn, and the angular velocity.
SEEN = [SIN, COS] + [i for i, name in enumerate(OBSERVED) if name.startswith("angular_velocity")]
#: Outputs of the policy: the patterns for turning and for bending sideways.
CONTROLS = [0, 2]


def fly(env, policies, seed):
    """Returns the mean reward of each policy (m by 2 by 5), and the mean heading error in the last two seconds (rad)."""
    count = len(policies)
    seen, _ = env.reset(seed=seed)
    reward, errors = np.zeros(env.num_envs), []
    steps = env.episode_steps
    actions = np.zeros(env.action_space.shape, dtype=np.float32)
    weights = np.repeat(policies, EPISODES, axis=0)
    for step in range(steps):
        moved = np.einsum("nij,nj->ni", weights, seen[:, SEEN])
        actions[:, CONTROLS] = np.tanh(moved)
        seen, gained, _, _, _ = env.step(actions)
        reward += gained
        if step > steps - 60:
            errors.append(np.abs(np.arctan2(seen[:, SIN], seen[:, COS])))
    return reward.reshape(count, EPISODES).mean(axis=1), float(np.mean(errors))


def learn(generations=40, population=32, seed=1, report=print):
    """Returns the policy (2 by 5), and the heading errors before and after learning (rad)."""
    random = np.random.default_rng(seed)
    shape = (len(CONTROLS), len(SEEN))
    mean, deviation = np.zeros(shape), 0.5
    env = SkydiverVectorEnv(population * EPISODES, task="turn")
    judge = SkydiverVectorEnv(EPISODES, task="turn")
    _, before = fly(judge, mean[None], seed=10_000)
    for generation in range(generations):
        drawn = mean + deviation * random.normal(size=(population, *shape))
        reward, _ = fly(env, drawn, seed=int(random.integers(1 << 30)))
        best = drawn[np.argsort(reward)[-population // 4 :]]
        mean, deviation = best.mean(axis=0), max(0.05, 0.95 * deviation)
        report(f"generation {generation + 1}: best reward {reward.max():.1f}")
    _, after = fly(judge, mean[None], seed=10_000)
    return mean, before, after


def save(policy, path, seed=20_000):
    """Flies one episode and writes it as an MVNX recording. Returns its number of frames."""
    env = SkydiverVectorEnv(1, task="turn")
    seen, _ = env.reset(seed=seed)
    actions = np.zeros((env.episode_steps, *env.single_action_space.shape), dtype=np.float32)
    for action in actions:
        action[CONTROLS] = np.tanh(policy @ seen[0, SEEN])
        seen, _, terminated, _, _ = env.step(action[None])
        assert not terminated.any()
    return bodyflight.record(actions, path)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", metavar="MVNX", help="save a flight of the learned policy")
    arguments = parser.parse_args()
    begin = time.monotonic()
    policy, before, after = learn(arguments.generations, seed=arguments.seed)
    print(
        f"heading error {np.degrees(before):.0f} degrees before, {np.degrees(after):.1f} after, "
        f"{time.monotonic() - begin:.0f} s"
    )
    if arguments.out:
        print(f"written: {arguments.out}, {save(policy, arguments.out)} frames")


if __name__ == "__main__":
    main()
