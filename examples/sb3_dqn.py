"""Stable-Baselines3's DQN, as it is, learns to find the light; then it is measured on fresh placements.

python examples/sb3_dqn.py --steps 5000
"""

import argparse

import gymnasium
import numpy as np
from stable_baselines3 import DQN

NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"


def success(model: DQN, placements: int = 200, seed: int = 1_000_000) -> float:
    """Share of the placements from which the light is reached within 300 steps."""
    robots = gymnasium.make_vec(NAME, num_envs=placements, percept="continuous", cap=300)
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
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    model = DQN(
        "MlpPolicy",
        gymnasium.make(NAME, percept="continuous", cap=100),
        gamma=0.6,
        learning_rate=1e-3,
        learning_starts=200,
        train_freq=1,
        target_update_interval=100,
        exploration_fraction=0.3,
        policy_kwargs={"net_arch": [64]},
        seed=options.seed,
    )
    model.learn(options.steps)
    print(f"{options.steps} steps, seed {options.seed}: {success(model):.1%} of 200 fresh placements")


if __name__ == "__main__":
    main()
