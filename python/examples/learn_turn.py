"""Learns to turn to a heading: a linear policy by a small evolution strategy, thousands of flights at once.

    python learn_turn.py [--generations 40] [--seed 1]

Prints the mean heading error in the last two seconds before and after, on episodes that were not learned on.
"""

import argparse
import time

import numpy as np

from bodyflight.gym import OBSERVED, SkydiverVectorEnv

#: Flights of each candidate in a generation: as many headings.
EPISODES = 8
SIN, COS = OBSERVED.index("turn_left_sin"), OBSERVED.index("turn_left_cos")
#: What the policy sees: the turn that is left, its cosine, and the rates.
SEEN = [SIN, COS] + [i for i, name in enumerate(OBSERVED) if name.startswith("angular_velocity")]
#: What it moves: turning, and bending sideways.
CONTROLS = [0, 2]


def fly(env, policies, seed):
    """Reward of each policy over its episodes, and heading error in the last two seconds (rad)."""
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
    """The policy found, and the heading errors before and after (rad)."""
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


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    begin = time.monotonic()
    _, before, after = learn(arguments.generations, seed=arguments.seed)
    print(
        f"heading error {np.degrees(before):.0f} degrees before, {np.degrees(after):.1f} after, "
        f"{time.monotonic() - begin:.0f} s"
    )


if __name__ == "__main__":
    main()
