"""The `phototaxis` command: starts and supervises the processes of a run, and dispatches all subcommands."""
