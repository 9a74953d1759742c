"""`python -m phototaxis_launcher` is `phototaxis`."""

from phototaxis_launcher.cli import main

main()
