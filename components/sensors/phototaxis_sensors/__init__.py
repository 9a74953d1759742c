"""The robot's senses: sonar, light and bumpers as pure functions of (world, state, seed)."""
