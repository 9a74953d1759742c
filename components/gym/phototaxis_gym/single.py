"""One robot as a Gymnasium environment."""

from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import logger
from gymnasium.error import Error, ResetNeeded
from phototaxis.errors import UserError
from phototaxis.messages import End, Readings
from phototaxis.task import Memory, lit
from phototaxis_sim import arenas

from phototaxis_gym import CAP
from phototaxis_gym.draw import Canvas, Window, frame_rate
from phototaxis_gym.place import Here, Place
from phototaxis_gym.remote import There
from phototaxis_gym.resets import LARGEST, given_poses, run_seed
from phototaxis_gym.spaces import actions, motors, observation, rewards, valid_cap, valid_percept


class LightSeeker(gymnasium.Env[Any, Any]):
    """Find the light, in this process or behind the bus: the same seeds and actions give the same trajectory.

    Parameters
    ----------
    percept : what is observed: "simple" (Discrete 24), "rich" (Discrete 400), "continuous" (Box of 12) or
        "sensors" (Box of 20: 2 lights, 16 sonars in m, 2 bumpers).
    arena : name of a shipped arena, or a TOML file; on the bus it is the simulation's.
    reward : "own" (the percept's), "difference", "static" or "potential".
    action : "discrete" (nine motor commands) or "continuous" (two wheels, −1..1).
    cap : steps after which an episode is truncated. None: only `max_episode_steps` of `gymnasium.make` truncates,
        which is 300 unless it is given; so a larger cap needs it, too.
    render_mode : None, "rgb_array" or "human"; on the bus None: people watch in the Rerun viewer.
    connect : "" for a world in this process. "local" (this machine's sockets), a Zenoh endpoint as
        "tcp/HOST:7447" or a Zenoh configuration file: drive the robot of a running system.
    world : name of the world on the bus.
    timeout : seconds to wait for an answer from the bus.

    Terminated: the light is reached; then `info["is_success"]` is true. Truncated: the step cap. `reset(seed=…)`
    begins anew: the same seed and actions give the same trajectory; without a seed the next episode of the same run
    begins. `reset(options={"pose": (x, y, heading)})` places the robot there (m, rad). On the bus a seed begins a new
    run, and nobody can choose the pose.

    Copies and pickles go on exactly as the original does; an environment on the bus has none.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 2}  # noqa: RUF012 - Gymnasium's own form

    def __init__(
        self,
        percept: str = "simple",
        arena: str = "",
        reward: str = "own",
        action: Literal["discrete", "continuous"] = "discrete",
        cap: int | None = None,
        render_mode: str | None = None,
        connect: str = "",
        world: str = "phototaxis",
        timeout: float = 10.0,
    ):
        modes = [] if connect else self.metadata["render_modes"]
        if connect and (arena or render_mode):
            what = f"arena '{arena}'" if arena else f"render_mode '{render_mode}'"
            raise Error(f"{what}: that is the running system's; leave it out with connect")
        if render_mode is not None and render_mode not in modes:
            raise Error(f"no render_mode '{render_mode}'; there are: {', '.join(modes)}")
        self._reward, self.action_space = rewards(reward, valid_percept(percept)), actions(action)
        self._cap, self.render_mode = None if cap is None else valid_cap(cap), render_mode
        if cap is not None and cap > CAP:
            limit = f"gymnasium.make cuts episodes after {CAP} steps; give it max_episode_steps={cap}, too"
            logger.warn(f"cap {cap}: {limit}")
        try:
            self._place: Place = (
                There(connect, world, timeout) if connect else Here(arenas.enter(arena or "paper", goal=False))
            )
        except UserError as error:
            raise Error(str(error)) from None
        self._arena = self._place.arena
        self.metadata = {**self.metadata, "render_modes": modes, "render_fps": frame_rate(self._arena)}
        self._observe = observation(percept, self._arena)
        self.observation_space = self._observe.space
        self._memory, self._steps = Memory(), 0
        self._readings: Readings | None = None
        self._canvas = Canvas(self._arena) if render_mode else None
        self._window = Window(self.metadata["render_fps"]) if render_mode == "human" else None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode at a random placement, or at the pose in `options`."""
        start = given_poses(options, self._arena).get(0)
        super().reset(seed=seed)
        if seed is None and self._np_random_seed == -1:  # the user has set the generator
            seed = int(self.np_random.integers(LARGEST))
        elif seed is None and self._readings is None:
            seed = self.np_random_seed
        if seed is None:
            self._readings = self._place.place(self._end, start)
        else:
            self._readings = self._place.begin(run_seed(seed), start)
        self._memory.clear()
        self._steps = 0
        return self._look(self._readings), self._info(self._readings)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control period (half a second in the paper's arena)."""
        if self._readings is None:
            raise ResetNeeded("reset() comes before step()")
        wheels = motors(self.action_space, action)
        if self._steps and lit(self._readings):
            logger.warn("step() after the episode has terminated: reset() begins the next one")
        now = self._readings = self._place.drive(*wheels)
        self._steps += 1
        seen = self._look(now)
        reward = self._reward(max(self._memory.before), now, self._memory.unchanged)
        return seen, float(reward), bool(lit(now)), self._steps >= (self._cap or np.inf), self._info(now)

    def render(self) -> np.ndarray | None:
        """A picture, (height, width, 3) uint8; None where it goes to a window."""
        if self.render_mode is None:
            logger.warn("render() without a render_mode shows nothing; give gymnasium.make one, as 'rgb_array'")
        pose = self._place.pose
        if self._canvas is None or self._readings is None or pose is None:
            return None
        picture = self._canvas.draw(pose, self._readings.sonar)
        if self._window is None:
            return picture
        self._window.show(picture)
        return None

    def close(self) -> None:
        self._place.close()
        if self._window is not None:
            self._window.close()

    @property
    def _end(self) -> End:
        """How the present episode ends when the next one is asked for."""
        if self._readings is not None and lit(self._readings):
            return "reached"
        return "cap" if self._steps >= (self._cap or CAP) else "asked"

    def _look(self, readings: Readings) -> Any:
        self._memory.see(readings)
        if self._window is not None:
            self.render()
        return self._observe(readings, self._memory)

    def _info(self, readings: Readings) -> dict[str, Any]:
        """For people, not for learners: where the robot is (not on the bus, where a driver is not told)."""
        pose = self._place.pose
        place = {} if pose is None else {"pose": np.array(pose)}
        success = bool(lit(readings))
        return {**place, "tick": readings.tick, "episode_number": readings.episode, "is_success": success}
