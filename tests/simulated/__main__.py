"""`python -m simulated FIRST:LAST`, with the folder `tests` on the path: runs the schedules of a range of seeds.

Variables of the environment: EPOCHS=N makes longer runs, TRACE=1 prints line by line what happens in each of them, and
COVERAGE=1 prints how often each transition of the machines was taken.
"""

import os
import sys
import time
from collections import Counter

from tqdm import tqdm

from simulated.runs import results, run
from simulated.schedule import EPOCHS, make
from simulated.shrink import shrink, told
from simulated.taken import table
from simulated.trace import Trace


def main(words: list[str]) -> int:
    asked = words[0] if words else "0:200"
    first, _, last = asked.partition(":")
    try:
        seeds = range(int(first), int(last) if last else int(first) + 1)
        epochs = int(os.environ.get("EPOCHS", EPOCHS))
    except ValueError as error:
        print(f"expected SEEDS=FIRST or FIRST:LAST, got {asked}, and EPOCHS=N: {error}", file=sys.stderr)
        return 2
    if os.environ.get("TRACE"):
        return _trace(seeds, epochs)
    covered = bool(os.environ.get("COVERAGE"))
    began, ticks, failed, faults, taken = time.perf_counter(), 0, 0, Counter[str](), Counter[tuple[str, str, str]]()
    for seed, found in tqdm(results(seeds, epochs, covered), total=len(seeds), unit=" schedules"):
        ticks, faults, taken = ticks + found.ticks, faults + found.faults, taken + found.taken
        if found.wrong:
            failed += 1
            simplest = shrink(make(seed, epochs), lambda schedule: run(schedule).wrong)
            print(f"seed {seed}: {found.wrong}; as simple as it gets:{told(simplest)}", flush=True)
    seconds = time.perf_counter() - began
    for line in table(taken) if covered else ():
        print(line)
    rate = f"{ticks / seconds:.0f} ticks/s, {len(seeds) / seconds:.1f} schedules/s"
    print(f"{len(seeds)} schedules, {ticks} ticks, {failed} failed; {rate}")
    print(", ".join(f"{kind}: {count}" for kind, count in sorted(faults.items())))
    return 1 if failed else 0


def _trace(seeds: range, epochs: int) -> int:
    wrong = ""
    for seed in seeds:
        schedule = make(seed, epochs)
        print(f"seed {seed}:{told(schedule)}")
        with Trace(print).watching():
            wrong = run(schedule).wrong or wrong
        print(wrong or "ends with the hashes of the run in one process")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
