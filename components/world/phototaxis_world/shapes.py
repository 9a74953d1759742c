"""Makes the arena's static pymunk shapes for physics and for rays (needs the extra `world`)."""

import pymunk
from phototaxis.geometry.arena import Arena


def static_shapes(arena: Arena, body: pymunk.Body) -> list[pymunk.Shape]:
    """Make the shapes of all that does not move: the room, polygons, walls and discs."""
    return [
        *(pymunk.Poly(body, polygon.corners) for polygon in (*arena.boundary(), *arena.polygons)),
        *(pymunk.Segment(body, wall.start, wall.end, wall.thickness / 2) for wall in arena.walls),
        *(pymunk.Circle(body, disc.radius, disc.centre) for disc in arena.discs),
    ]
