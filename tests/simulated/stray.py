"""A process that does not belong here: it repeats old messages, and forges those of other runs and authors."""

from random import Random

from msgspec.structs import replace
from phototaxis.wire.codec import encode
from phototaxis.wire.messages import Command, Readings, State

from simulated.network import Network
from simulated.process import Process
from simulated.witness import Witness

EVERY_S = 0.02
"""Seconds between two messages."""


class Stray:
    """Publishes what must change nothing: an older tick, another run, or a command of somebody who does not drive.

    Parameters
    ----------
    witness : knows the messages of the run.
    """

    def __init__(self, network: Network, rng: Random, witness: Witness):
        self._network, self._rng, self._witness = network, rng, witness
        self._process = Process(network, "observer", "stray")

    def speak(self, until: float) -> None:
        """Publish one message after the other, until then."""
        topic, message = self._rng.choice((self._old, self._of_another_run, self._of_another_author))()
        if message is not None:
            self._network.publish(self._process, topic, encode(message))
        if self._network.timeline.now < until:
            self._network.timeline.after(EVERY_S, self.speak, until)

    def _old(self) -> tuple[str, State | Readings | Command | None]:
        """A message of an earlier tick, as it was."""
        topic = self._rng.choice(("state", "readings", "command"))
        heard = self._witness.published[topic]
        newest = max((message.tick for message in heard), default=0)
        old = [message for message in heard if message.tick < newest]
        return topic, self._rng.choice(old) if old else None

    def _of_another_run(self) -> tuple[str, State | Readings | Command | None]:
        topic = self._rng.choice(("state", "readings", "command"))
        heard = self._witness.published[topic if topic != "command" else "state"]
        if topic == "command" and heard:
            return topic, self._forged("elsewhere", heard[-1].driver)
        return topic, replace(heard[-1], run="elsewhere") if heard else None

    def _of_another_author(self) -> tuple[str, Command | None]:
        """A command of a stranger, or of a former driver that is gone, for the newest tick."""
        heard = self._witness.published["state"]
        here = {process.ident for process in self._network.processes} | {one.driver for one in heard[-1:]}
        gone = self._witness.former - here  # the simulation may not know yet that its driver is gone
        return "command", self._forged(heard[-1].run, self._rng.choice(["stray", *sorted(gone)])) if heard else None

    def _forged(self, run: str, author: str) -> Command:
        newest = self._witness.published["state"][-1]
        return Command(run=run, tick=newest.tick, author=author, left=1.0, right=-1.0)
