"""An answer of ``planlang locate --json`` says enough to be checked with a URDF and PyBullet alone."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang.files import bundled
from planlang.geometry import Array

URDF = bundled("ontologies") / "robots" / "amigo.urdf"


def turned(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) about a unit axis, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)


def rotation(quaternion: list[float]) -> Array:
    """The rotation (3, 3) of a unit quaternion (x, y, z, w)."""
    length = math.hypot(*quaternion[:3])
    return turned(np.array(quaternion[:3]) / max(length, 1e-12), 2 * math.atan2(length, quaternion[3]))


def rigid(turn: Array, move: Array) -> Array:
    """A matrix (4, 4)."""
    return np.block([[turn, np.reshape(move, (3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])


def forward(urdf: Path, joints: dict[str, float], link: str) -> Array:
    """The pose (4, 4) of a link in the frame of the robot's root: plain forward kinematics from the URDF."""
    above = {
        child.get("link"): joint for joint in ElementTree.parse(urdf).iter("joint") for child in joint.iter("child")
    }
    pose, at = np.eye(4), link
    while at in above:
        joint = above[at]
        numbers = {
            (tag.tag, key): np.array(value.split(), float)
            for tag in joint
            for key, value in tag.items()
            if (tag.tag, key) in (("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz"))
        }
        roll, pitch, yaw = numbers.get(("origin", "rpy"), np.zeros(3))
        fixed = turned(np.eye(3)[2], yaw) @ turned(np.eye(3)[1], pitch) @ turned(np.eye(3)[0], roll)
        axis, value = numbers.get(("axis", "xyz"), np.eye(3)[0]), joints.get(joint.get("name", ""), 0.0)
        slides = joint.get("type") == "prismatic"
        moved = rigid(np.eye(3), value * axis) if slides else rigid(turned(axis, value), np.zeros(3))
        pose = rigid(fixed, numbers.get(("origin", "xyz"), np.zeros(3))) @ moved @ pose
        at = next(parent.get("link", "") for parent in joint.iter("parent"))
    return pose


@pytest.mark.parametrize("phrase", ["in reach of the bottle", "in reach of the patient with the left arm"])
def test_an_answer_can_be_checked_with_the_urdf_and_pybullet_alone(phrase: str) -> None:
    where = ("--robot", "amigo", "--environment", "hospital_room", "--count", "2", "--json")
    answer = json.loads(CliRunner().invoke(app, ["locate", phrase, *where]).stdout)
    client = pybullet.connect(pybullet.DIRECT)
    robot = pybullet.loadURDF(str(URDF), useFixedBase=True, physicsClientId=client)
    joint_count = pybullet.getNumJoints(robot, physicsClientId=client)
    infos = [pybullet.getJointInfo(robot, k, physicsClientId=client) for k in range(joint_count)]
    number, index = {info[1].decode(): info[0] for info in infos}, {info[12].decode(): info[0] for info in infos}
    assert len(answer["solutions"]) == 2
    for place in answer["solutions"]:
        assert place["score"] > 0.0
        base = rigid(turned(np.eye(3)[2], place["yaw"]), np.array([place["x"], place["y"], 0.0]))
        heading = [0.0, 0.0, math.sin(place["yaw"] / 2), math.cos(place["yaw"] / 2)]
        pybullet.resetBasePositionAndOrientation(robot, base[:3, 3].tolist(), heading, physicsClientId=client)
        (hand,) = place["hands"]
        assert hand["torso"] == hand["postures"][0]["joints"]["spindle_joint"]
        for posture in hand["postures"]:
            joints = {**answer["posture"], **(hand["fingers"] or {}), **posture["joints"]}
            stated = rigid(rotation(posture["orientation"]), np.array(posture["position"]))
            assert base @ forward(URDF, joints, hand["link"]) == pytest.approx(stated, abs=1e-3)
            for name, value in joints.items():
                pybullet.resetJointState(robot, number[name], value, physicsClientId=client)
            there = pybullet.getLinkState(
                robot, index[hand["link"]], computeForwardKinematics=True, physicsClientId=client
            )
            assert there[4] == pytest.approx(posture["position"], abs=1e-3)
    pybullet.disconnect(client)
