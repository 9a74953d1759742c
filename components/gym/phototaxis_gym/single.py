"""One robot as a Gymnasium environment, in this process."""

from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.error import InvalidAction, ResetNeeded
from phototaxis.errors import UserError
from phototaxis.task import Memory, lit
from phototaxis_sensors.suite import SensorSuite
from phototaxis_sim import arenas
from phototaxis_sim.simulation import Simulation

from phototaxis_gym import CAP
from phototaxis_gym.draw import Canvas, Window
from phototaxis_gym.spaces import MOTORS, actions, observation, rewards

SEEDS = 2**31


class LightSeeker(gymnasium.Env[Any, Any]):
    """Find the light. The physics, sensors, percepts and rewards are those of the processes on the bus.

    Parameters
    ----------
    percept : what is observed: "simple" (Discrete 24), "rich" (Discrete 400), "continuous" (Box of 12) or
        "sensors" (Box of 20: 2 lights, 16 sonars in m, 2 bumpers).
    arena : name of a shipped arena, or a TOML file.
    reward : "own" (the percept's), "difference", "static" or "potential".
    action : "discrete" (nine motor commands) or "continuous" (two wheels, −1..1).
    cap : steps after which an episode is truncated.
    render_mode : None, "rgb_array" or "human".

    Terminated: the light is reached. Truncated: the step cap. `reset(seed=…)` begins anew: the same seed and
    actions give the same trajectory; without a seed the next episode of the same run begins.
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 10}  # noqa: RUF012 - Gymnasium's own form

    def __init__(
        self,
        percept: str = "simple",
        arena: str = "paper",
        reward: str = "own",
        action: Literal["discrete", "continuous"] = "discrete",
        cap: int = CAP,
        render_mode: str | None = None,
    ):
        try:
            self._arena = arenas.load(arena)
        except UserError as error:
            raise gymnasium.error.Error(str(error)) from None
        self._observe, self._reward = observation(percept, self._arena), rewards(reward, percept)
        self.observation_space, self.action_space = self._observe.space, actions(action)
        self._cap, self.render_mode = cap, render_mode
        self._memory, self._steps = Memory(), 0
        self._simulation: Simulation | None = None
        self._canvas = Canvas(self._arena) if render_mode else None
        self._window = Window(self.metadata["render_fps"]) if render_mode == "human" else None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode at a random placement."""
        super().reset(seed=seed)
        if seed is not None or self._simulation is None:
            world_seed = int(self.np_random.integers(SEEDS)) if seed is None else seed
            self._simulation = Simulation(self._arena, world_seed, "gymnasium")
            self._suite = SensorSuite(self._simulation.world)
        else:
            self._simulation.advance(0.0, 0.0, "", "asked")
        self._memory.clear()
        self._steps = 0
        return self._look(), self._info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control period (half a second in the paper's arena)."""
        simulation = self._simulation
        if simulation is None:
            raise ResetNeeded("reset() comes before step()")
        if not self.action_space.contains(action):
            raise InvalidAction(f"{action!r} is not in {self.action_space}")
        left, right = MOTORS[action] if isinstance(self.action_space, gymnasium.spaces.Discrete) else action
        simulation.advance(float(left), float(right), "gymnasium")
        self._steps += 1
        seen = self._look()
        now = self._readings
        reward = self._reward(max(self._memory.before), now, self._memory.unchanged)
        return seen, float(reward), bool(lit(now)), self._steps >= self._cap, self._info()

    def render(self) -> np.ndarray | None:
        """A picture, (height, width, 3) uint8; None where it goes to a window."""
        if self._canvas is None or self._simulation is None:
            return None
        state = self._simulation.state
        picture = self._canvas.draw((state.x, state.y, state.heading), self._readings.sonar)
        if self._window is None:
            return picture
        self._window.show(picture)
        return None

    def close(self) -> None:
        if self._window is not None:
            self._window.close()

    def _look(self) -> Any:
        assert self._simulation is not None  # noqa: S101
        self._readings = self._suite(self._simulation.state)
        self._memory.see(self._readings)
        if self._window is not None:
            self.render()
        return self._observe(self._readings, self._memory)

    def _info(self) -> dict[str, Any]:
        """Where the robot is: for people, not for learners."""
        assert self._simulation is not None  # noqa: S101
        state = self._simulation.state
        return {
            "pose": np.array((state.x, state.y, state.heading)),
            "tick": state.tick,
            "episode_number": state.episode,
        }
