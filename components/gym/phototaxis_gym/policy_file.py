"""Loads files of Stable-Baselines3 and sb3-contrib: the model, and the statistics of its observations."""

import json
import zipfile
import zlib
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from phototaxis.runtime.errors import UserError

Normalize = Callable[[np.ndarray], np.ndarray]
"""Normalises observations as VecNormalize did in the training."""

SB3, CONTRIB = "stable_baselines3", "sb3_contrib"


class Algorithm(NamedTuple):
    """An algorithm, and how to recognise its files: by a field in them, or by the module of their policy's class."""

    name: str
    package: str
    field: str = ""
    module: str = ""


ALGORITHMS = (  # the first that fits counts, since some fields occur in files of several algorithms
    Algorithm("RecurrentPPO", CONTRIB, module="sb3_contrib.common.recurrent"),
    Algorithm("MaskablePPO", CONTRIB, module="sb3_contrib.common.maskable"),
    Algorithm("QRDQN", CONTRIB, field="n_quantiles"),
    Algorithm("TQC", CONTRIB, field="top_quantiles_to_drop_per_net"),
    Algorithm("TRPO", CONTRIB, field="cg_max_steps"),
    Algorithm("ARS", CONTRIB, field="n_delta"),
    Algorithm("TD3", SB3, field="target_policy_noise"),
    Algorithm("CrossQ", CONTRIB, field="policy_delay"),
    Algorithm("SAC", SB3, field="target_entropy"),
    Algorithm("DQN", SB3, field="exploration_fraction"),
    Algorithm("PPO", SB3, field="clip_range"),
    Algorithm("A2C", SB3, field="gae_lambda"),
)
UNSUPPORTED = {"MaskablePPO": "they need an action mask, which the file does not hold"}


def load(file: Path, trusted: bool) -> Any:
    """Load the model in a file.

    Raises
    ------
    UserError
        when the file is not trusted or not a policy file, its algorithm is not supported, or a package is missing.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            fields = json.loads(archive.read("data"))
            bases = [str(fields["policy_class"]["__module__"])]
    except FileNotFoundError:
        raise UserError(f"{file}: there is no such file") from None
    except (zipfile.BadZipFile, zlib.error, RuntimeError, OSError, KeyError, TypeError, ValueError):
        raise UserError(f"{file}: not a policy that Stable-Baselines3 has saved") from None
    require_trust(file, trusted)
    for package in [SB3, CONTRIB] if bases[0].startswith(CONTRIB) else [SB3]:
        require(file, package)
    if not bases[0].startswith((SB3, CONTRIB)):  # the user's own class: its base classes tell the algorithm
        bases = [kind.__module__ for kind in guarded(file, lambda: stored_class(file)).__mro__]
    algorithm = recognise(file, set(fields), bases)
    require(file, algorithm.package)
    if algorithm.name in UNSUPPORTED:
        raise UserError(f"{file}: policies of {algorithm.name} are not supported: {UNSUPPORTED[algorithm.name]}")
    kind = getattr(import_module(algorithm.package), algorithm.name)
    return guarded(file, lambda: kind.load(file, device="cpu"))


def normalizer(file: Path, trusted: bool, model: Any) -> Normalize:
    """Load the statistics that `VecNormalize.save` has written; the file name "none" leaves observations unchanged.

    Raises
    ------
    UserError
        when the file is not trusted, has no such statistics, or its observations have another shape than the model's.
    """
    if str(file) == "none":
        return lambda seen: seen
    if not file.is_file():
        raise UserError(f"--normalize {file}: there is no such file")
    require_trust(file, trusted)
    from stable_baselines3.common.save_util import load_from_pkl
    from stable_baselines3.common.vec_env import VecNormalize

    found = guarded(file, lambda: load_from_pkl(file))
    if not isinstance(found, VecNormalize):
        raise UserError(f"--normalize {file}: not what VecNormalize.save writes, but a {type(found).__name__}")
    if not found.norm_obs:
        return lambda seen: seen
    shape = getattr(found.obs_rms, "mean", np.empty(0)).shape
    if shape != model.observation_space.shape:
        raise UserError(
            f"--normalize {file}: statistics of observations of the shape {shape}; the policy observes "
            f"{model.observation_space}"
        )
    return lambda seen: np.asarray(found.normalize_obs(seen), np.float32)


def was_normalized(model: Any) -> bool:
    """Guess from the model's last observations whether it was trained through VecNormalize.

    A model without a replay buffer keeps the last observation and the original one: they differ if it was normalised.
    With a replay buffer the original may be older, so the test is whether the last one lies in the observation space.
    """
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

    seen, original = model._last_obs, model._last_original_obs
    if isinstance(model, OffPolicyAlgorithm):
        return seen is not None and not all(map(model.observation_space.contains, seen))
    return original is not None and not np.array_equal(seen, original)


def require_trust(file: Path, trusted: bool) -> None:
    if not trusted:
        raise UserError(
            f"{file}: a file of Stable-Baselines3 can run any code when it is loaded; "
            f"if you trust who made it, add --trust"
        )


def require(file: Path, package: str) -> None:
    if find_spec(package) is None:
        raise UserError(f"{file} needs the package {package}: pip install {package.replace('_', '-')}")


def stored_class(file: Path) -> Any:
    """Return the class of the policy in a trusted file."""
    from stable_baselines3.common.save_util import load_from_zip_file

    data, _, _ = load_from_zip_file(file, device="cpu")
    return (data or {})["policy_class"]


def recognise(file: Path, fields: set[str], bases: list[str]) -> Algorithm:
    """Return the algorithm that saved these fields; `bases` are the modules of the policy's class and its bases."""
    for algorithm in ALGORITHMS:
        by_module = algorithm.module and any(base.startswith(algorithm.module) for base in bases)
        if by_module or algorithm.field in fields:
            return algorithm
    names = ", ".join(algorithm.name for algorithm in ALGORITHMS if algorithm.name not in UNSUPPORTED)
    raise UserError(f"{file}: saved by an unknown algorithm; the known ones are {names}")


def guarded(file: Path, make: Callable[[], Any]) -> Any:
    """Return what `make` reads from a trusted file; UserError for any exception, since a pickle may raise any."""
    try:
        return make()
    except Exception as error:
        reason = next(iter(str(error).splitlines()), "")
        raise UserError(f"{file}: cannot be loaded: {type(error).__name__}: {reason}") from None
