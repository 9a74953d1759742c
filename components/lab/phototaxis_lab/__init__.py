"""The same classes in one process, without a bus: training, evaluation, experiments."""
