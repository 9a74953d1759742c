"""Runs world, sensors and agent in one process, with the step protocol but without a bus."""

import time

from phototaxis.geometry.arena import Arena
from phototaxis.wire.messages import EndedEpisode, World
from phototaxis_agent.agent import Agent
from phototaxis_agent.setup import AgentSetup
from phototaxis_sensors.suite import Make, SensorSuite, built_in
from phototaxis_sim.simulation import Simulation

from phototaxis_lab.progress import Progress


class Loop:
    """One run, tick by tick, bit-identical to the same run over the bus."""

    def __init__(self, arena: Arena, agent: Agent, seed: int, epochs: int = 0, run: str = "lab", make: Make = built_in):
        self.simulation = Simulation(arena, seed, run, epochs)
        self.sensors = SensorSuite(self.simulation.world, make)
        self.agent = agent

    def step(self) -> EndedEpisode | None:
        """Run one tick, and return the episode that it ended, if any."""
        command = self.agent(self.sensors(self.simulation.state))
        self.simulation.advance(command.left, command.right, command.author, command.end)
        return self.simulation.ended

    def finish(self) -> None:
        """Let the agent learn from the state after the last epoch."""
        self.agent(self.sensors(self.simulation.state))


def train(setup: AgentSetup, arena: Arena, seed: int, epochs: int, make: Make = built_in) -> tuple[Loop, float]:
    """Learn for `epochs` steps; return the loop in its final state, and the seconds that it took."""
    loop = Loop(arena, setup.agent(World(run="lab", arena=arena, seed=seed, epochs=epochs)), seed, epochs, make=make)
    began = time.perf_counter()
    with Progress(epochs, "epochs") as progress:
        while not loop.simulation.finished:
            if loop.step() is None:
                progress.add()
    loop.finish()
    return loop, time.perf_counter() - began
