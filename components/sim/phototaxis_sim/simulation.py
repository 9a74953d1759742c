"""Simulates a run of one robot, with its ticks, episodes and epochs, without the bus or wall-clock time."""

import hashlib
import struct

import numpy as np
from msgspec import Struct
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.errors import UserError
from phototaxis.wire.messages import BatchCommand, Command, End, EndedEpisode, State, World

from phototaxis_sim.physics import DriveResult, Physics, Pose

_MAX_IDLE_EPISODES = 1000
"""Episodes in succession that begin where the light is reached already."""
_HASHED = struct.Struct("<8sqqqddddddd")


class Snapshot(Struct):
    """A run at the first tick of an episode."""

    run: str
    seed: int
    tick: int
    episode: int
    epoch: int
    episodes: int
    reached: int
    chain: bytes
    """The hash before that tick."""
    recent: list[bool]
    """Whether the last ended episodes reached the light."""
    driver: str
    """Name of the agent that held the seat."""
    arena: str = ""
    """`Arena.digest`."""
    author: str = ""
    """Name of the agent whose command ended the episode before."""


class Simulation:
    """One robot in one arena, from tick to tick.

    Parameters
    ----------
    arena : the world.
    seed : decides where each episode starts, as a pure function of (seed, episode).
    run : name of the run; has no influence on the trajectory.
    epochs : motor commands after which the run is finished; 0 for no end.
    start : pose at which the first episode starts in place of the seed's.

    Attributes
    ----------
    state : State
        the present tick; `Steps` fills in `driver`.
    ended : EndedEpisode or None
        the episode that ended in the last `advance`.
    digest : of the arena.
    """

    def __init__(self, arena: Arena, seed: int, run: str, epochs: int = 0, start: Pose | None = None):
        self.world, self.digest = World(run=run, arena=arena, seed=seed, epochs=epochs), arena.digest
        self.ended: EndedEpisode | None = None
        self.episodes = self.reached = 0
        self._physics = Physics(arena)
        self._period = arena.motion.control_period
        self._tick = self._episode = self._epoch = self._steps = self._idle = 0
        self._chain = b"\0" * 8
        self._start = Pose(0, 0, 0)
        self.state = self._begin(start)

    @property
    def finished(self) -> bool:
        """Whether the last epoch has been made; its state is still to be answered."""
        return 0 < self.world.epochs <= self._epoch

    @property
    def outcomes(self) -> list[bool]:
        """Whether the light was reached, for each episode that ended in the last `advance`."""
        return [] if self.ended is None else [self.ended.end == "terminated"]

    def check(self, command: Command | BatchCommand) -> None:
        """No-op: decoding has validated the command of one robot."""

    @property
    def watched(self) -> State:
        """What people watch."""
        return self.state

    def anew(self, seed: int, run: str) -> "Simulation":
        """Another run in the same arena."""
        return Simulation(self.world.arena, seed, run, self.world.epochs)

    def advance(self, left: float, right: float, author: str, end: End = "", start: Pose | None = None) -> State:
        """Hold a command for one control period, or end the episode; the next state.

        The next episode starts at `start` if it is given, else where the seed says.

        Raises
        ------
        UserError
            when the light was reached without a step in the last 1,000 episodes, which would go on forever.
        """
        self.ended = None
        self._tick += 1
        if end:
            x, y, heading = self._start
            self.ended = EndedEpisode(
                run=self.world.run, episode=self._episode, tick=self._tick - 1, steps=self._steps, end=end,
                driver=author, x=x, y=y, heading=heading,
            )  # fmt: skip
            self.episodes += 1
            self.reached += end == "terminated"
            self._idle = self._idle + 1 if end == "terminated" and not self._steps else 0
            if self._idle >= _MAX_IDLE_EPISODES:
                raise UserError(
                    f"arena {self.world.arena.name}: the light was reached before the first step in the last "
                    f"{_MAX_IDLE_EPISODES} episodes; begin further from the lights (placement.light_distance), or "
                    f"dim them"
                )
            self._episode += 1
            self._steps = 0
            self.state = self._begin(start, author)
        else:
            self._epoch += 1
            self._steps += 1
            self.state = self._report(self._physics.drive(left, right), left, right, author)
        return self.state

    def snapshot(self, recent: list[bool], driver: str) -> Snapshot:
        """Make what `restore` needs to begin the present episode again; call it only at the first tick."""
        return Snapshot(
            self.world.run,
            self.world.seed,
            self._tick,
            self._episode,
            self._epoch,
            self.episodes,
            self.reached,
            self._before,
            recent,
            driver,
            self.digest,
            self.state.author,
        )

    def restore(self, at: Snapshot, start: Pose | None = None) -> None:
        """Go to the first tick of an episode; the same commands then lead to the same states.

        `start` is the pose that was given for the episode, if one was.
        """
        self._tick, self._episode, self._epoch, self._steps = at.tick, at.episode, at.epoch, 0
        self.episodes, self.reached, self._chain = at.episodes, at.reached, at.chain
        self.state = self._begin(start, at.author)

    def _begin(self, start: Pose | None, author: str = "") -> State:
        self._before = self._chain
        rng = np.random.default_rng((self.world.seed, self._episode))
        self._start = self._physics.random_pose(rng) if start is None else start
        return self._report(self._physics.place(self._start), 0.0, 0.0, author)

    def _report(self, motion: DriveResult, left: float, right: float, author: str) -> State:
        (x, y, heading), speed, turn, front, rear = motion
        tick, episode, epoch = self._tick, self._episode, self._epoch
        contacts = front + 2 * rear
        packed = _HASHED.pack(self._chain, tick, 4 * episode + contacts, epoch, x, y, heading, speed, turn, left, right)
        digest = hashlib.blake2b(packed, digest_size=8)
        self._chain = digest.digest()
        return State(
            run=self.world.run, tick=tick, episode=episode, epoch=epoch, time=tick * self._period, x=x, y=y,
            heading=heading, speed=speed, turn=turn, front=front, rear=rear, left=left, right=right, author=author,
            driver="", hash=digest.hexdigest(),
        )  # fmt: skip
