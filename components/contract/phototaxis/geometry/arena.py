"""An arena: the room, its obstacles and lights, the robot's geometry and the laws of its sensors.

Lengths are metres, angles radians, times seconds; x points right, y up, headings turn left from +x.
The same structure is read from a TOML file by the simulation and travels inside the `World` message.
"""

import hashlib
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct, field

MAX_NUMBER = 10_000
"""Upper bound of every length, time and rate; it also excludes NaN and infinity."""
Coordinate = Annotated[float, Meta(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Point = tuple[Coordinate, Coordinate]
Positive = Annotated[float, Meta(gt=0, le=MAX_NUMBER)]
NotNegative = Annotated[float, Meta(ge=0, le=MAX_NUMBER)]


class Wall(Struct, forbid_unknown_fields=True, frozen=True):
    """A straight wall from `start` to `end`, with flat sides `thickness` apart (2 mm at least) and round ends."""

    start: Point
    """Centre (x, y) of one round end, in metres in the room's frame."""
    end: Point
    """Centre (x, y) of the other round end, in metres in the room's frame."""
    thickness: Positive = 0.1
    """Distance between the two flat sides, in metres, at least 0.002; the radius of the ends is half of it."""


class Polygon(Struct, forbid_unknown_fields=True, frozen=True):
    """A convex obstacle, with its corners in clockwise or anticlockwise order."""

    corners: Annotated[list[Point], Meta(min_length=3, max_length=64)]
    """The 3 to 64 corners (x, y) in their order around the obstacle, in metres in the room's frame."""


class Disc(Struct, forbid_unknown_fields=True, frozen=True):
    """A round obstacle."""

    centre: Point
    """Place (x, y) of the obstacle's centre, in metres in the room's frame."""
    radius: Positive
    """Distance from the centre to the edge, in metres, at least 0.001."""


class Light(Struct, forbid_unknown_fields=True, frozen=True):
    """A point light; at 1 m a visible light of brightness 1 reads 1."""

    position: Point
    """Place (x, y) of the light inside the room, in metres in the room's frame."""
    brightness: Annotated[float, Meta(gt=0, le=100)] = 1.0
    """Reading of a sensor 1 m away under the inverse-square law, above 0 and at most 100; readings are cut at 1."""


class Sonar(Struct, forbid_unknown_fields=True, frozen=True):
    """One sonar: where it sits on the robot and where it looks, in the robot's frame."""

    position: Point
    """Place (x, y) of the sonar, in metres in the robot's frame: x points ahead, y to the left."""
    angle: Coordinate
    """Direction in which the sonar looks, in radians, anticlockwise from straight ahead."""


def pioneer_sonars() -> list[Sonar]:
    """The 16 sonars of the Pioneer as the Pyro simulator places them (x, y in m; angle in degrees)."""
    table = (
        (0.10, 0.175, 90), (0.17, 0.15, 65), (0.20, 0.11, 40), (0.225, 0.05, 15),
        (0.225, -0.05, -15), (0.20, -0.11, -40), (0.17, -0.15, -65), (0.10, -0.175, -90),
        (-0.10, -0.175, -90), (-0.17, -0.15, -115), (-0.20, -0.11, -140), (-0.225, -0.05, -165),
        (-0.225, 0.05, 165), (-0.20, 0.11, 140), (-0.17, 0.15, 115), (-0.10, 0.175, 90),
    )  # fmt: skip
    radian = 3.141592653589793 / 180
    return [Sonar((x, y), degrees * radian) for x, y, degrees in table]


class Robot(Struct, forbid_unknown_fields=True, frozen=True):
    """A differential-drive robot with a rectangular body; its wheel commands range from −1 to 1."""

    length: Positive = 0.45
    """Size of the body from front to rear, in metres, at least 0.01."""
    width: Positive = 0.35
    """Size of the body from left to right, in metres, at least 0.01."""
    speed: Positive = 1.0
    """Forward speed with both wheels at 1, in metres per second (`speed · (left + right) / 2`)."""
    turn: Positive = 1.0
    """Rate of turn with the wheels at −1 and 1, in radians per second (`turn · (right − left) / 2`)."""
    sonars: Annotated[list[Sonar], Meta(min_length=16, max_length=16)] = field(default_factory=pioneer_sonars)
    """The 16 sonars, in the order in which the readings have their ranges."""
    sonar_range: Positive = 8.0
    """Longest distance that a sonar measures, in metres; it reads this where nothing is nearer."""
    light_sensors: tuple[Point, Point] = ((0.225, 0.175), (0.225, -0.175))
    """Places (x, y) of the front-left and the front-right light sensor, in metres in the robot's frame."""


class Sensing(Struct, forbid_unknown_fields=True, frozen=True):
    """The laws of the sensors."""

    noise: Annotated[float, Meta(ge=0, le=0.5)] = 0.05
    """Strength of the noise, from 0 to 0.5: each range and brightness is multiplied by 1 + noise · u, where u is
    uniform in −1..1."""
    light_law: Literal["inverse-square", "linear"] = "inverse-square"
    """How light fades with the distance d in metres. inverse-square: brightness · min(1/d², 1); linear:
    brightness · max(1 − d/light_range, 0)."""
    light_range: Positive = 10.0
    """Distance at which a light reads 0 under the linear law, in metres; the other law does not use it."""
    body_shadow: bool = True
    """Whether the robot's own body hides a light from a sensor."""
    near: Positive = 0.40
    """Range below which a group of sonars reports an obstacle, in metres (the paper has 0.5 robot lengths)."""


class Motion(Struct, forbid_unknown_fields=True, frozen=True):
    """How time and contact work."""

    control_period: Positive = 0.5
    """Simulated time of one tick of the bus, which is one learning step, in seconds."""
    physics_step: Positive = 0.1
    """Simulated time of one step of the physics, in seconds; the control period is a whole number of steps. A step
    in which the robot would move too far to be stopped by a thin obstacle is divided
    (`phototaxis.geometry.substeps`)."""
    collision: Literal["contact", "stall"] = "contact"
    """What an obstacle does. contact: it stops the body, which slides along it; stall: a step that would touch it is
    refused."""
    friction: Annotated[float, Meta(ge=0, le=2)] = 0.0
    """Coefficient of Coulomb friction between robot and obstacles, from 0 to 2; only "contact" uses it."""


class Placement(Struct, forbid_unknown_fields=True, frozen=True):
    """Where an episode starts: anywhere free, at least this far from every light."""

    light_distance: NotNegative = 1.5
    """Least distance from the robot's centre to every light when an episode starts, in metres."""
    clearance: NotNegative = 0.1
    """Least free space around the body when an episode starts, in metres."""


class Arena(Struct, forbid_unknown_fields=True, frozen=True):
    """A world as its TOML file describes it; ValueError if it breaks a rule of `phototaxis.geometry.rules`."""

    name: Annotated[str, Meta(min_length=1, max_length=64)]
    """Name of the arena, from 1 to 64 printable characters."""
    size: tuple[Positive, Positive]
    """Inner width and height of the room, in metres; its corner is the origin and four walls enclose it."""
    lights: Annotated[list[Light], Meta(min_length=1, max_length=64)]
    """The 1 to 64 lights, each of which the robot may seek."""
    about: str = ""
    """What the arena is for, in a sentence or two; it has no effect on the world."""
    walls: Annotated[list[Wall], Meta(max_length=100_000)] = []
    """The walls inside the room, at most 100,000; the four around it are not among them."""
    polygons: Annotated[list[Polygon], Meta(max_length=100_000)] = []
    """The convex obstacles, at most 100,000."""
    discs: Annotated[list[Disc], Meta(max_length=100_000)] = []
    """The round obstacles, at most 100,000."""
    robot: Robot = Robot()
    """The body of every robot, its speeds and the places of its sensors."""
    sensing: Sensing = Sensing()
    """The laws by which sonars and light sensors read, and their noise."""
    motion: Motion = Motion()
    """How time is divided, and what happens at an obstacle."""
    placement: Placement = Placement()
    """Where an episode may start."""

    def __post_init__(self) -> None:
        from phototaxis.geometry import rules  # imported here because messages must not need NumPy

        rules.check(self)

    def boundary(self) -> list[Polygon]:
        """The four enclosing walls, 1 m thick, outside the room: its inside is exactly `size`."""
        width, height = self.size
        boxes = (
            (-1, -1, width + 1, 0),
            (-1, height, width + 1, height + 1),
            (-1, 0, 0, height),
            (width, 0, width + 1, height),
        )
        return [Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) for x0, y0, x1, y1 in boxes]

    @property
    def digest(self) -> str:
        """A digest of the world, 16 hexadecimal digits; `name` and `about` have no influence on it."""
        world = {key: value for key, value in msgspec.structs.asdict(self).items() if key not in ("name", "about")}
        return hashlib.blake2b(msgspec.json.encode(world), digest_size=8).hexdigest()

    @property
    def physics_steps(self) -> int:
        """Physics steps in one control period."""
        return round(self.motion.control_period / self.motion.physics_step)
