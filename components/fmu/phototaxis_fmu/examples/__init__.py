"""The shipped examples: their variables here, their equations in C beside this file."""

from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent


class Variable(NamedTuple):
    """One variable of an example: for the model description and for the C code."""

    name: str
    causality: str
    start: float | None
    unit: str
    about: str
    size: int = 1
    low: float | None = None
    high: float | None = None


class Example(NamedTuple):
    """A model in C."""

    name: str
    about: str
    variables: tuple[Variable, ...]
    folder: Path = FOLDER
    """Where NAME.c is."""


DISTANCE = Variable("distance", "input", 0.0, "m", "from the sensor to the lamp")
BEARING = Variable("bearing", "input", 0.0, "rad", "of the lamp, from straight ahead, to the left positive")
BRIGHTNESS = Variable("brightness", "input", 1.0, "1", "of the lamp")
VISIBILITY = Variable("visibility", "input", 0.0, "1", "1: in sight; 0: hidden by a wall or by the robot's own body")
READING = Variable("reading", "output", None, "1", "0 dark to 1 at the light", low=0.0)

EXAMPLES = {
    example.name: example
    for example in (
        Example(
            "light",
            "The built-in light law",
            (
                DISTANCE, BRIGHTNESS, VISIBILITY, READING,
                Variable("range", "parameter", 0.0, "m", "of the linear law; 0: inverse square"),
            ),
        ),
        Example(
            "lag",
            "A first-order lag: a slow sensor",
            (
                Variable("u", "input", 0.0, "", "what a fast sensor would read"),
                Variable("y", "output", None, "", "what this one reads"),
                Variable("tau", "parameter", 0.2, "s", "time constant", low=0.0),
            ),
        ),
        Example(
            "photodiode",
            "A directed photodiode that saturates",
            (
                DISTANCE, BEARING, BRIGHTNESS, VISIBILITY, READING,
                Variable("half", "parameter", 0.5, "1", "irradiance of half the full current", low=1e-6),
                Variable("directivity", "parameter", 0.5, "1", "0: sees all round; 1: as a cosine", low=0.0, high=1.0),
            ),
        ),
        Example(
            "sonar",
            "Sixteen cheap rangers: coarse, and blind at close range",
            (
                Variable("range", "input", 8.0, "m", "to what the beam meets", size=16),
                Variable("reading", "output", None, "m", "what the ranger says", size=16, low=0.0),
                Variable("resolution", "parameter", 0.05, "m", "smallest step of a reading", low=1e-6),
                Variable("blind", "parameter", 0.1, "m", "smallest reading", low=0.0),
            ),
        ),
    )
}  # fmt: skip
