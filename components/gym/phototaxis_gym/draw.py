"""Draws the arena and its robot, as pictures or in a window."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from phototaxis.geometry.arena import Arena
from PIL import Image, ImageDraw

SIDE_PIXELS = 480
"""Length of a picture's longer side."""
PAPER, INK, STONE, YELLOW, BLUE, RAY = "#f6f6f3", "#3c3c3c", "#787878", "#f0b400", "#145aaa", "#b4c8dc"


def frame_rate(arena: Arena) -> float:
    """Return the frames per second at which a film with one frame for each step runs in real time."""
    return 1 / arena.motion.control_period


class Canvas:
    """Draws the robot and its sonar rays into a picture of the arena, whose longer side has `side` pixels."""

    def __init__(self, arena: Arena, side: int = SIDE_PIXELS):
        self._arena, self._scale = arena, side / max(arena.size)
        self._mounts = [(sonar.position, sonar.angle) for sonar in arena.robot.sonars]
        width, height = (round(self._scale * side) for side in arena.size)
        self._still = Image.new("RGB", (width, height), PAPER)
        draw = ImageDraw.Draw(self._still)
        draw.rectangle((0, 0, width - 1, height - 1), outline=INK, width=3)
        for wall in arena.walls:
            draw.line([self._at(*wall.start), self._at(*wall.end)], STONE, max(round(wall.thickness * self._scale), 1))
        for polygon in arena.polygons:
            draw.polygon([self._at(*corner) for corner in polygon.corners], STONE)
        for disc in arena.discs:
            draw.circle(self._at(*disc.centre), disc.radius * self._scale, STONE)
        for light in arena.lights:
            draw.circle(self._at(*light.position), 0.14 * self._scale, YELLOW)

    def draw(self, pose: tuple[float, float, float], sonar: Sequence[float]) -> np.ndarray:
        """Return a picture, (height, width, 3) uint8, of the robot at a pose (m, rad) with its 16 `sonar` rays (m)."""
        picture = self._still.copy()
        draw = ImageDraw.Draw(picture)
        robot = self._arena.robot
        for (mount, angle), length in zip(self._mounts, sonar, strict=True):
            end = mount[0] + length * math.cos(angle), mount[1] + length * math.sin(angle)
            draw.line([self._on(pose, mount), self._on(pose, end)], RAY)
        x, y = robot.length / 2, robot.width / 2
        draw.polygon([self._on(pose, corner) for corner in ((x, y), (-x, y), (-x, -y), (x, -y))], BLUE)
        for sensor in robot.light_sensors:
            draw.circle(self._on(pose, sensor), 2, YELLOW)
        return np.array(picture)

    def _on(self, pose: tuple[float, float, float], point: tuple[float, float]) -> tuple[float, float]:
        """Convert a point in the robot's frame to pixels."""
        x, y, heading = pose
        cos, sin = math.cos(heading), math.sin(heading)
        return self._at(x + cos * point[0] - sin * point[1], y + sin * point[0] + cos * point[1])

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return x * self._scale, (self._arena.size[1] - y) * self._scale


def tiles(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Combine pictures of the same size into one, row by row, with about as many rows as columns."""
    columns = math.ceil(math.sqrt(len(pictures)))
    blank = np.zeros_like(pictures[0])
    padded = [*pictures, *[blank] * (-len(pictures) % columns)]
    return np.vstack([np.hstack(padded[row : row + columns]) for row in range(0, len(padded), columns)])


class Window:
    """A window on the screen; it opens with its first picture, and again with the first one after `close`."""

    def __init__(self, fps: float):
        import pygame

        self._pygame, self._fps, self._clock = pygame, fps, pygame.time.Clock()
        self._surface = None

    def show(self, picture: np.ndarray) -> None:
        """Show a picture, and wait as long as one frame lasts."""
        pygame = self._pygame
        if self._surface is None:
            pygame.display.init()
            self._surface = pygame.display.set_mode((picture.shape[1], picture.shape[0]))
            pygame.display.set_caption("Phototaxis")
        pygame.surfarray.blit_array(self._surface, picture.transpose(1, 0, 2))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(self._fps)

    def close(self) -> None:
        if self._surface is not None:
            self._surface = None
            self._pygame.display.quit()

    def __reduce__(self) -> tuple[Any, ...]:
        """Give a copy a window of its own."""
        return Window, (self._fps,)
