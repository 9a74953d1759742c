"""The shipped examples: this file lists their variables; the C files beside it hold their equations."""

from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent


class Variable(NamedTuple):
    """One variable of an example; the model description and the C code are generated from it."""

    name: str
    causality: str
    start: float | None
    unit: str
    about: str
    size: int = 1
    low: float | None = None
    high: float | None = None


class Example(NamedTuple):
    """A model in C and its variables."""

    name: str
    about: str
    variables: tuple[Variable, ...]
    folder: Path = FOLDER
    """The folder of NAME.c."""


DISTANCE = Variable("distance", "input", 0.0, "m", "distance from the sensor to the lamp")
BEARING = Variable("bearing", "input", 0.0, "rad", "direction of the lamp: 0 straight ahead, positive to the left")
BRIGHTNESS = Variable("brightness", "input", 1.0, "1", "brightness of the lamp")
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
                Variable("range", "parameter", 0.0, "m", "range of the linear law; 0: inverse square law"),
            ),
        ),
        Example(
            "lag",
            "A first-order lag: a slow sensor",
            (
                Variable("u", "input", 0.0, "", "reading of a fast sensor"),
                Variable("y", "output", None, "", "reading of this sensor"),
                Variable("tau", "parameter", 0.2, "s", "time constant", low=0.0),
            ),
        ),
        Example(
            "photodiode",
            "A directed photodiode that saturates",
            (
                DISTANCE, BEARING, BRIGHTNESS, VISIBILITY, READING,
                Variable("half", "parameter", 0.5, "1", "irradiance that gives half the full current", low=1e-6),
                Variable("directivity", "parameter", 0.5, "1", "0: all directions alike; 1: cosine", low=0.0, high=1.0),
            ),
        ),
        Example(
            "sonar",
            "Sixteen cheap rangers: coarse, and blind at close range",
            (
                Variable("range", "input", 8.0, "m", "distance to what the beam meets", size=16),
                Variable("reading", "output", None, "m", "reading of the ranger", size=16, low=0.0),
                Variable("resolution", "parameter", 0.05, "m", "smallest step of a reading", low=1e-6),
                Variable("blind", "parameter", 0.1, "m", "smallest reading", low=0.0),
            ),
        ),
    )
}  # fmt: skip
