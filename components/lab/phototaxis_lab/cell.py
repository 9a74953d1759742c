"""Runs one cell of an experiment: an agent learns with one seed, is frozen, and is measured."""

from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec import Struct
from phototaxis.task import ACTIONS
from phototaxis.wire.messages import World
from phototaxis_agent.agent import Agent
from phototaxis_agent.setup import AgentSetup, make_setup
from phototaxis_agent.watchdog import watchdog
from phototaxis_sim import arenas

from phototaxis_lab.loop import Loop
from phototaxis_lab.measure import evaluate

PLACEMENTS = 200
"""Fresh random placements on which each frozen policy is measured."""
CURVE_POINTS = 100
"""Points of the curve of accumulated reward."""


class System(Struct, frozen=True):
    """The settings of an agent, and the arena in which it learns."""

    learner: str
    percept: str = "simple"
    reward: str = "preset"
    """A reward scheme, or "preset" for the learner's own choice."""
    arena: str = "paper"
    """Name of a shipped arena, or a TOML file."""
    options: tuple[tuple[str, Any], ...] = ()
    """Options of the agent as (name, value); the others have the learner's presets."""

    def setup(self) -> AgentSetup:
        """Return the agent's setup; UserError when an option does not fit."""
        chosen = {} if self.reward == "preset" else {"reward": self.reward}
        return make_setup(self.learner, percept=self.percept, **chosen, **dict(self.options))

    @classmethod
    def of(cls, setup: AgentSetup, arena: str) -> "System":
        """Return the system of a setup, with the values of all options."""
        options = msgspec.to_builtins(setup.hyperparameters) | msgspec.to_builtins(setup.exploration)
        options["max_episode_steps"] = setup.task.max_episode_steps
        return cls(setup.learner, setup.task.percept, setup.task.reward, arena, tuple(options.items()))

    def check(self) -> None:
        """Raise UserError when there is no such arena, learner or option, or they do not fit each other."""
        self.setup().agent(World(run="check", arena=arenas.load_checked(self.arena), seed=0, epochs=1))

    def __str__(self) -> str:
        words = [self.learner, self.percept, *([self.reward] if self.reward != "preset" else [])]
        words += [self.arena] if self.arena != "paper" else []
        return " ".join([*words, *(f"{name}={value}" for name, value in self.options)])


class Cell(Struct, frozen=True):
    """A system, its number of learning steps, and its seed."""

    system: System
    epochs: int
    seed: int


class Outcome(Struct):
    """The measurements of a cell."""

    seed: int
    success_rate: float
    """Share of 200 fresh placements from which the robot reached the light within 300 steps."""
    within_100: float
    """The same share within 100 steps."""
    steps_mean: float | None
    """As in `Evaluation`, and so is `path_ratio`."""
    path_ratio: float | None
    learner_hash: str
    episodes: int
    """Episodes that ended while learning."""
    rewards: list[float]
    """Accumulated reward at 100 equally spaced epochs."""
    visits: list[int]
    """Number of learning steps in each state; empty if the percept is continuous."""
    reversals: float
    """Share of the learning steps that reverse the previous one: forward after backward, or backward after forward."""


class Learned(NamedTuple):
    """A cell after learning."""

    agent: Agent
    loop: Loop
    rewards: np.ndarray
    """Reward of each epoch."""
    speeds: np.ndarray
    """Sum of the two motor commands of each epoch; its sign says forward or backward."""


def learn(cell: Cell) -> Learned:
    """Let the agent of a cell learn, and return it with its rewards and speeds."""
    arena = arenas.load(cell.system.arena)
    world = World(run="lab", arena=arena, seed=cell.seed, epochs=cell.epochs)
    agent = cell.system.setup().agent(world)
    policy = agent.policy
    loop = Loop(arena, agent, cell.seed, cell.epochs)
    rewards, speeds = np.zeros(cell.epochs), np.zeros(cell.epochs)
    while not loop.simulation.finished:
        epoch = policy.epoch
        ended = loop.step()
        if policy.epoch > epoch:
            rewards[epoch] = agent.last.reward
        if ended is None:
            speeds[loop.simulation.state.epoch - 1] = sum(ACTIONS[agent.last.action])
    loop.finish()
    rewards[-1] = agent.last.reward
    return Learned(agent, loop, rewards, speeds)


@watchdog()
def run(cell: Cell) -> Outcome:
    """Learn, freeze, and measure on 200 fresh placements; the outcome depends only on the cell."""
    agent, loop, rewards, speeds = learn(cell)
    meta, _ = agent.checkpoint()
    agent.policy.learning = False
    found = evaluate(loop.simulation.world.arena, agent.policy, PLACEMENTS, cell.seed)
    marks = np.linspace(0, cell.epochs, CURVE_POINTS + 1).astype(int)[1:] - 1
    return Outcome(
        seed=cell.seed,
        success_rate=found.success_rate,
        within_100=found.within_100,
        steps_mean=found.steps_mean,
        path_ratio=found.path_ratio,
        learner_hash=meta.learner_hash,
        episodes=loop.simulation.episodes,
        rewards=np.cumsum(rewards)[marks].round(6).tolist(),
        visits=meta.visits,
        reversals=float((speeds[1:] * speeds[:-1] < 0).mean()) if cell.epochs > 1 else 0.0,
    )
