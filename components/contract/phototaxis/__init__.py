"""What every Phototaxis process shares: messages, topics, the bus, the step protocol and the task."""

from importlib.metadata import version

__version__ = version("phototaxis")
