"""What all tests share: an arena, a setup."""

import signal

import pytest
from fmus import fmu as fmu
from phototaxis.geometry.arena import Arena
from phototaxis_agent.setup import AgentSetup, make_setup
from phototaxis_sim import arenas

# Started in the background of a script, the tests inherit an ignored SIGINT, and so would what they interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def paper() -> Arena:
    """The paper's arena."""
    return arenas.load("paper")


@pytest.fixture
def setup() -> AgentSetup:
    """The default agent: Q-table, simple percept."""
    return make_setup()
