"""What a ray can hit: the arena's static shapes in pymunk's spatial index."""

import pymunk
from phototaxis.geometry.arena import Arena
from phototaxis_world.shapes import static_shapes

_ALL = pymunk.ShapeFilter()


class Scene:
    """Casts rays among walls and obstacles; the cost hardly grows with their number."""

    def __init__(self, arena: Arena):
        self._space = pymunk.Space()
        body = self._space.static_body
        self._space.add(*static_shapes(arena, body))
        for wall in arena.walls:  # a segment's own query overlooks its round end where a ray meets the side too
            self._space.add(*(pymunk.Circle(body, wall.thickness / 2, end) for end in (wall.start, wall.end)))

    def hit(self, start: tuple[float, float], end: tuple[float, float]) -> float:
        """Where between `start` (0) and `end` (1) the ray first hits; 1 when it hits nothing."""
        found = self._space.segment_query_first(start, end, 0, _ALL)
        return 1.0 if found is None else found.alpha

    def blocked(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Whether anything stands between two points."""
        return self._space.segment_query_first(start, end, 0, _ALL) is not None
