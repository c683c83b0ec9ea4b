"""Facts about motions: row by row, up to the first obstacle."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration, Motion, Trajectory
from sim import Body, PyBulletWorld
from tests.sim.conftest import CLOSED, GRASPING, MakeWorld, grasp, play, straight

FINGERS = ("finger1_right", "finger2_right")


def test_one_row_is_played_per_step(world: PyBulletWorld) -> None:
    x, y, yaw = world.configuration().base
    world.start("base", straight(world, {"x": x + 0.3}, rows=10))
    for k in range(1, 11):
        assert world.motion("base") == Motion("moving")
        world.step()
        assert world.configuration().base == pytest.approx((x + 0.03 * k, y, yaw))
    assert world.motion("base") == Motion("done")


def test_groups_move_at_the_same_time(world: PyBulletWorld) -> None:
    world.start("base", straight(world, {"x": -0.9}, rows=5))
    world.start("torso", straight(world, {"spindle_joint": 0.3}, rows=8))
    for _ in range(5):
        world.step()
    assert (world.motion("base").state, world.motion("torso").state) == ("done", "moving")


def test_motion_ends_at_the_last_free_row_and_names_what_blocks(world: PyBulletWorld) -> None:
    play(world, "arms", {f"elbow_pitch_joint_{side}": 0.0 for side in ("right", "left")})
    play(world, "arms", {f"shoulder_pitch_joint_{side}": 0.0 for side in ("right", "left")})
    assert play(world, "base", {"y": 2.0}, rows=100) == "cabinet"
    assert world.motion("base").state == "blocked"
    assert world.contacts() == ()
    assert 2.05 - 0.333 - world.configuration().base[1] < 2 * (2.0 - 0.6) / 100


def test_halted_motion_stays_where_it_is(world: PyBulletWorld) -> None:
    world.start("base", straight(world, {"x": 0.0}, rows=10))
    world.step()
    world.halt("base")
    place = world.configuration().base
    world.step()
    assert world.motion("base") == Motion("halted")
    assert world.configuration().base == place


def test_newer_motion_of_a_joint_halts_the_older_group(world: PyBulletWorld) -> None:
    world.start("torso", straight(world, {"spindle_joint": 0.3}))
    world.start("right_arm", straight(world, {"spindle_joint": 0.1, "elbow_pitch_joint_right": 1.0}))
    assert world.motion("torso") == Motion("halted")


def test_robot_leaves_a_contact_that_was_there_before(world: PyBulletWorld) -> None:
    world.set_configuration(Configuration((-1.2, 1.73, 1.5708), {}))
    assert world.contacts() != ()
    assert play(world, "base", {"y": 1.4}) is None
    world.set_configuration(Configuration((-1.2, 1.73, 1.5708), {}))
    assert play(world, "base", {"y": 1.8}) == "cabinet"


def test_fingers_close_until_each_touches(world: PyBulletWorld) -> None:
    world.set_configuration(GRASPING)
    world.set_pose("bottle", Pose((-1.106, 2.11, 0.9)))
    assert play(world, "right_gripper", CLOSED) == "bottle"
    motion = world.motion("right_gripper")
    assert (motion.state, world.obstacle("right_gripper")) == ("blocked", "bottle")
    assert motion.touch is not None
    assert motion.touch.link in FINGERS
    joints = world.configuration().joints
    assert joints["finger1_joint_right"] > -joints["finger2_joint_right"], "the bottle is nearer to the first finger"
    one, other = world.touches(FINGERS)
    assert {one.link, other.link} == set(FINGERS)
    assert np.dot(one.normal, other.normal) < -0.9, "they feel it from both sides"
    for touch in (one, other):
        assert math.dist(touch.point[:2], (-1.106, 2.11)) == pytest.approx(0.03, abs=0.002), "on its surface"


def test_a_finger_feels_the_rim_of_a_dish_though_it_is_nearer_to_the_floor(make_world: MakeWorld) -> None:
    dish = Body("dish", Pose((-1.0, 2.11, 0.9)), (0.2, 0.2, 0.03), "cylinder", movable=True, wall=0.01)
    world = make_world(bodies=(dish,))
    world.set_configuration(GRASPING)
    finger = FINGERS[0]
    points = world.robot.points([world.robot.number[finger]])[0]
    x, low = float(np.median(points[:, 0])), float(points[:, 2].min())
    world.set_pose("dish", Pose((x, float(points[:, 1].max()) + 0.005 - 0.09, low - 0.003 + 0.005)))
    ups = sorted(round(touch.normal[2], 1) for touch in world.touches([finger]))
    assert ups[-1] == 1.0, "the floor"
    assert ups[0] == 0.0, "the rim"


def test_fingers_that_close_on_nothing_feel_nothing(world: PyBulletWorld) -> None:
    play(world, "right_gripper", CLOSED)
    assert world.touches(FINGERS) == ()


def test_object_beside_the_fingers_is_not_between_them(world: PyBulletWorld) -> None:
    world.set_configuration(GRASPING)
    world.set_pose("bottle", Pose((-1.0, 2.11, 0.9)))
    play(world, "right_gripper", CLOSED)
    assert len({touch.link for touch in world.touches(FINGERS)}) < 2


def test_held_object_follows_its_link(world: PyBulletWorld) -> None:
    grasp(world)
    before = world.link_pose("grippoint_right").inverse() @ world.pose("bottle")
    assert play(world, "base", {"y": 1.0, "x": -1.0}) is None
    after = world.link_pose("grippoint_right").inverse() @ world.pose("bottle")
    assert after.position == pytest.approx(before.position, abs=1e-5)
    assert world.attached() == {"bottle": "grippoint_right"}


def test_held_object_blocks_the_arm(world: PyBulletWorld) -> None:
    grasp(world)
    play(world, "torso", {"spindle_joint": 0.4})
    assert play(world, "torso", {"spindle_joint": 0.3}) == "cabinet"
    assert world.pose("bottle").position[2] == pytest.approx(0.9, abs=5e-3)


@pytest.mark.parametrize(
    ("names", "rows", "message"),
    [
        (("knee",), [[0.0]], "no joint 'knee'"),
        (("x", "y"), [[0.0]], r"needs \(n, 2\) rows"),
        (("spindle_joint",), [[0.2], [np.nan]], "not finite"),
        (("spindle_joint",), [[0.2], [0.6]], "limits are"),
        (("spindle_joint",), [[0.3]], "begins at spindle_joint"),
    ],
)
def test_impossible_trajectories_are_refused(
    world: PyBulletWorld, names: tuple[str, ...], rows: list[list[float]], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        world.start("any", Trajectory(names, np.array(rows)))


CHECKOUT = Path(__file__).resolve().parents[2]
PROGRAM = """
import sys
from functools import partial
import pybullet
from planlang import *
from planlang.kernel import record

class Balls:
    rate = 240

    def __init__(self):
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0, 0, -9.81)
        ground = pybullet.createCollisionShape(pybullet.GEOM_PLANE)
        pybullet.createMultiBody(0, ground)
        ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.05)
        self.balls = [
            pybullet.createMultiBody(1, ball, basePosition=(0.09 * (n % 5), 0.08 * (n // 5 % 2), 0.2 + n // 10 / 9))
            for n in range(20)
        ]

    def step(self):
        pybullet.stepSimulation()

    def height(self, number):
        return pybullet.getBasePositionAndOrientation(self.balls[number])[0][2]

world = Balls()

async def step(number):
    ball = number % len(world.balls)
    low = Fluent(name=f"ball {ball} is low", read=lambda: world.height(ball) < 0.12 + 0.1 * rng_of[number])
    await wait_for(low)
    await sleep(rng().random() * 0.3)
    pybullet.applyExternalForce(world.balls[ball], -1, (0, 0, 400 + number), (0, 0, 0), pybullet.WORLD_FRAME)
    return {"kicked", f"ball {ball}", world.height(ball)}

rng_of = {}

async def bounded(number):
    rng_of[number] = rng().random()
    try:
        return await timeout(0.5, partial(step, number))
    except PlanFailure as failure:
        record("missed", failure=failure)

async def plan():
    steps = {f"step{n}": partial(bounded, n) for n in range(100)}
    await partial_order(steps, [(f"step{n // 2}", f"step{n}") for n in range(1, 100)])

trace = Trace()
run(plan, host=SimulationHost(world), seed=3, trace=trace)
sys.stdout.write(trace.text())
"""


def test_a_plan_with_physics_in_the_loop_has_one_trace_in_three_processes() -> None:
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            env={**os.environ, "PYTHONPATH": str(CHECKOUT), "PYTHONHASHSEED": hash_seed},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        for hash_seed in ("0", "42", "random")
    ]
    ended = [process.communicate(timeout=120) for process in processes]
    assert [process.returncode for process in processes] == [0] * 3, ended[0][1].decode()
    traces = [output[output.index(b'{"step"') :] for output, _ in ended]  # PyBullet greets on the same channel
    assert len(set(traces)) == 1
    assert traces[0].count(b'"missed"') not in (0, 100), "some steps are in time, some are not"
