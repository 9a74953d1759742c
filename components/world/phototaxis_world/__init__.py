"""The room's shapes in pymunk, which the simulation and the sensors share."""
