"""Makes `python -m phototaxis_launcher` the same as `phototaxis`."""

from phototaxis_launcher.cli import main

main()
