"""The Gymnasium environment with one robot."""

from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import logger
from gymnasium.error import Error, ResetNeeded
from phototaxis.runtime.errors import UserError
from phototaxis.task import Episode
from phototaxis.wire.messages import ENDS, End
from phototaxis_sim import arenas

from phototaxis_gym import MAX_EPISODE_STEPS
from phototaxis_gym.backend import Backend, LocalBackend
from phototaxis_gym.draw import Canvas, Window, frame_rate
from phototaxis_gym.remote import RemoteBackend
from phototaxis_gym.resets import MAX_SEED, given_poses, run_seed
from phototaxis_gym.spaces import actions, motors, observer, rewards, valid_percept


class LightSeeker(gymnasium.Env[Any, Any]):
    """An environment in which one robot learns to find the light, in this process or in a running system.

    An episode is terminated when the robot reaches the light; then `info["is_success"]` is true. Only `gymnasium.make`
    truncates it, after `max_episode_steps` (default 300). `reset(seed=…)` begins a new run, and the same seed and
    actions give the same trajectory, here and on the bus; without a seed the next episode of the same run begins.
    `reset(options={"pose": (x, y, heading)})` chooses the pose (m, rad), but not on the bus.

    Copies and pickles continue exactly as the original does; an environment on the bus cannot be copied.

    Parameters
    ----------
    percept : the observation: "simple" (Discrete 24), "rich" (Discrete 400), "continuous" (Box of 12) or
        "sensors" (Box of 20: 2 lights, 16 sonars in m, 2 bumpers).
    arena : name of a shipped arena, or a TOML file; on the bus the simulation decides.
    reward : "own" (the percept's), "difference", "static" or "potential".
    action : "discrete" (nine motor commands) or "continuous" (two wheels, −1..1).
    render_mode : None, "rgb_array" or "human"; on the bus only None, since people watch in the Rerun viewer.
    connect : "" for a world in this process; or, to drive the robot of a running system, "local" (this machine's
        sockets), a Zenoh endpoint such as "tcp/HOST:7447", or a Zenoh configuration file.
    world : name of the world on the bus.
    timeout : seconds to wait for an answer from the bus.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 2}  # noqa: RUF012 - Gymnasium's own form

    def __init__(
        self,
        percept: str = "simple",
        arena: str = "",
        reward: str = "own",
        action: Literal["discrete", "continuous"] = "discrete",
        render_mode: str | None = None,
        connect: str = "",
        world: str = "phototaxis",
        timeout: float = 10.0,
    ):
        modes = [] if connect else self.metadata["render_modes"]
        if connect and (arena or render_mode):
            what = f"arena '{arena}'" if arena else f"render_mode '{render_mode}'"
            raise Error(f"{what}: the running system decides that; leave it out with connect")
        if render_mode is not None and render_mode not in modes:
            raise Error(f"no render_mode '{render_mode}'; there are: {', '.join(modes)}")
        self._reward, self.action_space = rewards(reward, valid_percept(percept)), actions(action)
        self.render_mode = render_mode
        try:
            self._backend: Backend = (
                RemoteBackend(connect, world, timeout)
                if connect
                else LocalBackend(arenas.load_checked(arena or "paper", goal=False))
            )
        except UserError as error:
            raise Error(str(error)) from None
        self._arena = self._backend.arena
        self.metadata = {**self.metadata, "render_modes": modes, "render_fps": frame_rate(self._arena)}
        self._observe = observer(percept, self._arena)
        self.observation_space = self._observe.space
        self._episode = Episode(MAX_EPISODE_STEPS)
        self._canvas = Canvas(self._arena) if render_mode else None
        self._window = Window(self.metadata["render_fps"]) if render_mode == "human" else None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode at a random placement, or at the pose in `options`."""
        start = given_poses(options, self._arena).get(0)
        super().reset(seed=seed)
        if seed is None and self._np_random_seed == -1:  # the user has set `np_random`
            seed = int(self.np_random.integers(MAX_SEED))
        elif seed is None and self._episode.now is None:
            seed = self.np_random_seed
        if seed is None:
            self._episode.begin(self._backend.place(self._end, start))
        else:
            self._episode.begin(self._backend.begin(run_seed(seed), start))
        return self._look(), self._info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control period (half a second in the paper's arena)."""
        episode = self._episode
        if episode.now is None:
            raise ResetNeeded("call reset() before step()")
        wheels = motors(self.action_space, action)
        if episode.steps and episode.terminated:
            logger.warn("step() was called after the episode has terminated; call reset() to begin the next one")
        episode.step(self._backend.drive(*wheels))
        return self._look(), self._reward(episode), episode.terminated, False, self._info()

    def render(self) -> np.ndarray | None:
        """Return a picture, (height, width, 3) uint8; or show it in a window and return None."""
        if self.render_mode is None:
            logger.warn("render() without a render_mode shows nothing; give gymnasium.make one, such as 'rgb_array'")
        pose = self._backend.pose
        if self._canvas is None or self._episode.now is None or pose is None:
            return None
        picture = self._canvas.draw(pose, self._episode.now.sonar)
        if self._window is None:
            return picture
        self._window.show(picture)
        return None

    def close(self) -> None:
        self._backend.close()
        if self._window is not None:
            self._window.close()

    @property
    def _end(self) -> End:
        """The reason with which the present episode ends when `reset` begins the next one."""
        return ENDS[self._episode.end] or "reset"

    def _look(self) -> Any:
        if self._window is not None:
            self.render()
        return self._observe(self._episode.now, self._episode.history)

    def _info(self) -> dict[str, Any]:
        """Return facts for people, not for learners; the pose only in this process, as a driver does not know it."""
        pose, readings = self._backend.pose, self._episode.now
        place = {} if pose is None else {"pose": np.array(pose)}
        success = self._episode.terminated
        return {**place, "tick": readings.tick, "episode_number": readings.episode, "is_success": success}
