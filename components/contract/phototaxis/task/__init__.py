"""The light-seeking task of the paper: observations, actions, rewards, and the end of an episode.

"Combining Q-Learning with Artificial Neural Networks in an Adaptive Light Seeking Robot"; each definition names its
section. The same definitions serve one robot, with a number for each quantity, and N robots, with an array whose last
axis is N.
"""

from phototaxis.task.actions import ACTIONS, FORWARD, MIRRORED, MOTORS, MOVING, action_of
from phototaxis.task.episode import Episode
from phototaxis.task.history import EQUAL_LIGHT, UNCHANGED_STEPS, LightHistory
from phototaxis.task.observation import (
    BACK,
    FRONT,
    GOAL_LIGHT,
    LEFT,
    RIGHT,
    BatchObservation,
    Observation,
    at_goal,
)
from phototaxis.task.options import OWN_REWARD, TaskOptions
from phototaxis.task.percepts import PERCEPTS, Percept, PerceptState, state_number
from phototaxis.task.rewards import REWARDS, Reward, Scheme

__all__ = [
    "ACTIONS", "BACK", "EQUAL_LIGHT", "FORWARD", "FRONT", "GOAL_LIGHT", "LEFT", "MIRRORED", "MOTORS", "MOVING",
    "OWN_REWARD", "PERCEPTS", "REWARDS", "RIGHT", "UNCHANGED_STEPS", "BatchObservation", "Episode", "LightHistory",
    "Observation", "Percept", "PerceptState", "Reward", "Scheme", "TaskOptions", "action_of", "at_goal", "state_number",
]  # fmt: skip
