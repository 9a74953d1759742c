"""Trains, evaluates and compares agents in one process without a bus, with the same classes as on the bus."""
