"""Trains Stable-Baselines3's DQN or PPO, unchanged, to find the light, and measures it on fresh placements.

    python examples/sb3.py --learner dqn --steps 5000
    python examples/sb3.py --learner ppo --steps 10000 --save ppo.zip
    phototaxis up --epochs 0 &
    python examples/sb3.py --learner dqn --steps 2000 --connect local

With --connect it drives the robot of a running system, whose recorder shows it; learning is then slower.
"""

import argparse

import gymnasium
import numpy as np
from phototaxis_lab.progress import Progress
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm

NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"
HYPERPARAMETERS = {
    "dqn": {
        "gamma": 0.6,
        "learning_rate": 1e-3,
        "learning_starts": 200,
        "train_freq": 1,
        "target_update_interval": 100,
        "exploration_fraction": 0.3,
        "policy_kwargs": {"net_arch": [64]},
    },
    "ppo": {"gamma": 0.6, "learning_rate": 1e-3, "n_steps": 512, "batch_size": 64, "ent_coef": 0.01},
}


def success(model: BaseAlgorithm, placements: int = 200, seed: int = 1_000_000) -> float:
    """Return the share of fresh placements from which the robot reaches the light within 300 steps."""
    robots = gymnasium.make_vec(NAME, num_envs=placements, percept="continuous", max_episode_steps=300)
    seen, _ = robots.reset(seed=seed)
    reached, over = np.zeros(placements, bool), np.zeros(placements, bool)
    while not over.all():
        actions, _ = model.predict(seen)
        seen, _, terminated, truncated, _ = robots.step(actions)
        reached |= terminated & ~over
        over |= terminated | truncated
    return float(reached.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--learner", choices=HYPERPARAMETERS, default="dqn")
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--connect", default="", help="local, or tcp/HOST:7447, for a running system")
    parser.add_argument("--world", default="phototaxis", help="name of the running system's world")
    parser.add_argument("--save", help="file in which to save the policy")
    options = parser.parse_args()
    where = {"connect": options.connect, "world": options.world} if options.connect else {}
    try:
        environment = gymnasium.make(NAME, percept="continuous", max_episode_steps=100, **where)
    except gymnasium.error.Error as error:
        raise SystemExit(str(error)) from None
    algorithm = {"dqn": DQN, "ppo": PPO}[options.learner]
    model = algorithm("MlpPolicy", environment, seed=options.seed, device="cpu", **HYPERPARAMETERS[options.learner])
    with Progress(options.steps, "steps") as progress:
        model.learn(options.steps, callback=lambda *_: progress.add() is None)
    environment.close()
    print(
        f"{options.learner}, {model.num_timesteps} steps, seed {options.seed}: "
        f"{success(model):.1%} of 200 fresh placements"
    )
    if options.save:
        model.save(options.save)


if __name__ == "__main__":
    main()
