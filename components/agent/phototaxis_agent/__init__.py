"""The learning agent: the loop around a learner."""
