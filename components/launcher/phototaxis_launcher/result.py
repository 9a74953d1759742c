"""The outcome of a run: a result for programs, a summary for people, and an exit code."""

from typing import Any

from phototaxis.runtime.checkpoint import load
from phototaxis.runtime.errors import EXIT_INTERRUPTED, ComponentFailed
from phototaxis.wire.messages import Status

from phototaxis_launcher.folder import RunFolder
from phototaxis_launcher.options import UpOptions
from phototaxis_launcher.paths import run_paths
from phototaxis_launcher.processes import Processes

MAX_LATE_SHARE = 0.95
"""A run in real time has failed when a larger share of its ticks had no command in time."""


def result(status: Status, options: UpOptions, folder: RunFolder, processes: Processes) -> dict[str, Any]:
    """Return the outcome of a run as plain data.

    Learner and checkpoint are those of the last driver; they are None if the launcher did not start it.
    """
    agents = {ident: agent for agent in processes.agents for ident in agent.idents}
    last = agents.get(status.drivers[-1].driver) if status.drivers else None
    unsaved = last is None or last.fault() or not folder.checkpoint(last.name).exists()
    checkpoint = None if last is None or unsaved else folder.checkpoint(last.name)
    meta = load(checkpoint)[0] if checkpoint else None
    recordings = folder.recordings
    return {
        "run": status.run,
        "arena": options.arena,
        "seed": options.seed if status.run == folder.run else None,
        "learner": meta.learner if meta else None,
        "drivers": [
            {
                "driver": one.driver,
                "learner": agents[one.driver].label if one.driver in agents else None,
                "checkpoint": str(folder.checkpoint(agents[one.driver].name)) if one.driver in agents else None,
                "from_tick": one.tick,
                "how": one.how,
            }
            for one in status.drivers
        ],
        "finished": status.phase == "finished",
        "epochs": status.epoch,
        "episodes": status.episodes,
        "reached": status.reached,
        "recent_success": status.recent,
        "ticks": status.tick,
        "ticks_per_second": round(status.mean_rate, 1),
        "state_hash": status.hash,
        "learner_hash": meta.learner_hash if meta else None,
        "recording": str(recordings[-1]) if recordings else None,
        "checkpoint": str(checkpoint) if checkpoint else None,
        "restarts": {child.name: child.restarts for child in processes.all() if child.restarts},
        "late_ticks": status.late,
        "late_sensors": status.late_sensors,
        "refused": status.refused,
        "warnings": [*status.warnings, *map(str, processes.faults())],
    }


def summary(result: dict[str, Any]) -> list[str]:
    """Describe a result in lines for a person."""
    line = (
        f"{result['epochs']} epochs, {result['episodes']} episodes, {result['reached']} of them reached the light; "
        f"{result['ticks_per_second']} ticks/s"
    )
    late = [f"late        {result['late_ticks']} ticks without a command in time"] if result["late_ticks"] else []
    return [line, *late, *run_paths(result)]


def exit_code(status: Status, processes: Processes, interrupted: bool) -> int:
    """Return the exit code of a run, after its result is printed.

    Raises
    ------
    UserError
        for faults that did not end the run: a recording or a checkpoint could not be written, or the robot stood
        still because no command came in time.
    """
    for fault in processes.faults():
        raise fault
    if interrupted:
        return EXIT_INTERRUPTED
    if status.late > MAX_LATE_SHARE * status.tick:
        part = "sensors" if 2 * status.late_sensors > status.late else "agent"
        line = f"only {status.tick - status.late} of {status.tick} ticks had a command in time"
        raise ComponentFailed(
            f"{line}, the robot stood still: the {part} cannot keep up; lower --speed (0: as fast as possible)"
        )
    return 0
