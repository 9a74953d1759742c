"""A component is tethered to whoever started it."""

import subprocess
import sys

HELD = """
from phototaxis.runtime import component
component.ORDERLY_END_S = 0.01
component._hold_tether(lambda: print("asked to stop", flush=True))
"""


def test_one_that_cannot_end_in_good_order_leaves_nevertheless():
    words = [sys.executable, "-c", HELD]
    done = subprocess.run(words, input="", capture_output=True, text=True, timeout=60, check=False)
    assert (done.stdout, done.returncode) == ("asked to stop\n", 4)
