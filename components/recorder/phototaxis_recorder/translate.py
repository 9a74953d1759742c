"""Converts log chunks to Rerun columns; each tick is written once, even when its chunk comes again."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from operator import itemgetter
from typing import Any

import numpy as np
import rerun as rr
from phototaxis.task import ACTIONS, PERCEPTS
from phototaxis.wire.messages import AgentLog, EndedEpisode, SensorsLog, SimLog, World

from phototaxis_recorder import policy_map
from phototaxis_recorder.colors import BLUE, of_distance, of_reward
from phototaxis_recorder.gathering import BEHIND_TICKS
from phototaxis_recorder.layout import MEAN_TICKS, PAPER_SUCCESS_RATE, draw_world
from phototaxis_recorder.summary import Summary

MAX_WAITING_ROWS = 4000
"""Rows of one role that may wait for those of another."""
END_PHRASES = {"terminated": "reached the light", "truncated": "gave up", "reset": "was reset"}


class Translator:
    """Writes one run into one Rerun recording.

    `add` buffers chunks and `flush` writes them; a tick that a role has sent before is left out.
    """

    def __init__(self, recording: rr.RecordingStream, world: World):
        self._recording, self._period = recording, world.arena.motion.control_period
        angles = np.array([sonar.angle for sonar in world.arena.robot.sonars])
        self._aim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._mounts = np.array([sonar.position for sonar in world.arena.robot.sonars])
        self._newest = {"sim": -1, "sensors": -1, "agent": -1}
        self._rows: dict[str, list[tuple[Any, ...]]] = {"sim": [], "sensors": [], "agent": []}
        self._episodes: list[EndedEpisode] = []
        self._episode = -1
        self._recent: deque[bool] = deque(maxlen=50)
        self._driver = ""
        self._late = 0
        self._models = {"sonar": "", "light": ""}
        self._robots, self._system = world.robots, ("", "")
        """Number of robots; learner and percept of the newest chunk."""
        self._rewards: deque[float] = deque(maxlen=MEAN_TICKS)
        self.summary = Summary(world.run, world.arena.name, world.arena.digest)
        draw_world(recording, world.arena)

    def add(self, chunk: SimLog | SensorsLog | AgentLog) -> None:
        """Buffer a chunk."""
        if isinstance(chunk, SimLog):
            self.sim(chunk)
        elif isinstance(chunk, SensorsLog):
            self.sensors(chunk)
        else:
            self.agent(chunk)

    def sim(self, chunk: SimLog) -> None:
        """Buffer poses and ended episodes, and note who drives and how many ticks were late."""
        self._add("sim", chunk.tick, chunk.x, chunk.y, chunk.heading)
        if chunk.driver != self._driver and chunk.tick:
            self._driver = chunk.driver
            if self._driver and self._driver not in self.summary.drivers:
                self.summary.drivers.append(self._driver)
            self._text(chunk.tick[0], f"{self._driver or 'nobody'} drives")
            label = rr.Points2D([(0, 0)], labels=[self._driver], colors=BLUE, radii=0.02, show_labels=True)
            rr.log("world/robot/driver", label, recording=self._recording)
        if chunk.late and chunk.late >= 2 * self._late:  # at each doubling, so that there are only a few lines
            self._late = chunk.late
            self._text(chunk.tick[0], f"{chunk.late} ticks without a command in time so far", rr.TextLogLevel.WARN)
        self._episodes += [episode for episode in chunk.ended if episode.episode > self._episode]
        if self._episodes:
            self._episode = self._episodes[-1].episode

    def sensors(self, chunk: SensorsLog) -> None:
        """Buffer sonar and light readings, and note which models they come from."""
        for kind, model in (("sonar", chunk.sonar_model), ("light", chunk.light_model)):
            if model != self._models[kind]:
                if self._models[kind] or model != "built-in":
                    self._text(chunk.tick[0], f"{kind} readings come from: {model}")
                self._models[kind] = model
                self._at(chunk.tick[0])
                rr.log(f"world/robot/{kind}_model", rr.TextDocument(model), recording=self._recording)
        sonar, light = np.reshape(chunk.sonar, (-1, 16)), np.reshape(chunk.light, (-1, 2))
        self._add("sensors", chunk.tick, sonar, light)

    def agent(self, chunk: AgentLog) -> None:
        """Buffer rewards and actions, and write what is learned."""
        self._system = chunk.learner, chunk.percept
        self._add("agent", chunk.tick, chunk.reward, chunk.td_error, chunk.temperature, chunk.action)
        if chunk.current:
            self._learned(chunk)

    def flush(self, last: bool = False) -> None:
        """Write the buffered rows up to the newest tick whose pose, rays and reward are all known.

        So the newest picture shows one moment. Later rows wait for the other roles, unless this is the `last` flush
        or too many rows wait.
        """
        waiting = max(map(len, self._rows.values()))
        known = min(self._newest["sim"], self._newest["sensors"])
        if known - self._newest["agent"] <= BEHIND_TICKS:
            known = min(known, self._newest["agent"])
        until = math.inf if last or waiting > MAX_WAITING_ROWS else known
        agent = self._take("agent", until)
        if rows := self._take("sim", until):
            tick, x, y, heading = rows
            self.summary.tick = int(tick[-1])
            place = np.stack([x, y, np.zeros_like(x)], axis=1)
            turn = np.zeros((len(tick), 4))
            turn[:, 2], turn[:, 3] = np.sin(heading / 2), np.cos(heading / 2)
            self._send("world/robot", tick, rr.Transform3D.columns(translation=place, quaternion=turn))
            colors = of_reward(_at(tick, agent[0], agent[1])) if agent else of_reward(np.full(len(tick), np.nan))
            self._send("world/trail", tick, rr.Points2D.columns(positions=place[:, :2], colors=colors))
        if rows := self._take("sensors", until):
            tick, sonar, light = rows
            rays = (sonar[:, :, None] * self._aim).reshape(-1, 2)
            starts = np.tile(self._mounts, (len(tick), 1))
            arrows = rr.Arrows2D.columns(vectors=rays, origins=starts, colors=of_distance(sonar.ravel()))
            arrows = arrows.partition([16] * len(tick))
            self._send("world/robot/sonar", tick, arrows)
            self._send("plots/light/left", tick, rr.Scalars.columns(scalars=light[:, 0]))
            self._send("plots/light/right", tick, rr.Scalars.columns(scalars=light[:, 1]))
        if agent:
            tick, reward, error, temperature, action = agent
            self._send("plots/mean_reward", tick, rr.Scalars.columns(scalars=self._running_mean(reward)))
            self._send("plots/reward", tick, rr.Scalars.columns(scalars=reward))
            self._send("plots/td_error", tick, rr.Scalars.columns(scalars=error))
            self._send("plots/temperature", tick, rr.Scalars.columns(scalars=temperature))
            self._send("plots/action", tick, rr.Scalars.columns(scalars=action))
        if last and self._newest["sim"] > self._newest["sensors"]:  # the last pose was not sensed: remove older rays
            self._at(self._newest["sensors"] + 1)
            rr.log("world/robot/sonar", rr.Clear(recursive=False), recording=self._recording)
        for episode in self._episodes:
            self._recent.append(episode.end == "terminated")
            steps = "step" if episode.steps == 1 else "steps"
            self._text(
                episode.tick,
                f"episode {episode.episode}: {episode.driver or 'nobody'} {END_PHRASES.get(episode.end, episode.end)} "
                f"after {episode.steps} {steps}",
            )
            self._at(episode.tick)
            rate = sum(self._recent) / len(self._recent)
            self.summary.episodes, self.summary.recent = episode.episode + 1, rate
            self.summary.reached += self._recent[-1]
            rr.log("plots/success/rate", rr.Scalars(rate), recording=self._recording)
            if self._is_the_papers:
                rr.log("plots/success/paper", rr.Scalars(PAPER_SUCCESS_RATE), recording=self._recording)
        self._episodes.clear()
        self.summary.epochs = max(self.summary.tick - self.summary.episodes, 0)

    def event(self, text: str) -> None:
        """Write a line about the system at the newest tick."""
        self._text(max(*self._newest.values(), 0), text, rr.TextLogLevel.WARN)

    @property
    def _is_the_papers(self) -> bool:
        """Whether the driver is the system for which the paper reports its 80% (section 6.2)."""
        built_in = set(self._models.values()) == {"built-in"}
        return self._system == ("qtable", "simple") and built_in and (self.summary.arena, self._robots) == ("paper", 1)

    def _running_mean(self, rewards: np.ndarray) -> np.ndarray:
        """Return, for each new reward, the mean of the last MEAN_TICKS rewards."""
        means = []
        for reward in rewards:
            self._rewards.append(float(reward))
            means.append(sum(self._rewards) / len(self._rewards))
        return np.array(means)

    def _add(self, role: str, ticks: Sequence[int], *columns: Sequence[Any] | np.ndarray) -> None:
        newest = self._newest[role]
        for row in zip(ticks, *columns, strict=True):
            if row[0] > newest:
                self._rows[role].append(row)
                newest = row[0]
        self._newest[role] = newest

    def _take(self, role: str, until: float) -> list[np.ndarray]:
        rows = self._rows[role]
        ready = bisect_right(rows, until, key=itemgetter(0))
        self._rows[role] = rows[ready:]
        return [np.array(column) for column in zip(*rows[:ready], strict=True)]

    def _send(self, path: str, tick: np.ndarray, columns: Any) -> None:
        index = [
            rr.TimeColumn("tick", sequence=tick),
            rr.TimeColumn("sim_time", duration=tick * self._period),
        ]
        rr.send_columns(path, index, columns, recording=self._recording)

    def _learned(self, chunk: AgentLog) -> None:
        self._at(chunk.tick[-1])
        log, percept = self._recording, PERCEPTS.get(chunk.percept)
        if len(chunk.current) == len(ACTIONS):
            rr.log("learner/current", rr.BarChart(np.array(chunk.current), color=BLUE), recording=log)
        if percept is None:
            return
        states = math.prod(percept.sizes)
        if len(chunk.visits) == states > 0 and len(chunk.values) == states * len(ACTIONS):
            visits = np.array(chunk.visits)
            table = np.reshape(chunk.values, (states, len(ACTIONS))).astype(np.float32)
            rr.log("learner/table", rr.Tensor(table, dim_names=["state", "action"]), recording=log)
            rr.log("learner/visits", rr.BarChart(visits, color=BLUE), recording=log)
            moving, still = policy_map.arrows(percept, table, visits)
            rr.log("learner/policy/best", moving, recording=log)
            rr.log("learner/policy/still", still, recording=log)
            rr.log("learner/policy/here", policy_map.present(percept, chunk.state[-1]), recording=log)

    def _text(self, tick: int, text: str, level: rr.TextLogLevel = rr.TextLogLevel.INFO) -> None:
        self._at(tick)
        rr.log("episodes", rr.TextLog(text, level=level), recording=self._recording)

    def _at(self, tick: int) -> None:
        self._recording.set_time("tick", sequence=tick)
        self._recording.set_time("sim_time", duration=tick * self._period)


def _at(wanted: np.ndarray, tick: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the values at the wanted ticks; NaN where there is none. `wanted` and `tick` ascend."""
    place = np.minimum(np.searchsorted(tick, wanted), len(tick) - 1)
    return np.where(tick[place] == wanted, values[place], np.nan)
