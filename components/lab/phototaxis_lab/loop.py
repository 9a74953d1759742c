"""World, sensors and agent in one process: the step protocol without a bus."""

from phototaxis.arena import Arena
from phototaxis.messages import Episode
from phototaxis_agent.agent import Agent
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim.simulation import Simulation


class Loop:
    """One run, tick by tick, bit-identical to the same run over the bus."""

    def __init__(self, arena: Arena, agent: Agent, seed: int, epochs: int = 0, run: str = "lab"):
        self.simulation = Simulation(arena, seed, run, epochs)
        self.sensors = SensorSuite(self.simulation.world)
        self.agent = agent

    def step(self) -> Episode | None:
        """One tick; the episode that it ended, if any."""
        command = self.agent(self.sensors(self.simulation.state))
        self.simulation.advance(command.left, command.right, command.author, command.end)
        return self.simulation.ended

    def finish(self) -> None:
        """After the last epoch: the agent also learns from the state that it led to."""
        self.agent(self.sensors(self.simulation.state))
