"""`phototaxis demo`: the whole story in one command, from a clone to a measured policy."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from phototaxis.errors import ComponentFailed
from phototaxis.options import flags

from phototaxis_launcher import up
from phototaxis_launcher.progress import Progress


def main(argv: Sequence[str]) -> int:
    options, fmus, words = up.parse(argv, "phototaxis demo")
    run = up.Run(options, fmus, words)
    status = run.go(Progress(options.epochs))
    result = run.result(status)
    if not result["finished"]:
        print("stopped before the end; nothing is evaluated", file=sys.stderr)
        return 0
    if result["checkpoint"] is None:
        run.judge()
    placements = 200
    evaluate = [sys.executable, "-m", "phototaxis_launcher", "evaluate", str(run.checkpoint), "--json", *flags(fmus)]
    evaluate.append(f"--arena={options.arena}")
    done = subprocess.run([*evaluate, f"--placements={placements}"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ComponentFailed(f"the evaluation failed: {done.stderr.strip()}")
    found = json.loads(done.stdout)
    print(
        f"""
{result["epochs"]} epochs over the bus in {result["episodes"]} episodes, at {result["ticks_per_second"]} ticks/s.
The policy, frozen, reached the light from {found["success_rate"]:.1%} of {placements} fresh random placements
within {found["cap"]} steps. The paper reports "upwards of 80%" for this system (section 6.2).

  (Outcomes differ by seed: `phototaxis train --seeds 0:20` shows twenty of them.)

  watched at  {run.url or "(no viewer)"}
  recording   {result["recording"]}
              look again: {Path(sys.executable).parent / "phototaxis"} view {result["recording"]}
  checkpoint  {result["checkpoint"]}
              measure again: {Path(sys.executable).parent / "phototaxis"} evaluate {result["checkpoint"]}"""
    )
    run.judge()
    return 0
