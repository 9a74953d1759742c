"""Computes cells in parallel, on the cores of this machine or on a Dask cluster."""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError
from phototaxis.runtime.errors import ComponentFailed, Unavailable

from phototaxis_lab.cell import Cell, Outcome, run

SCHEDULER_TIMEOUT_S = 10.0
"""Seconds to wait for a Dask scheduler."""


def outcomes(cells: Sequence[Cell], jobs: int = -1) -> Iterator[tuple[int, Outcome]]:
    """Compute the cells; yield the index and the outcome of each as it is done.

    The longest cells begin first, so that the cores stay busy until the end.

    Parameters
    ----------
    jobs : number of processes, −1 for one on each core; within `cluster`, the cluster decides.

    Raises
    ------
    ComponentFailed
        when a process dies.
    """
    order = sorted(range(len(cells)), key=lambda index: -cells[index].epochs)
    work: Any = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
    try:
        yield from work(joblib.delayed(_numbered)(index, cells[index]) for index in order)
    except TerminatedWorkerError:
        learners = ", ".join(sorted({cell.system.learner for cell in cells}))
        line = "a process died while learning: its learner ended it, crashed, or used too much memory"
        raise ComponentFailed(f"{line} (learners: {learners})") from None


def _numbered(index: int, cell: Cell) -> tuple[int, Outcome]:
    return index, run(cell)


def cluster(backend: str, scheduler: str) -> AbstractContextManager[Any]:
    """Choose where `outcomes` computes: "local", or "dask" with the address of a scheduler.

    Raises
    ------
    Unavailable
        when the scheduler does not answer within 10 s.
    """
    return _Dask(scheduler) if backend == "dask" else nullcontext()


class _Dask(AbstractContextManager[None]):
    def __init__(self, scheduler: str):
        from distributed import Client

        try:
            self._client = Client(scheduler, timeout=SCHEDULER_TIMEOUT_S, set_as_default=True)
        except (OSError, ValueError, TimeoutError) as error:
            raise Unavailable(f"--scheduler {scheduler}: no Dask scheduler answers there: {error}") from None
        self._config = joblib.parallel_config(backend="dask")

    def __enter__(self) -> None:
        self._config.__enter__()

    def __exit__(self, *error: Any) -> None:
        self._config.__exit__(*error)
        self._client.close()
