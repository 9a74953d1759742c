"""A deep Q-network in one file, in the style of CleanRL; it drives sixteen robots, in this process or on the bus.

python examples/cleanrl_dqn.py --steps 30000
phototaxis sim --robots 16 & phototaxis sensors &
python examples/cleanrl_dqn.py --steps 30000 --connect local
"""

import argparse
import random
from dataclasses import dataclass, fields

import gymnasium
import numpy as np
import torch
from phototaxis_lab.progress import Progress
from torch import nn

NAME = "phototaxis_gym:phototaxis/LightSeeker-v0"


@dataclass
class Options:
    """Hyperparameters."""

    seed: int = 0
    """seed of all randomness"""
    steps: int = 30_000
    """total steps of all robots"""
    robots: int = 16
    """number of robots that gather experience together"""
    connect: str = ""
    """local, or tcp/HOST:7447, for a running system with as many robots"""
    world: str = "phototaxis"
    """name of the running system's world"""
    gamma: float = 0.6
    """discount factor"""
    learning_rate: float = 1e-3
    """learning rate of Adam"""
    batch_size: int = 128
    """transitions in one update"""
    start: int = 500
    """robot steps before the first update"""
    target: int = 100
    """updates between copies of the net to the target net"""
    explore: float = 0.4
    """fraction of the steps during which the share of random actions falls from 1 to `last`"""
    last: float = 0.05
    """share of random actions at the end"""


def network(inputs: int, actions: int) -> nn.Module:
    return nn.Sequential(nn.Linear(inputs, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, actions))


def success(net: nn.Module, placements: int = 200, seed: int = 1_000_000) -> float:
    """Return the share of fresh placements from which the robot reaches the light within 300 steps."""
    robots = gymnasium.make_vec(NAME, num_envs=placements, percept="continuous", max_episode_steps=300)
    seen, _ = robots.reset(seed=seed)
    reached, over = np.zeros(placements, bool), np.zeros(placements, bool)
    while not over.all():
        seen, _, terminated, truncated, _ = robots.step(net(torch.tensor(seen)).argmax(1).numpy())
        reached |= terminated & ~over
        over |= terminated | truncated
    return float(reached.mean())


def train(options: Options) -> nn.Module:
    random.seed(options.seed)
    torch.manual_seed(options.seed)
    rng = np.random.default_rng(options.seed)
    where = {"connect": options.connect, "world": options.world} if options.connect else {}
    try:
        robots = gymnasium.make_vec(NAME, num_envs=options.robots, percept="continuous", max_episode_steps=100, **where)
    except gymnasium.error.Error as error:
        raise SystemExit(str(error)) from None
    inputs, actions = robots.single_observation_space.shape[0], robots.single_action_space.n
    net, target = network(inputs, actions), network(inputs, actions)
    target.load_state_dict(net.state_dict())
    adam = torch.optim.Adam(net.parameters(), options.learning_rate)
    memory: list[tuple] = []
    seen, _ = robots.reset(seed=options.seed)
    over, updates = np.zeros(options.robots, bool), 0
    progress = Progress(options.steps, "steps")
    for step in range(0, options.steps, options.robots):
        progress.add(options.robots)
        used = min(step / (options.explore * options.steps), 1.0)
        with torch.no_grad():
            action = net(torch.tensor(seen)).argmax(1).numpy()
        dice = rng.random(options.robots) < 1 + used * (options.last - 1)
        action = np.where(dice, rng.integers(actions, size=options.robots), action)
        following, reward, terminated, truncated, _ = robots.step(action)
        for row in np.flatnonzero(~over):  # a robot that has just begun a new episode did not act in this step
            memory.append((seen[row], action[row], reward[row], following[row], float(terminated[row])))
        seen, over = following, terminated | truncated
        if len(memory) < options.start:
            continue
        for _ in range(2):
            columns = zip(*random.sample(memory, options.batch_size), strict=True)
            s, a, r, n, t = (torch.tensor(np.array(column)) for column in columns)
            with torch.no_grad():
                best = net(n).argmax(1, keepdim=True)
                wanted = r.float() + options.gamma * (1 - t.float()) * target(n).gather(1, best).squeeze(1)
            loss = nn.functional.smooth_l1_loss(net(s).gather(1, a[:, None]).squeeze(1), wanted)
            adam.zero_grad()
            loss.backward()
            adam.step()
            updates += 1
            if updates % options.target == 0:
                target.load_state_dict(net.state_dict())
    progress.close()
    robots.close()
    return net


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    for one in fields(Options):
        parser.add_argument(f"--{one.name}", type=one.type, default=one.default)
    options = Options(**vars(parser.parse_args()))
    net = train(options)
    print(f"{options.steps} steps, seed {options.seed}: {success(net):.1%} of 200 fresh placements")


if __name__ == "__main__":
    main()
