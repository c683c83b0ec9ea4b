"""Questions to a world that an interrupt cuts short at any moment leave it as it was."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import pytest

from planlang.files import bundled
from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body, CameraModel, PlanningWorld, RobotBody, Scene
from tests.support.locations.queries import Interrupter, physics

ROOM = Scene(
    (
        Body("table", Pose((1.5, 0.0, 0.35)), (0.8, 0.8, 0.7)),
        Body("cup", Pose((1.3, 0.0, 0.75)), (0.08, 0.08, 0.1), "cylinder", movable=True),
    )
)
ELSEWHERE = Configuration((0.5, 0.2, 0.4), {"spindle_joint": 0.3, "elbow_pitch_joint_left": 1.2})
QUESTIONS: dict[str, Callable[[PlanningWorld], object]] = {
    "support": lambda world: world.support("cup"),
    "contacts": lambda world: world.contacts(ELSEWHERE),
    "link pose": lambda world: world.link_pose("grippoint_left", ELSEWHERE),
    "silhouette": lambda world: world.silhouette(),
    "outlines": lambda world: world.outlines(),
    "sight": lambda world: world.sight("cup", ELSEWHERE),
}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # generators that it hits
@pytest.mark.parametrize("question", QUESTIONS)
def test_an_interrupted_question_leaves_the_world_and_its_physics_as_they_were(question: str) -> None:
    urdf = bundled("ontologies") / "robots" / "amigo.urdf"
    world = PlanningWorld(ROOM, RobotBody(urdf, CameraModel("openni_rgb_optical_frame")))
    try:
        before = world.state(), physics(world.robot.client)
        whole = False
        for calls in (*range(1, 80), *range(80, 4000, 17)):
            with contextlib.suppress(KeyboardInterrupt), Interrupter(calls):
                QUESTIONS[question](world)
                whole = True
            if whole:
                break
            assert (world.state(), physics(world.robot.client)) == before, f"interrupted at call {calls}"
        assert whole
    finally:
        world.close()
