"""The colours of the live view, and the scales that map numbers to colours."""

import numpy as np

INK, STONE = (60, 60, 60), (120, 120, 120)
BLUE, ORANGE, YELLOW, RED, GREEN = (20, 90, 170), (240, 150, 0), (240, 180, 0), (200, 70, 40), (50, 150, 80)


def packed(rgba: np.ndarray) -> np.ndarray:
    """Convert RGBA colours, shape (n, 4), 0..255, to Rerun's 0xRRGGBBAA, shape (n,)."""
    r, g, b, a = np.clip(np.round(rgba), 0, 255).astype(np.uint32).T
    return (r << 24) | (g << 16) | (b << 8) | a


def scale(values: np.ndarray, *stops: tuple[float, tuple[float, ...]]) -> np.ndarray:
    """Interpolate RGBA colours between the stops (value, RGBA), which ascend; shape (n,) becomes (n, 4)."""
    at, colors = zip(*stops, strict=True)
    return np.stack([np.interp(values, at, channel) for channel in zip(*colors, strict=True)], axis=-1)


def of_distance(metres: np.ndarray) -> np.ndarray:
    """Colour the sonar rays: red where something is close, pale blue where it is far."""
    near, middle, far = (210, 50, 40, 255), (235, 150, 40, 255), (150, 185, 220, 255)
    return packed(scale(metres, (0.3, near), (1.2, middle), (3.5, far)))


def of_reward(rewards: np.ndarray) -> np.ndarray:
    """Colour the trail: red for negative rewards, grey for 0 and for NaN (nothing was learned), green for positive."""
    bad, none, good = (*RED, 255), (165, 165, 165, 255), (*GREEN, 255)
    return packed(scale(np.nan_to_num(rewards), (-0.5, bad), (0.0, none), (0.1, good)))


def of_light(intensity: np.ndarray) -> np.ndarray:
    """Colour the light field from grey-white to warm yellow; returns shape (rows, columns, 3), 0..255."""
    dark, dim, bright = (226, 228, 233), (250, 243, 214), (255, 214, 84)
    return scale(intensity, (0.0, dark), (0.12, dim), (0.8, bright)).astype(np.uint8)
