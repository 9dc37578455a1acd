"""Learns to turn to a heading with Stable-Baselines3.

    pip install bodyflight[gym] stable-baselines3
    python learn_with_sb3.py [--seconds 60] [--seed 1] [--goals] [--out learned.gif]

PPO learns the task ``turn``; with --goals, SAC with hindsight experience replay learns the environment with goal dictionaries.
Prints the mean heading error in the last two seconds of an episode, before and after, for headings that were not used in
learning. With --out, saves pictures of one episode (needs Pillow).
"""

import argparse
import time

import bodyflight.goal
import gymnasium
import numpy as np
from bodyflight.gym import OBSERVED
from stable_baselines3 import PPO, SAC, HerReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

PLAIN, GOALS = "bodyflight/Skydiver-v0", "bodyflight/SkydiverGoal-v0"
SIN, COS = OBSERVED.index("turn_left_sin"), OBSERVED.index("turn_left_cos")


class Clock(BaseCallback):
    """Ends learning after a time (s)."""

    def __init__(self, seconds):
        super().__init__()
        self.end = time.monotonic() + seconds

    def _on_step(self):
        return time.monotonic() < self.end


def turn_left(seen):
    """The remaining turn (rad)."""
    if isinstance(seen, dict):
        wanted, reached = (np.arctan2(*seen[name]) for name in ["desired_goal", "achieved_goal"])
        return np.angle(np.exp(1j * (wanted - reached)))
    return np.arctan2(seen[SIN], seen[COS])


def error(model, env, episodes=8):
    """Returns the mean heading error in the last two seconds of episodes (rad); a quarter turn for one in which the body tumbles."""
    errors = []
    for episode in range(episodes):
        seen, _ = env.reset(seed=10_000 + episode)
        turns, ended = [], False
        while not ended:
            action, _ = model.predict(seen, deterministic=True)
            seen, _, fallen, late, _ = env.step(action)
            turns.append(abs(turn_left(seen)))
            ended = fallen or late
        errors.append(np.pi / 2 if fallen else np.mean(turns[-60:]))
    return float(np.mean(errors))


def film(model, env, path):
    """Saves pictures of one episode as an animation."""
    from PIL import Image

    seen, _ = env.reset(seed=20_000)
    pictures, ended = [], False
    while not ended:
        action, _ = model.predict(seen, deterministic=True)
        seen, _, fallen, late, _ = env.step(action)
        pictures.append(Image.fromarray(env.render()))
        ended = fallen or late
    # Every third picture, ten a second.
    pictures[0].save(path, save_all=True, append_images=pictures[3::3], duration=100, loop=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--goals", action="store_true", help="learn with goal dictionaries and hindsight experience replay")
    parser.add_argument("--out", metavar="GIF", help="save pictures of a learned episode")
    arguments = parser.parse_args()
    if arguments.goals:
        env = make_vec_env(GOALS, n_envs=4, seed=arguments.seed)
        learner = SAC("MultiInputPolicy", env, replay_buffer_class=HerReplayBuffer, learning_starts=2000, seed=arguments.seed)
    else:
        env = make_vec_env(PLAIN, n_envs=16, seed=arguments.seed, env_kwargs={"task": "turn"})
        # Small actions at first: large ones tumble. A step of 256 actions in each environment, many passes over them.
        policy = {"log_std_init": -1.5, "net_arch": [32, 32]}
        learner = PPO("MlpPolicy", env, n_steps=256, batch_size=512, gamma=0.97, policy_kwargs=policy, seed=arguments.seed)
    judge = gymnasium.make(GOALS if arguments.goals else PLAIN, task="turn", render_mode="rgb_array")
    before = error(learner, judge)
    learner.learn(10**9, callback=Clock(arguments.seconds))
    after = error(learner, judge)
    print(f"{learner.num_timesteps} actions; heading error {np.degrees(before):.0f} degrees before, {np.degrees(after):.0f} after")
    if arguments.out:
        film(learner, judge, arguments.out)
        print(f"written: {arguments.out}")


if __name__ == "__main__":
    main()
