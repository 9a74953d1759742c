"""The paper's net with a linear output (its section 8): Q-values may be any number, rewards stay as they are."""

from phototaxis_agent.learners.ann import Ann


class AnnLinear(Ann):
    """As `Ann`, but for the output."""

    linear = True
