"""A deep Q-network: replay, a target net, and double Q-learning (Mnih et al. 2015; van Hasselt et al. 2016)."""

from typing import Annotated, Any, ClassVar

import numpy as np
import torch
from msgspec import Meta, Struct
from phototaxis.task import ACTIONS, MIRRORED, Percept, PerceptState

from phototaxis_agent import context
from phototaxis_agent.inputs import OneHot
from phototaxis_agent.learner import Learner, Transition, annealed, stored
from phototaxis_agent.threads import one_thread


class Hyperparameters(Struct, frozen=True, kw_only=True):
    """Hyperparameters of the network and its replay buffer."""

    gamma: Annotated[float, Meta(ge=0, lt=1)] = 0.6
    """discount factor γ of equation 1"""
    learning_rate: Annotated[float, Meta(gt=0, le=1)] = 0.001
    """learning rate of Adam at the first epoch; it falls geometrically to `learning_rate_end`"""
    learning_rate_end: Annotated[float, Meta(gt=0, le=1)] = 0.001
    """learning rate at the end of the budget and after it"""
    hidden: Annotated[int, Meta(ge=1, le=4096)] = 64
    """units of the one hidden layer (rectified linear)"""
    batch_size: Annotated[int, Meta(ge=1, le=4096)] = 32
    """experiences that are replayed at a time, beside the newest"""
    gradient_steps: Annotated[int, Meta(ge=1, le=100)] = 2
    """steps of Adam, each with a batch of its own, after each learning step"""
    buffer_size: Annotated[int, Meta(ge=1, le=1_000_000)] = 10_000
    """experiences in the replay buffer; new ones replace the oldest"""
    target_update_interval: Annotated[int, Meta(ge=1)] = 50
    """steps after which the target net becomes a copy of the net"""


class Dqn(Learner):
    """One net, Q of all actions out; in: the percept one-hot, with the last action and whether it got brighter.

    The mirror image of every experience is learned from as well.
    """

    Options = Hyperparameters
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "": {
            "reward": "potential",
            "temperature_start": 0.5,
            "temperature_end": 0.1,
            "exploration_fraction": 0.6,
            "max_episode_steps": 50,
        },
        "continuous": {"exploration_fraction": 0.8, "batch_size": 24},
    }
    context: tuple[float, ...] = context.INITIAL_CONTEXT

    def __init__(self, options: Hyperparameters, percept: Percept, rng: np.random.Generator):
        self._options, self._percept, self._rng = options, percept, rng
        self._encode = OneHot((*percept.sizes, *context.CONTEXT_SIZES))
        self._allowed = list(percept.actions)
        self._net, self._target = (_network(self._encode.width, options.hidden, rng) for _ in range(2))
        self._target.load_state_dict(self._net.state_dict())
        self._adam = torch.optim.Adam(self._net.parameters(), options.learning_rate, fused=True)
        for parameter in self._net.parameters():  # else it comes with the first step, too late for `load`
            moments = {name: torch.zeros_like(parameter) for name in ("exp_avg", "exp_avg_sq")}
            self._adam.state[parameter] = {"step": torch.zeros(()), **moments}
        width, buffer_size = len(percept.sizes) + len(self.context), options.buffer_size
        self._replay = {
            "state": np.zeros((buffer_size, width)),
            "action": np.zeros(buffer_size, np.int64),
            "reward": np.zeros(buffer_size, np.float32),
            "next_state": np.zeros((buffer_size, width)),
            "terminated": np.zeros(buffer_size, np.float32),
        }
        self._kept = 0

    def remember(self, state: Any, action: Any, gain: Any) -> tuple[Any, ...]:
        return context.remember(action, gain)

    @one_thread
    def batch_values(self, states: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return self._net(self._encode(states)).numpy()[:, self._allowed]

    def values(self, state: PerceptState) -> list[float]:
        return self.batch_values(np.array([state], dtype=float))[0].tolist()

    @one_thread
    def learn(self, transition: Transition) -> float:
        state, action, reward, next_state, terminated, progress, _ = transition
        mirror, percept = context.mirror, self._percept
        self._keep(mirror(percept, state), MIRRORED[action], reward, mirror(percept, next_state), terminated)
        newest = self._keep(state, action, reward, next_state, terminated)
        kept = min(self._kept, self._options.buffer_size)
        error = 0.0
        self._adam.param_groups[0]["lr"] = annealed(
            self._options.learning_rate, self._options.learning_rate_end, progress
        )
        for number in range(self._options.gradient_steps):
            errors = self._errors(np.array([newest, *self._rng.integers(kept, size=self._options.batch_size)]))
            error = errors[0].item() if number == 0 else error
            self._adam.zero_grad()
            torch.nn.functional.smooth_l1_loss(errors, torch.zeros_like(errors)).backward()
            self._adam.step()
        if self._kept // 2 % self._options.target_update_interval == 0:
            self._target.load_state_dict(self._net.state_dict())
        return error

    def _keep(self, *experience: Any) -> int:
        """Store an experience in place of the oldest, and return its row."""
        row = self._kept % self._options.buffer_size
        for column, value in zip(self._replay.values(), experience, strict=True):
            column[row] = value
        self._kept += 1
        return row

    def _errors(self, rows: np.ndarray) -> torch.Tensor:
        """Q(s, a) less its target, for some experiences; the net chooses what follows, the target net values it."""
        state, action, reward, next_state, terminated = (column[rows] for column in self._replay.values())
        with torch.no_grad():
            after = self._encode(next_state)
            best = self._net(after)[:, self._allowed].argmax(dim=1, keepdim=True)
            value = self._target(after)[:, self._allowed].gather(1, best)[:, 0]
            goes_on = 1 - torch.from_numpy(terminated)
            target = torch.from_numpy(reward) + self._options.gamma * goes_on * value
        return self._net(self._encode(state)).gather(1, torch.from_numpy(action)[:, None])[:, 0] - target

    def save(self) -> dict[str, np.ndarray]:
        arrays = {"kept": np.array(self._kept)}
        kept = min(self._kept, self._options.buffer_size)
        arrays |= {f"replay {name}": column[:kept].copy() for name, column in self._replay.items()}
        return arrays | {name: tensor.detach().numpy().copy() for name, tensor in self._tensors().items()}

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        total = int(stored(arrays, "kept", np.array(0)))
        kept = min(total, self._options.buffer_size)
        columns = {n: stored(arrays, f"replay {n}", column[:kept]) for n, column in self._replay.items()}
        own = self._tensors()
        tensors = {name: stored(arrays, name, tensor.detach().numpy()) for name, tensor in own.items()}
        self._kept = total
        for name, column in columns.items():
            self._replay[name][:kept] = column
        with torch.no_grad():
            for name, tensor in own.items():
                tensor.copy_(torch.from_numpy(tensors[name]))

    def _tensors(self) -> dict[str, torch.Tensor]:
        """Weights of both nets and the state of Adam, by name."""
        named = {f"net {name}": tensor for name, tensor in self._net.state_dict().items()}
        named |= {f"target {name}": tensor for name, tensor in self._target.state_dict().items()}
        for name, parameter in self._net.named_parameters():
            named |= {f"adam {name} {key}": tensor for key, tensor in self._adam.state[parameter].items()}
        return named


def _network(inputs: int, hidden: int, rng: np.random.Generator) -> torch.nn.Sequential:
    """One hidden layer; first weights uniform in ± 1/√inputs of their layer, as is PyTorch's custom.

    They come from `rng` alone: PyTorch's own generator is the process's.
    """
    sizes = (inputs, hidden), (hidden, len(ACTIONS))
    layers = [torch.nn.utils.skip_init(torch.nn.Linear, *size) for size in sizes]
    with torch.no_grad():
        for layer, (width, _) in zip(layers, sizes, strict=True):
            for parameter in layer.parameters():
                bound = width**-0.5
                parameter.copy_(torch.from_numpy(rng.uniform(-bound, bound, tuple(parameter.shape))))
    return torch.nn.Sequential(layers[0], torch.nn.ReLU(), layers[1])
