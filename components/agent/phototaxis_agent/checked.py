"""Wraps a learner: checks and converts what it returns, and turns its exceptions into one-line errors."""

import sys
import traceback
from collections.abc import Callable, Mapping
from copy import copy
from typing import Any, NoReturn, TypeVar

import numpy as np
from phototaxis.runtime.checkpoint import learner_hash, storable
from phototaxis.runtime.errors import ComponentFailed, UserError
from phototaxis.task import Percept, PerceptState

from phototaxis_agent.learner import Learner, Transition

T = TypeVar("T")
_OWN = {float, int}


class CheckedLearner(Learner):
    """Calls a learner from any author, and checks everything that it returns.

    Numbers of NumPy, PyTorch and others become Python numbers. A value that is not finite, or a wrong count of
    values, ends the run with a line that names the learner, the state and the step. So does an exception of the
    learner, with its file and line. The usual case, a list of floats, costs a fraction of a microsecond.

    Parameters
    ----------
    name : of the learner, for the line.
    kind : its class, made here with `options`, `percept` and `rng`.
    where : says which step it is, for the line.

    Raises
    ------
    ComponentFailed
        by every method, when the learner fails; a `UserError` of the learner's own passes.
    """

    def __init__(
        self,
        name: str,
        kind: type[Learner],
        options: Any,
        percept: Percept,
        rng: np.random.Generator,
        where: Callable[[], str],
    ):
        self.name, self._kind, self._where = name, kind, where
        self._options, self._percept, self._actions = options, percept, len(percept.actions)
        self._learner = self._call("its constructor", None, lambda: kind(options, percept, rng))
        self._remembers = kind.remember is not Learner.remember
        self.context = self._context("its context", self._call("its context", None, lambda: self._learner.context))
        self._give_back(self, self.save())

    def seen_from(self, where: Callable[[], str]) -> "CheckedLearner":
        """The same learner for a host that counts steps of its own."""
        other = copy(self)
        other._where = where
        return other

    def values(self, state: PerceptState) -> list[float]:
        try:
            values = self._learner.values(state)
        except BaseException as error:
            self._raised("values()", error, state)
        if type(values) is list and len(values) == self._actions and _plain(values):
            return values
        return self._numbers("values()", values, (self._actions,), state).tolist()

    def learn(self, transition: Transition) -> float:
        try:
            error = self._learner.learn(transition)
        except BaseException as raised:
            self._raised("learn()", raised, transition.state)
        if type(error) is float and error - error == 0.0:
            return error
        return float(self._numbers("learn()", error, (), transition.state))

    def remember(self, state: Any, action: Any, gain: Any) -> tuple[Any, ...]:
        if not self._remembers:
            return ()
        try:
            context = self._learner.remember(state, action, gain)
        except BaseException as error:
            self._raised("remember()", error, state)
        if not isinstance(context, tuple) or len(context) != len(self.context):
            expected = f"a tuple of {len(self.context)} values, as many as its context has"
            self._broken(f"remember() gave {_described(context)}; expected {expected}", state)
        if isinstance(gain, np.ndarray):
            return tuple(self._of_many(one, gain.shape) for one in context)
        return context if _plain(context) else self._context("remember()", context, state)

    def batch_values(self, states: np.ndarray) -> np.ndarray:
        if self._kind.batch_values is Learner.batch_values:
            return super().batch_values(states)
        values = self._call("batch_values()", None, lambda: self._learner.batch_values(states.copy()))
        return self._numbers("batch_values()", values, (len(states), self._actions))

    def save(self) -> dict[str, np.ndarray]:
        """Everything learned, as arrays of its own that a checkpoint can hold."""
        arrays: Any = self._call("save()", None, self._learner.save)
        if not isinstance(arrays, Mapping):
            self._broken(f"save() gave {_described(arrays)}; expected a dict of named arrays")
        named: dict[Any, np.ndarray] = {}
        for name, array in arrays.items():
            try:
                named[name] = _array(array)
            except Exception:  # whatever an array of somebody's library raises
                self._broken(f"save() gave {_described(array)} as '{name}', which is no array of numbers")
        try:
            return {name: array.copy() for name, array in storable(named).items()}
        except UserError as why:
            self._broken(f"save(): {why}")

    def load(self, arrays: dict[str, np.ndarray]) -> None:
        """Take over saved arrays; ValueError when they do not fit."""
        try:
            self._learner.load({name: array.copy() for name, array in arrays.items()})
        except ValueError as error:
            raise ValueError(" ".join(str(error).split())) from error
        except BaseException as error:
            self._raised("load()", error)
        if learner_hash(self.save()) != learner_hash(arrays):
            self._broken("load() does not bring back what save() gave: saved again, it is something else")

    def prove(self, arrays: dict[str, np.ndarray]) -> None:
        """Try whether a fresh learner of this kind can take over what this one has saved."""
        fresh = CheckedLearner(
            self.name, self._kind, self._options, self._percept, np.random.default_rng(), self._where
        )
        self._give_back(fresh, arrays)

    def _give_back(self, learner: "CheckedLearner", arrays: dict[str, np.ndarray]) -> None:
        try:
            learner.load(arrays)
        except ValueError as error:
            self._broken(f"load() does not take what save() gave: {error}")

    def _call(self, what: str, state: Any, call: Callable[[], T]) -> T:
        try:
            return call()
        except BaseException as error:
            self._raised(what, error, state)

    def _context(self, what: str, context: Any, state: Any = None) -> tuple[float, ...]:
        """A context as numbers; whole ones stay whole, so that a state is the same when it is met again."""
        if not isinstance(context, tuple):
            self._broken(f"{what} is {_described(context)}; expected a tuple of numbers", state)
        self._numbers(what, context, (len(context),), state)
        return tuple(_array(one).item() for one in context)

    def _of_many(self, given: Any, shape: tuple[int, ...]) -> np.ndarray:
        """One variable of the contexts of many robots; one number is for all."""
        return self._numbers("remember()", np.full(shape, given) if not np.ndim(given) else given, shape)

    def _numbers(self, what: str, given: Any, shape: tuple[int, ...], state: Any = None) -> np.ndarray:
        """What was given as an array of this shape, its precision as it is."""
        try:
            array = _array(given)
        except Exception:  # whatever an array of somebody's library raises
            array = np.array(None)
        if array.dtype.kind not in "biuf":
            self._broken(f"{what} gave {_described(given)}; expected {_amount(shape)}", state)
        if array.shape != shape and not (array.size == 1 and not shape):
            found = f"{'×'.join(map(str, array.shape)) or 'one'} number{'s' if array.size != 1 else ''}"
            allowed = f" (the percept '{self._percept.name}' allows {self._actions} actions)" if shape else ""
            self._broken(f"{what} gave {found}; expected {_amount(shape)}{allowed}", state)
        array = array if array.dtype in (np.float32, np.float64) else array.astype(float)
        if not np.isfinite(array).all():
            self._broken(f"{what} gave {array[~np.isfinite(array)][0]}, which is no finite number", state)
        return array.reshape(shape)

    def _raised(self, what: str, error: BaseException, state: Any = None) -> NoReturn:
        if isinstance(error, (UserError, KeyboardInterrupt)):
            raise error
        said = " ".join(_words(str, error).split())[:500]
        text = f"called sys.exit({said})" if isinstance(error, SystemExit) else f"raised {type(error).__name__}: {said}"
        self._broken(f"{what} {text.removesuffix(': ')} ({self._place(error)})", state, error)

    def _place(self, error: BaseException) -> str:
        """File and line of the learner's own code where it happened."""
        frames = [one for one in traceback.extract_tb(error.__traceback__) if one.filename != __file__]
        files = [getattr(sys.modules.get(one.__module__), "__file__", "") for one in self._kind.__mro__]
        own = [one for one in frames if one.filename in files] or frames
        return f"{own[-1].filename}, line {own[-1].lineno}" if own else str(files[0])

    def _broken(self, text: str, state: Any = None, cause: BaseException | None = None) -> NoReturn:
        met = "" if state is None else f", state ({', '.join(f'{one:g}' for one in state)})" if _single(state) else ""
        where = self._where()
        raise ComponentFailed(f"learner {self.name}: {text}{f'; {where}{met}' if where else ''}") from cause


def _plain(numbers: Any) -> bool:
    """Whether these are finite numbers of Python's own; one that is not makes the sum another's, or none."""
    try:
        total = sum(numbers)
    except Exception:  # whatever a number of somebody's library raises
        return False
    return type(total) in _OWN and total - total == 0


def _array(value: Any) -> np.ndarray:
    """A value as NumPy has it; of a tensor, what it holds."""
    detach = getattr(value, "detach", None)
    return np.asarray(value if detach is None else detach().cpu())


def _described(value: Any) -> str:
    """A value in a few words."""
    text = " ".join(_words(repr, value).split())
    return text if len(text) <= 60 else f"{text[:60]}… ({type(value).__name__})"


def _words(tell: Callable[[Any], str], value: Any) -> str:
    """What `str` or `repr` tells of a value; nothing but its type when it cannot be told."""
    try:
        return tell(value)
    except Exception:  # whatever an object of somebody's library raises
        return f"<{type(value).__name__}>"


def _amount(shape: tuple[int, ...]) -> str:
    return f"{'×'.join(map(str, shape))} numbers" if shape else "a number"


def _single(state: Any) -> bool:
    """Whether this is the state of one robot."""
    return all(not np.ndim(one) for one in state)
