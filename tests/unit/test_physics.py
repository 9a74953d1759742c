"""Physics: the paper's kinematics in the open, real contact at walls, no memory of earlier episodes."""

import math

import msgspec
import numpy as np
import pytest
from phototaxis.geometry.arena import Arena
from phototaxis_sim import arenas
from phototaxis_sim.physics import Physics, Pose
from phototaxis_sim.simulation import Simulation


@pytest.fixture
def physics(paper: Arena) -> Physics:
    return Physics(paper)


def test_half_a_metre_or_half_a_radian_a_step(physics: Physics):
    physics.place(Pose(5, 5, math.pi / 2))
    motion = physics.drive(1, 1)
    assert motion.pose == pytest.approx((5, 5.5, math.pi / 2))
    assert motion.speed == pytest.approx(1)
    motion = physics.drive(-1, 1)
    assert motion.pose.heading == pytest.approx(math.remainder(math.pi / 2 + 0.5, math.tau))
    assert motion.pose[:2] == pytest.approx((5, 5.5))
    assert physics.drive(0, 0).pose == pytest.approx(motion.pose)


def test_one_wheel_turns_towards_the_other_side(physics: Physics):
    physics.place(Pose(5, 5, 0))
    assert physics.drive(0, 1).pose.heading == pytest.approx(0.25)
    physics.place(Pose(5, 5, 0))
    assert physics.drive(1, 0).pose.heading == pytest.approx(-0.25)


@pytest.mark.parametrize(("motor", "heading", "front", "rear"), [(1, 0, True, False), (-1, math.pi, False, True)])
def test_a_wall_stops_the_robot_and_says_which_end_touched(physics: Physics, motor, heading, front, rear):
    physics.place(Pose(9.0, 5, heading))
    for _ in range(3):
        physics.drive(motor, motor)
    motion = physics.drive(motor, motor)
    assert motion.pose.x == pytest.approx(10 - 0.225, abs=0.01)
    assert (motion.front, motion.rear) == (front, rear)


def test_leaving_the_wall_is_no_collision(physics: Physics):
    physics.place(Pose(9.0, 5, 0))
    for _ in range(3):
        physics.drive(1, 1)
    motion = physics.drive(-1, -1)
    assert (motion.front, motion.rear) == (False, False)
    assert motion.pose.x < 9.4


def test_along_a_wall_it_slides(physics: Physics):
    physics.place(Pose(9.6, 3, 1.2))
    motions = [physics.drive(1, 1) for _ in range(6)]
    assert motions[-1].front
    assert motions[-1].pose.y > 4.5


def test_stall_refuses_the_whole_move(paper: Arena):
    arena = msgspec.structs.replace(paper, motion=msgspec.structs.replace(paper.motion, collision="stall"))
    physics = Physics(arena)
    physics.place(Pose(9.0, 5, 0.0))
    first, second = physics.drive(1, 1), physics.drive(1, 1)
    assert second.front
    assert second.speed == 0
    assert 9.4 < second.pose.x < 9.775
    assert physics.drive(1, 1).pose == pytest.approx(second.pose)
    assert first.pose.x <= second.pose.x


def test_an_episode_does_not_depend_on_those_before_it(physics: Physics, paper: Arena):
    rng = np.random.default_rng(3)
    episodes = [(physics.random_pose(rng), rng.choice([-1, 1, 1], (60, 2)).tolist()) for _ in range(20)]

    def drive(world: Physics, start: Pose, commands: list[list[int]]):
        world.place(start)
        return [world.drive(*command) for command in commands]

    together = [drive(physics, *episode) for episode in episodes]
    assert any(motion.front for episode in together for motion in episode)
    for episode, found in zip(reversed(episodes), reversed(together), strict=True):
        assert drive(Physics(paper), *episode) == found


def test_the_robot_never_leaves_the_room():
    for name in arenas.shipped():
        arena = arenas.load(name)
        simulation = Simulation(arena, 1, "r")
        rng = np.random.default_rng(1)
        for left, right in rng.choice([-1.0, 1.0, 1.0], (1500, 2)):
            state = simulation.advance(left, right, "a")
            assert 0.1 < state.x < arena.size[0] - 0.1
            assert 0.1 < state.y < arena.size[1] - 0.1


def test_the_hash_tells_trajectories_apart(paper: Arena):
    def final(seed: int, commands: list[tuple[float, float]]) -> str:
        simulation = Simulation(paper, seed, "any")
        for command in commands:
            simulation.advance(*command, author="x")
        return simulation.state.hash

    forward = [(1.0, 1.0)] * 5
    assert final(1, forward) == final(1, forward)
    assert final(1, forward) != final(2, forward)
    assert final(1, forward) != final(1, [*forward[:4], (1.0, 0.0)])


def test_a_snapshot_continues_bit_for_bit(paper: Arena):
    simulation, commands = Simulation(paper, 4, "r"), [(1.0, 0.0), (1.0, 1.0), (-1.0, 1.0)] * 20
    for command in commands:
        simulation.advance(*command, author="x")
    simulation.advance(0, 0, "x", "truncated")
    snapshot = simulation.snapshot([], "")
    expected = [simulation.advance(*command, author="x").hash for command in commands]
    fresh = Simulation(paper, 4, "r")
    fresh.restore(snapshot)
    assert [fresh.advance(*command, author="x").hash for command in commands] == expected
