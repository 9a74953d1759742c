"""What physics and rays must have in common and that needs more than NumPy: the room's shapes in pymunk."""
