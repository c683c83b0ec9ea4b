"""Tracks of poses: what moves is noted once, in the frame of what it hangs on."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from executive.pictures.pose_track import RATE, Placed, PoseTrack, Tracks
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body, CameraModel, PyBulletWorld, RobotBody, Scene

ROOM = Scene(
    (
        Body("bottle1", Pose((0.0, 3.0, 1.0)), (0.07, 0.07, 0.25), "cylinder", movable=True),
        Body("bed1", Pose((2.0, 0.0, 0.3)), (2.0, 1.0, 0.6)),
        Body("patient1", Pose((2.0, 0.0, 0.75)), (1.8, 0.6, 0.3), "person"),
    )
)


AMIGO = bundled("ontologies") / "robots" / "amigo.urdf"
LINK = """<link name="{}"><inertial><origin xyz="0.1 0 0" rpy="0.3 0.2 1"/><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>"""
JOINT = """<joint name="{1}_joint" type="{2}"><parent link="{0}"/><child link="{1}"/><axis xyz="{3}"/>
<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><limit lower="-1" upper="1" effort="1" velocity="1"/>{4}</joint>"""
GRIPPER = (
    '<robot name="gripper">'
    + "".join(map(LINK.format, ("base", "lift", "left", "right", "tip")))
    + JOINT.format("base", "lift", "prismatic", "0 0.6 0.8", "")
    + JOINT.format("lift", "left", "revolute", "1 0 0", "")
    + JOINT.format("lift", "right", "revolute", "0 0 1", '<mimic joint="left_joint" multiplier="-2" offset="0.1"/>')
    + JOINT.format("right", "tip", "fixed", "1 0 0", "")
    + "</robot>"
)


def world_with(urdf: Path) -> PyBulletWorld:
    root = ElementTree.fromstring(urdf.read_text()).find("link")
    assert root is not None
    return PyBulletWorld(ROOM, RobotBody(urdf, CameraModel(root.get("name", ""))))


@pytest.mark.parametrize("robot", ["amigo", "gripper"])
def test_tracked_links_are_where_the_simulator_has_them(robot: str, tmp_path: Path) -> None:
    (tmp_path / "gripper.urdf").write_text(GRIPPER)
    world, tracks = world_with(AMIGO if robot == "amigo" else tmp_path / "gripper.urdf"), Tracks()
    track = PoseTrack([tracks])
    track(world)
    joints = {name: min(max(0.3, low), high) for name, (low, high) in world.robot.limits.items()}
    world.set_configuration(Configuration((0.5, -1.0, 0.7), joints))
    track.note(world)  # the step of before: nothing is noted twice
    world.steps += 1
    track.note(world)

    def in_map(path: tuple[str, ...]) -> Pose:
        pose = tracks[path].poses[-1]
        assert pose is not None
        return in_map(tracks[path].frame) @ pose if tracks[path].frame else pose

    links = [path for path in tracks if path[0] == "robot"]
    assert {path[1] for path in links} == set(world.robot.links)
    for path in links:
        assert in_map(path).matrix() == pytest.approx(world.link_pose(path[1]).matrix(), abs=1e-6), path
    world.close()


def test_only_what_has_moved_is_noted() -> None:
    world = world_with(AMIGO)
    heard: list[tuple[int, list[Placed]]] = []
    track = PoseTrack([lambda step, found: heard.append((step, list(found)))])
    track(world)
    joint, (low, high) = next(iter(world.robot.limits.items()))
    for step in range(1, world.rate + 1):
        world.steps = step
        if world.steps == 4:
            world.set_configuration(Configuration((0.0, 0.0, 0.0), {joint: (low + high) / 3}))
            world.set_pose("bottle1", Pose((0.1, 3.0, 1.0)))
        if world.steps == 8:
            world.set_configuration(Configuration((0.0, 0.0, 1.0), {}))
        if world.steps == 14:
            world.remove("bottle1")
        track(world)
    world.close()
    between = world.rate // RATE
    moved = {step: [placed.path for placed in found] for step, found in heard[1:]}
    assert moved[2 * between][0] == ("bodies", "bottle1")
    assert [path[0] for path in moved[2 * between]] == ["bodies", "robot"]
    assert moved[3 * between] == [("robot", "base_link")]
    assert moved[5 * between] == [("bodies", "bottle1")]
    assert heard[-1][1] == [Placed(("bodies", "bottle1"), (), None)]
    assert list(moved) == [2 * between, 3 * between, 5 * between]


def test_limbs_are_noted_in_the_frame_of_their_person() -> None:
    world, tracks = world_with(AMIGO), Tracks()
    PoseTrack([tracks])(world)
    limbs = [path for path in tracks if path[:2] == ("bodies", "patient1") and len(path) == 3]
    parts = world.pieces("patient1")
    world.close()
    assert len(limbs) == 6
    for path in limbs:
        assert tracks[path].frame == ("bodies", "patient1")
        assert tracks[path].poses == [parts[int(path[2].removeprefix("limb"))][1]]
        steps, rows = tracks[path].arrays()
        assert (steps.tolist(), rows.shape) == ([0], (1, 7))
