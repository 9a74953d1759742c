"""One cell of an experiment: one agent learns with one seed, is frozen, and is measured."""

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
CURVE_POINTS = 100
"""Points of the curve of accumulated reward."""


class System(Struct, frozen=True):
    """An agent in an arena: what is learned and how."""

    learner: str
    percept: str = "simple"
    reward: str = "preset"
    """A reward scheme, or "preset": the one that the learner prefers."""
    arena: str = "paper"
    """Name of a shipped arena, or a TOML file."""
    options: tuple[tuple[str, Any], ...] = ()
    """Options of the agent, (name, value), where they are not the learner's presets."""

    def setup(self) -> AgentSetup:
        """The agent's setup; UserError when an option does not fit."""
        chosen = {} if self.reward == "preset" else {"reward": self.reward}
        return make_setup(self.learner, percept=self.percept, **chosen, **dict(self.options))

    @classmethod
    def of(cls, setup: AgentSetup, arena: str) -> "System":
        """The system of a setup, every option spelt out."""
        options = msgspec.to_builtins(setup.hyperparameters) | msgspec.to_builtins(setup.exploration)
        options["max_episode_steps"] = setup.task.max_episode_steps
        return cls(setup.learner, setup.task.percept, setup.task.reward, arena, tuple(options.items()))

    def check(self) -> None:
        """UserError when there is no such arena, learner or option, or when they do not go together."""
        self.setup().agent(World(run="check", arena=arenas.load_checked(self.arena), seed=0, epochs=1))

    def __str__(self) -> str:
        words = [self.learner, self.percept, *([self.reward] if self.reward != "preset" else [])]
        words += [self.arena] if self.arena != "paper" else []
        return " ".join([*words, *(f"{name}={value}" for name, value in self.options)])


class Cell(Struct, frozen=True):
    """A system, how long it learns, and with which seed."""

    system: System
    epochs: int
    seed: int


class Outcome(Struct):
    """What became of a cell."""

    seed: int
    success_rate: float
    """Share of 200 fresh placements from which the light was reached within 300 steps."""
    within_100: float
    """The same within 100 steps."""
    steps_mean: float | None
    path_ratio: float | None
    learner_hash: str
    episodes: int
    """Episodes that ended while learning."""
    rewards: list[float]
    """Accumulated reward at 100 equally spaced epochs."""
    visits: list[int]
    """How often each state was met while learning; empty where states cannot be counted."""
    reversals: float
    """Share of the learning steps that undid the step before: forward after backward, or backward after forward."""


class Learned(NamedTuple):
    """A cell after its learning."""

    agent: Agent
    loop: Loop
    rewards: np.ndarray
    """Reward of each epoch."""
    speeds: np.ndarray
    """Sum of the motor commands of each epoch: whether it went forward or backward."""


def learn(cell: Cell) -> Learned:
    """The agent of a cell, with what it went through."""
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
    """Learn, freeze, measure on 200 fresh placements; everything follows from the cell."""
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
