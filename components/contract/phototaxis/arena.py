"""An arena: the room, its obstacles and lights, the robot's geometry and the laws of its sensors.

Lengths are metres, angles radians, times seconds; x points right, y up, headings turn left from +x.
The same structure is read from a TOML file by the simulation and travels inside the `World` message.
"""

import hashlib
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct, field

MOST = 10_000
"""No length, time or rate is larger (NaN and infinity are not either)."""
Coordinate = Annotated[float, Meta(ge=-MOST, le=MOST)]
Point = tuple[Coordinate, Coordinate]
Positive = Annotated[float, Meta(gt=0, le=MOST)]
NotNegative = Annotated[float, Meta(ge=0, le=MOST)]


class Wall(Struct, forbid_unknown_fields=True, frozen=True):
    """A straight wall from `start` to `end`, with flat sides `thickness` apart (2 mm at least) and round ends."""

    start: Point
    end: Point
    thickness: Positive = 0.1


class Polygon(Struct, forbid_unknown_fields=True, frozen=True):
    """A convex obstacle; corners in either sense of rotation."""

    corners: Annotated[list[Point], Meta(min_length=3, max_length=64)]


class Disc(Struct, forbid_unknown_fields=True, frozen=True):
    """A round obstacle."""

    centre: Point
    radius: Positive


class Light(Struct, forbid_unknown_fields=True, frozen=True):
    """A point light; at 1 m a visible light of brightness 1 reads 1."""

    position: Point
    brightness: Annotated[float, Meta(gt=0, le=100)] = 1.0


class Sonar(Struct, forbid_unknown_fields=True, frozen=True):
    """One sonar: where it sits on the robot and where it looks, in the robot's frame."""

    position: Point
    angle: Coordinate


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
    """A differential-drive robot with a rectangular body, at full scale ±1 of its wheel commands."""

    length: Positive = 0.45
    width: Positive = 0.35
    speed: Positive = 1.0
    """Forward speed with both wheels at 1, m/s (``speed · (left + right) / 2``)."""
    turn: Positive = 1.0
    """Rate of turn with the wheels at −1, 1, rad/s (``turn · (right − left) / 2``)."""
    sonars: Annotated[list[Sonar], Meta(min_length=16, max_length=16)] = field(default_factory=pioneer_sonars)
    sonar_range: Positive = 8.0
    light_sensors: tuple[Point, Point] = ((0.225, 0.175), (0.225, -0.175))
    """Positions of the front-left and the front-right light sensor in the robot's frame, m."""


class Sensing(Struct, forbid_unknown_fields=True, frozen=True):
    """The laws of the sensors."""

    noise: Annotated[float, Meta(ge=0, le=0.5)] = 0.05
    """Each light and sonar reading is multiplied by 1 + noise · u, u uniform in −1..1."""
    light_law: Literal["inverse-square", "linear"] = "inverse-square"
    """brightness · min(1/d², 1), or brightness · max(1 − d/light_range, 0); d in metres."""
    light_range: Positive = 10.0
    """Where the linear law reaches zero."""
    body_shadow: bool = True
    """Whether the robot's own body hides a light from a sensor."""
    near: Positive = 0.40
    """A sonar group below this reports an obstacle (the paper's 0.5, in robot lengths)."""


class Motion(Struct, forbid_unknown_fields=True, frozen=True):
    """How time and contact work."""

    control_period: Positive = 0.5
    """One tick of the bus and one learning step, s."""
    physics_step: Positive = 0.1
    """One step of the physics, s; the control period is a whole number of them. Where the robot would move too far in
    one to be stopped by what is thin, it is divided (`phototaxis.strides`)."""
    collision: Literal["contact", "stall"] = "contact"
    """contact: the body is stopped and slides along the wall; stall: a step that would touch is refused."""
    friction: Annotated[float, Meta(ge=0, le=2)] = 0.0
    """Coulomb friction between robot and obstacles (contact only)."""


class Placement(Struct, forbid_unknown_fields=True, frozen=True):
    """Where an episode starts: anywhere free, at least this far from every light."""

    light_distance: NotNegative = 1.5
    clearance: NotNegative = 0.1
    """Free space around the body, m."""


class Arena(Struct, forbid_unknown_fields=True, frozen=True):
    """A world as its TOML file describes it; one that breaks a rule (`phototaxis.rules`) cannot be made."""

    name: Annotated[str, Meta(min_length=1, max_length=64)]
    size: tuple[Positive, Positive]
    """Inner width and height of the room, m; its corner is the origin and four walls enclose it."""
    lights: Annotated[list[Light], Meta(min_length=1, max_length=64)]
    about: str = ""
    walls: Annotated[list[Wall], Meta(max_length=100_000)] = []
    polygons: Annotated[list[Polygon], Meta(max_length=100_000)] = []
    discs: Annotated[list[Disc], Meta(max_length=100_000)] = []
    robot: Robot = Robot()
    sensing: Sensing = Sensing()
    motion: Motion = Motion()
    placement: Placement = Placement()

    def __post_init__(self) -> None:
        from phototaxis.rules import problem  # needs NumPy, which messages do without

        if found := problem(self):
            raise ValueError(found)

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
        """What the world is, 16 hexadecimal digits: equal in arenas that differ in `name` and `about` alone."""
        world = {key: value for key, value in msgspec.structs.asdict(self).items() if key not in ("name", "about")}
        return hashlib.blake2b(msgspec.json.encode(world), digest_size=8).hexdigest()

    @property
    def physics_steps(self) -> int:
        """Physics steps in one control period."""
        return round(self.motion.control_period / self.motion.physics_step)
