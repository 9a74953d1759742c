"""`phototaxis demo`: a run that learns, a live view to watch it, and an evaluation of the policy, in one command."""

import json
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from phototaxis.runtime.bus import Bus
from phototaxis.runtime.checkpoint import CheckpointMetadata, load
from phototaxis.runtime.errors import ComponentFailed
from phototaxis.runtime.fmu import FmuOptions
from phototaxis.runtime.options import flags
from phototaxis.wire.messages import Control, Status

from phototaxis_launcher.options import UpOptions, parse
from phototaxis_launcher.paths import program, run_paths
from phototaxis_launcher.progress import Progress
from phototaxis_launcher.show import Show
from phototaxis_launcher.up import Run

TICKS_PER_SECOND = 10.0
"""Speed of the slow parts, at which a person can follow the robot."""
FIRST_EPOCHS, LAST_EPOCHS = 150, 300
"""Epochs at the beginning and at the end of learning that the demo shows slowly."""
SEEN = f"""\
What you see: on the left the arena with its light, the robot with its sonar rays, and its trail, coloured by reward;
in the middle the share of episodes that reached the light, rewards and light; on the right what the robot has learned.
The first and the last part are shown slowly, {TICKS_PER_SECOND:g} steps a second."""
PLACEMENTS = 200
"""Random placements from which the demo measures the learned policy."""
PAPER_EPOCHS = 3000
"""Learning steps after which the paper measures its Q-table on the simple percept."""


def main(argv: Sequence[str]) -> int:
    options, fmus, words = parse(argv, "phototaxis demo")
    watched = sys.stderr.isatty() and not (options.json or options.no_recorder)
    show = Story(options, fmus, stays=watched, paced=bool(watched and options.epochs and not options.speed))
    run = Run(options, fmus, words, show)
    status = run.go()
    result = run.result(status)
    if options.json:
        print(json.dumps({**result, "evaluation": show.found}), flush=True)
    elif show.found is None:
        print("the run was stopped before its end, so its policy is not evaluated", file=sys.stderr)
        print(*run_paths(result), sep="\n", file=sys.stderr)
    return run.end(status)


class Story(Show):
    """Presents a run to a newcomer: slow at first, then at full speed, then slow again; then evaluates the policy.

    Parameters
    ----------
    stays : whether the viewer stays up until Ctrl-C after the run.
    paced : whether the beginning and the end of the run are slow; if not, all of it runs at its own speed.

    Attributes
    ----------
    found : the result of the evaluation as `phototaxis evaluate --json` prints it, or None.
    """

    def __init__(self, options: UpOptions, fmus: FmuOptions, stays: bool, paced: bool):
        self._options, self._fmus, self._stays = options, fmus, stays
        self._fast_from = min(FIRST_EPOCHS, options.epochs)
        self._slow_from = max(options.epochs - LAST_EPOCHS, self._fast_from)
        self._paced, self._chapter = paced, 0
        self._before, self._step_at, self._pause_at = (0.0, 0), math.inf, math.inf
        self.found: dict[str, Any] | None = None

    def wait(self) -> float:
        """Return the seconds until the next step or pause is due."""
        return min(max(min(self._step_at, self._pause_at) - time.monotonic(), 0.0), super().wait())

    def beat(self, bus: Bus) -> None:
        """Pause the run when the last chapter begins, and step the paused run when a step is due.

        The slow parts are single steps because a step waits for a late answer, as lockstep does, and a clock does
        not: so the learner learns the same as at full speed.
        """
        now = time.monotonic()
        if now >= self._pause_at:
            bus.control(Control(verb="pause"))
            self._step_at, self._pause_at = time.monotonic(), math.inf
        if now >= self._step_at:
            bus.control(Control(verb="step"))
            self._step_at = max(self._step_at + 1 / TICKS_PER_SECOND, now)

    def follow(self, status: Status, bus: Bus, progress: Progress) -> None:
        """Change the speed when a chapter ends, and announce the next chapter."""
        now = time.monotonic()
        (then, epoch), self._before = self._before, (now, status.epoch)
        if not self._paced:
            return
        if self._chapter == 0 and status.phase != "paused":
            bus.control(Control(verb="pause"))
        elif self._chapter == 0 and status.driver and not status.waiting_for:
            progress.say(SEEN)
            self._turn(progress, f"The robot knows nothing yet and wanders about, until epoch {self._fast_from}.")
            self._step_at = now
        elif self._chapter == 1 and status.epoch >= self._fast_from < self._slow_from:
            self._turn(progress, f"It learns at full speed, until about epoch {self._slow_from}.")
            self._step_at = math.inf
            bus.control(Control(verb="resume"))
        elif self._chapter == 2:
            made = status.epoch - epoch
            if status.epoch + made >= self._slow_from:  # the next status will come after that epoch
                self._pause_at = now + max(self._slow_from - status.epoch, 0) / max(made, 1) * (now - then)
                self._turn(progress, f"It has learned: watch it turn to the light, until epoch {status.epochs}.")

    def _turn(self, progress: Progress, text: str) -> None:
        self._chapter += 1
        progress.say(f"{self._chapter}. {text}")

    def finished(self, result: dict[str, Any]) -> bool:
        """Evaluate the policy, print a summary, and return whether the viewer stays up."""
        checkpoint = result["checkpoint"]
        self.found = self._evaluate(checkpoint) if checkpoint else None
        if not self._options.json:
            print("\n".join(self._summary(result)), flush=True)
        return self._stays

    def _evaluate(self, checkpoint: str) -> dict[str, Any]:
        """Run `phototaxis evaluate` and return its result.

        Raises
        ------
        ComponentFailed
            when the evaluation fails.
        """
        words = [f"--arena={self._options.arena}", f"--placements={PLACEMENTS}", "--json", *flags(self._fmus)]
        evaluate = [sys.executable, "-m", "phototaxis_launcher", "evaluate", checkpoint, *words]
        done = subprocess.run(evaluate, capture_output=True, text=True, check=False, start_new_session=True)
        if done.returncode:
            raise ComponentFailed(f"the evaluation failed: {done.stderr.strip()}")
        return json.loads(done.stdout)

    def _summary(self, result: dict[str, Any]) -> list[str]:
        rate = "" if self._paced else f", at {result['ticks_per_second']} ticks/s"
        lines = ["", f"{result['epochs']} epochs over the bus in {result['episodes']} episodes{rate}."]
        if self.found is not None:
            lines += [
                f"The policy, frozen, reached the light from {self.found['success_rate']:.1%} of {PLACEMENTS} fresh "
                f"random placements within {self.found['max_episode_steps']} steps."
            ]
            if is_the_papers(load(Path(result["checkpoint"]))[0], self._options, self._fmus):
                lines.append('The paper reports "upwards of 80%" for this system (section 6.2).')
            lines.append(f"Outcomes differ by seed: `{program()} train --seeds 0:20` shows twenty of them.")
        return [*lines, "", *(f"  {line}" for line in run_paths(result)), ""]


def is_the_papers(meta: CheckpointMetadata, options: UpOptions, fmus: FmuOptions) -> bool:
    """Whether the run used the system for which the paper reports its 80% (section 6.2)."""
    system = (meta.learner, meta.percept, meta.arena, options.epochs, options.robots, options.swap)
    return (
        system == ("qtable", "simple", "paper", PAPER_EPOCHS, 1, "")
        and meta.reward in ("own", "difference")
        and fmus == FmuOptions()
    )
