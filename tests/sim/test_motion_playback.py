"""Facts about motions: row by row, up to the first obstacle."""

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration, Motion, Trajectory
from sim import PyBulletWorld
from tests.sim.conftest import CLOSED, GRASPING, grasp, play, straight


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
    assert world.motion("right_gripper") == Motion("blocked", "bottle")
    joints = world.configuration().joints
    assert joints["finger1_joint_right"] > -joints["finger2_joint_right"], "the bottle is nearer to the first finger"
    assert world.between_fingers("hand_right") == "bottle"
    assert world.between_fingers(("finger1_right", "finger2_right")) == "bottle"


def test_fingers_that_close_on_nothing_have_nothing_between_them(world: PyBulletWorld) -> None:
    play(world, "right_gripper", CLOSED)
    assert world.between_fingers("hand_right") is None


def test_object_beside_the_fingers_is_not_between_them(world: PyBulletWorld) -> None:
    world.set_configuration(GRASPING)
    world.set_pose("bottle", Pose((-1.0, 2.11, 0.9)))
    play(world, "right_gripper", CLOSED)
    assert world.between_fingers("hand_right") is None


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
        (("spindle_joint",), [[0.2], [np.nan]], "no number"),
        (("spindle_joint",), [[0.2], [0.6]], "limits are"),
        (("spindle_joint",), [[0.3]], "begins at spindle_joint"),
    ],
)
def test_impossible_trajectories_are_refused(
    world: PyBulletWorld, names: tuple[str, ...], rows: list[list[float]], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        world.start("any", Trajectory(names, np.array(rows)))
