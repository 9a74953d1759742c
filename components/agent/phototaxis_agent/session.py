"""The agent in one run."""

from phototaxis.runtime.seated import SeatedAgent
from phototaxis.wire.messages import BatchReadings, Readings, World
from phototaxis.wire.topics import TOPICS, step_topics

from phototaxis_agent.answering import answering
from phototaxis_agent.following import Following


class Session:
    """What belongs to one run: its world and topics, what answers its ticks, and whom the agent follows."""

    def __init__(self, world: World, agent: SeatedAgent):
        self.world, self.agent = world, agent
        self.topics = step_topics(world.robots)
        self.kind = TOPICS[self.topics.readings].message
        """The type of this world's readings."""
        self.following = Following(world.run, agent)
        self.resume()

    def resume(self) -> None:
        """Answer from what the agent has been restored to."""
        self.answering = answering(self.world, self.agent)

    def missed(self, readings: Readings | BatchReadings) -> bool:
        """Whether the agent has not gone through every tick before this one."""
        return readings.tick > self.agent.tick[1] + 1
