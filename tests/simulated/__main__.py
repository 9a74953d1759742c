"""`python -m simulated FIRST:LAST`, with the folder `tests` on the path."""

import sys

from simulated.storm import main

sys.exit(main(sys.argv[1:]))
