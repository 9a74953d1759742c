"""Values that many tests make."""

from phototaxis.wire.messages import Readings
from phototaxis_agent.learner import available_learners


def own_learners() -> list[str]:
    """Names of the learners that come with this project, whatever else is installed."""
    return [
        name
        for name, point in available_learners().items()
        if point.dist is not None and point.dist.name == "phototaxis"
    ]


def readings(tick: int = 0, light: tuple[float, float] = (0.1, 0.1), **changes) -> Readings:
    """Readings far from everything, with changes."""
    fields = {
        "run": "r", "tick": tick, "episode": 0, "epoch": tick, "sonar": [5.0] * 16, "light": light,
        "front": False, "rear": False, "left": 0.0, "right": 0.0, "author": "", "driver": "",
    }  # fmt: skip
    return Readings(**{**fields, **changes})
