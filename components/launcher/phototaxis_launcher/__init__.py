"""The `phototaxis` command: starts the processes of a run, watches over them, and finds its way to the rest."""
