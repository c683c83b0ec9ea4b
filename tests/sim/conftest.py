"""A furnished room with Amigo in it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration, Trajectory
from sim import Body, CameraModel, PlanningWorld, PyBulletWorld, RobotBody, Scene

URDF = Path(__file__).resolve().parents[2] / "ontologies" / "robots" / "amigo.urdf"

TUCKED = {"spindle_joint": 0.2} | {
    f"{joint}_joint_{side}": value
    for side in ("right", "left")
    for joint, value in (
        ("shoulder_yaw", -0.1),
        ("shoulder_pitch", -0.3),
        ("elbow_pitch", 1.9),
        ("finger1", 0.4),
        ("finger2", -0.4),
    )
}

ROOM = Scene(
    (
        Body("room", Pose((0.0, 0.0, 1.25)), (6.0, 5.0, 2.5), "room"),
        Body("bed", Pose((1.7, 0.5, 0.30)), (2.1, 0.95, 0.60), color=(0.93, 0.93, 0.95, 1.0)),
        Body("patient", Pose((1.65, 0.5, 0.86), (0.0, 0.0, 1.0, 0.0)), (1.7, 0.5, 0.54), "person"),
        Body("bedside", Pose((2.4, 1.3, 0.3)), (0.45, 0.45, 0.6), movable=True),
        Body("cabinet", Pose((-1.2, 2.25, 0.4)), (0.8, 0.4, 0.8)),
        Body("bottle", Pose((-1.1, 2.11, 0.9)), (0.06, 0.06, 0.2), "cylinder", movable=True, color=(0.1, 0.6, 0.3, 1)),
        Body("cup", Pose((2.35, 1.2, 0.65)), (0.07, 0.07, 0.1), "cylinder", movable=True),
        Body("door", Pose((-2.9, 0.0, 1.0)), (0.1, 0.9, 2.0), "marker"),
    ),
    bounds=(-3.0, -2.5, 3.0, 2.5),
    start=(-1.1, 0.6, 1.5708),
)

AMIGO = RobotBody(
    URDF,
    CameraModel("openni_rgb_optical_frame"),
    {f"hand_{side}": (f"finger1_{side}", f"finger2_{side}") for side in ("right", "left")},
    posture=TUCKED,
)

LEVEL_HAND = (
    TUCKED
    | {"spindle_joint": 0.39, "shoulder_yaw_joint_right": 0.0, "shoulder_pitch_joint_right": 0.0}
    | {"elbow_pitch_joint_right": 1.5708}
)
"""Upper arm down, fore arm level: the right grip point is 0.43 ahead of the base, 0.22 to the right, 0.90 high."""

GRASPING = Configuration((-1.32, 1.68, 1.5708), LEVEL_HAND)
"""With the bottle of the furnished room between the open fingers of the right hand."""

CLOSED = {"finger1_joint_right": -0.26, "finger2_joint_right": 0.26}


class AskableWorld(PlanningWorld, PyBulletWorld):
    """Both worlds in one, for tests that move a robot and then ask about it."""


MakeWorld = Callable[..., AskableWorld]


@pytest.fixture
def make_world() -> Iterator[MakeWorld]:
    """Makes worlds of the furnished room; keywords replace fields of the scene, ``extra`` adds bodies."""
    made: list[AskableWorld] = []

    def make(robot: RobotBody | None = AMIGO, extra: tuple[Body, ...] = (), **fields: object) -> AskableWorld:
        scene = replace(ROOM, **fields)  # type: ignore[arg-type]
        made.append(AskableWorld(replace(scene, bodies=scene.bodies + extra), robot))
        return made[-1]

    yield make
    for world in made:
        world.close()


@pytest.fixture
def world(make_world: MakeWorld) -> AskableWorld:
    """The room as it is, Amigo in front of the cabinet, arms tucked."""
    return make_world()


def straight(world: PyBulletWorld, goal: dict[str, float], rows: int = 30) -> Trajectory:
    """From where the robot is to some coordinates, in equal steps."""
    now = world.configuration()
    here = dict(zip(("x", "y", "yaw"), now.base, strict=True)) | dict(now.joints)
    share = np.linspace(0.0, 1.0, rows + 1)[:, None]
    begin = np.array([here[name] for name in goal])
    return Trajectory(tuple(goal), begin + share * (np.array(list(goal.values())) - begin))


def play(
    world: PyBulletWorld, group: str, goal: dict[str, float], rows: int = 30, *, pushes: str | None = None
) -> str | None:
    """Move in a straight line until the motion is over; what blocked it."""
    world.start(group, straight(world, goal, rows), pushes=pushes)
    while world.motion(group).state == "moving":
        world.step()
    return world.obstacle(group)


def grasp(world: PyBulletWorld) -> None:
    """Close the right hand around the bottle, from where the robot stands before it."""
    world.set_configuration(GRASPING)
    play(world, "right_gripper", CLOSED)
    world.grip("grippoint_right")
