"""Nothing passes a wall, whatever the arena says: speeds, steps, thin walls, wedges, one robot or many."""

import math
from typing import Any

import msgspec
import numpy as np
import pytest
from phototaxis.geometry.arena import Arena, Disc, Light, Motion, Placement, Robot, Wall
from phototaxis.geometry.substeps import substeps
from phototaxis_sim import arenas
from phototaxis_sim.batch_physics import BatchPhysics
from phototaxis_sim.physics import Physics, Pose

Outline = list[tuple[float, float]]
COUNT = 12
HURRIED = {"speed": 20.0, "turn": 8.0}


def inside(outline: Outline, x: float, y: float) -> bool:
    """Whether a point lies in a polygon, by the crossings of a ray: not the engine's own geometry."""
    found = False
    for (ax, ay), (bx, by) in zip(outline, outline[1:] + outline[:1], strict=True):
        if (ay > y) != (by > y) and x < (bx - ax) * (y - ay) / (by - ay) + ax:
            found = not found
    return found


def walled(collision: Any, thickness: float = 0.1, step: float = 0.5, period: float = 0.5, **robot: Any) -> Arena:
    """Two halves of a room with a closed wall between them."""
    return Arena(
        "t", (10.0, 10.0), [Light((9.0, 5.0))], walls=[Wall((5.0, 0.0), (5.0, 10.0), thickness)],
        robot=Robot(**robot), motion=Motion(period, step, collision),
    )  # fmt: skip


def labyrinth(seed: int, collision: Any) -> tuple[Arena, Outline]:
    """A closed cell of any shape, with wedges, stubs and pebbles about, and a robot of any size and haste."""
    rng = np.random.default_rng(seed)
    thick = float(10 ** rng.uniform(-2, -0.5))
    angles = np.arange(5) * 0.4 * math.pi + rng.uniform(0, 1.2, 5)
    reach = rng.uniform(1.5, 4, 5)
    outline = [(5 + r * math.cos(a), 5 + r * math.sin(a)) for r, a in zip(reach, angles, strict=True)]
    walls = [Wall(a, b, thick) for a, b in zip(outline, outline[1:] + outline[:1], strict=True)]
    for _ in range(3):  # wedges
        (x, y), (dx, dy), (ex, ey) = rng.uniform(3, 7, 2).tolist(), *rng.normal(size=(2, 2)).tolist()
        walls += [Wall((x, y), (x + dx + aside * ex, y + dy + aside * ey), thick) for aside in (0, 0.2)]
    discs = [Disc((x, y), 0.01) for x, y in rng.uniform(2, 8, (3, 2)).tolist()]
    haste, whirl = (10 ** rng.uniform(-0.5, 1.3, 2)).tolist()
    length, width = rng.uniform(0.15, 0.6, 2).tolist()
    period = float(rng.choice([0.1, 0.5, 1.0]))
    motion = Motion(period, period / int(rng.choice([1, 2, 5])), collision, float(rng.choice([0, 0.5, 2])))
    robot = Robot(length=length, width=width, speed=haste, turn=whirl)
    arena = Arena(
        "t", (10.0, 10.0), [Light((5.0, 5.0))], walls=walls, discs=discs, robot=robot, motion=motion,
        placement=Placement(0.0, float(rng.choice([0.0, 0.1]))),
    )  # fmt: skip
    return arena, outline


@pytest.mark.parametrize(("collision", "count"), [("contact", COUNT), ("stall", 2)])
@pytest.mark.parametrize("seed", range(10))
def test_nobody_leaves_a_closed_cell(collision, count, seed):
    arena, outline = labyrinth(seed, collision)
    rng, physics = np.random.default_rng(seed), Physics(arena)
    starts = [physics.random_pose(rng) for _ in range(count)]
    physics.place(starts[0])
    batch, within = BatchPhysics(arena, starts), [inside(outline, *start[:2]) for start in starts]
    motors = np.ones((2, count))
    for _ in range(20):
        motors = np.where(rng.random(count) < 0.4, rng.choice([-1.0, 0.3, 1.0, 1.0], (2, count)), motors)
        batch.drive(*motors)
        alone = physics.drive(*motors[:, 0].tolist()).pose
        assert inside(outline, alone.x, alone.y) == within[0]
        assert [inside(outline, x, y) for x, y, _ in batch.poses.tolist()] == within
        assert (batch.poses[:, :2] > 0).all()
        assert (batch.poses[:, :2] < 10).all()


@pytest.mark.parametrize("collision", ["contact", "stall"])
@pytest.mark.parametrize(
    "case",
    [
        {}, {"thickness": 0.05}, {"speed": 2.0}, {"speed": 10.0, "step": 0.1}, {"thickness": 0.002}, HURRIED,
        {"step": 1.0, "period": 1.0}, {"turn": 30.0, "length": 0.6, "width": 0.05}, {"length": 0.02, "width": 0.02},
    ],
)  # fmt: skip
def test_a_wall_between_two_halves_is_closed(collision, case):
    physics, rng = Physics(walled(collision, **case)), np.random.default_rng(1)
    met = 0
    for start in (Pose(4.0, 5.0, 0.0), Pose(4.0, 8.0, 1.0), Pose(4.6, 9.0, -0.5)):
        physics.place(start)
        for motors in [(1.0, 1.0)] * 4 + rng.choice([-1.0, 1.0, 1.0], (8, 2)).tolist():
            motion = physics.drive(*motors)
            met += motion.front or motion.rear
            assert 0 < motion.pose.x < 5
            assert 0 < motion.pose.y < 10
    assert met


def test_hurried_robots_together_move_as_each_would_alone():
    arena, rng = walled("contact", thickness=0.03, step=0.25, speed=3.0, turn=4.0), np.random.default_rng(2)
    physics = Physics(arena)
    batch = BatchPhysics(arena, [physics.random_pose(rng) for _ in range(COUNT)])
    alone = [Physics(arena) for _ in range(COUNT)]
    for one, pose in zip(alone, batch.poses.tolist(), strict=True):
        one.place(Pose(*pose))
    for _ in range(8):
        motors = rng.choice([-1.0, 1.0, 1.0], (2, COUNT))
        batch.drive(*motors)
        motions = [one.drive(*command) for one, command in zip(alone, motors.T.tolist(), strict=True)]
        difference = batch.poses - [motion.pose for motion in motions]
        difference[:, 2] = np.remainder(difference[:, 2] + math.pi, math.tau) - math.pi
        assert np.abs(difference).max() < 1e-9
        assert batch.front.tolist() == [motion.front for motion in motions]
        assert batch.rear.tolist() == [motion.rear for motion in motions]


def test_a_stride_that_a_contact_takes_astray_is_undone(paper: Arena):
    against = Pose(9.775, 5.0, 0.3)
    physics, batch = Physics(paper), BatchPhysics(paper, [against, Pose(5.0, 5.0, 0.0)])
    physics.place(against)
    physics.drive(1.0, 1.0)
    batch.drive(np.ones(2), np.ones(2))
    physics._max_move = batch._max_move = 0.0  # nobody in contact may be moved at all
    before = physics.drive(0.0, 0.0).pose, batch.poses.copy()
    motion = physics.drive(1.0, 1.0)
    batch.drive(np.ones(2), np.array([1.0, -1.0]))
    assert motion.pose == before[0]
    assert motion.front
    assert batch.poses[0].tolist() == before[1][0].tolist()
    assert batch.poses[1, 2] == pytest.approx(before[1][1, 2] - 0.5)


def test_no_light_sensor_comes_out_behind_a_thin_wall():
    physics = Physics(walled("contact", thickness=0.02, step=0.1))
    for heading in np.linspace(-1, 1, 9).tolist():
        physics.place(Pose(4.3, 5.0, heading))
        for _ in range(6):
            x, _, angle = physics.drive(1.0, 1.0).pose
            for ahead, aside in Robot().light_sensors:
                assert x + math.cos(angle) * ahead - math.sin(angle) * aside < 5.01


@pytest.mark.parametrize("name", arenas.shipped())
def test_shipped_arenas_are_driven_as_ever(name):
    assert substeps(arenas.load(name)) == 1


@pytest.mark.parametrize(
    ("table", "changes", "key"),
    [
        ("robot", {"speed": 10_000.0}, "robot.speed"),
        ("robot", {"turn": 100_000.0}, "robot.turn"),
        ("motion", {"physics_step": 0.5 / 10_001}, "motion.physics_step"),
    ],
)
def test_what_would_take_too_many_strides_is_refused(paper, table, changes, key):
    changed = msgspec.structs.replace(getattr(paper, table), **changes)
    with pytest.raises(ValueError, match=rf"^{key}: "):
        msgspec.structs.replace(paper, **{table: changed})
