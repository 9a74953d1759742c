"""The world: arena, physics, time and the seat."""
