"""The one seat: who may drive."""


class Seat:
    """Holds the name of the driver; only the driver's commands count."""

    def __init__(self) -> None:
        self.driver = ""

    def claim(self, agent: str) -> str:
        """Sit down if the seat is free or already one's own; returns a reason when refused, else ""."""
        if not agent:
            return "a claim names its agent"
        if self.driver not in ("", agent):
            return f"the seat is taken by {self.driver}"
        self.driver = agent
        return ""

    def leave(self, agent: str) -> bool:
        """Free the seat if `agent` holds it; whether it did."""
        if self.driver != agent or not agent:
            return False
        self.driver = ""
        return True
