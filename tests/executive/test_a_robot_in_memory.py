"""A robot without a simulator: what a real one has to offer so that the bundled modules serve a drink."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.maps import read_map, scene_of
from executive.modules.bundled import bundled_registry
from executive.motion import Chain
from executive.robots import Robot, bind_robot
from executive.robots.arms import with_carrying
from executive.runs.assembly import RobotExecutive, platform_of, world_at_start
from planlang import SimulationHost, run
from planlang.failures import ManipulationFailure, NavigationFailure, PlanFailure
from planlang.files import bundled
from planlang.geometry import Array, Pose
from planlang.ontology import load
from planlang.protocols import Configuration, Detection, Motion, MotionState, Touch, Trajectory
from planlang.testing import compiled
from tests.support.examples import some

NEAR = 0.08
"""Distance from the tip within which fingers that close meet the bottle [m]."""
PULLS = 1.0
"""Distance from the patient within which the patient pulls at what is offered [m]."""
SIZES = {"Patient": (1.5, 0.5, 0.75), "DrinkingBottle": (0.065, 0.065, 0.2)}
"""Class -> extents of the thing of the map [m]."""
LEAST = 0.35
"""Position of a finger at which it meets the bottle [rad]."""


class MemoryRobot:
    """Plays trajectories back; what it sees and feels follows from two poses that the test gives."""

    rate = 30

    def __init__(self, robot: Robot, at_start: Configuration, bottle: Pose, patient: Pose) -> None:
        self.robot, self.bottle, self.patient = robot, bottle, patient
        self.base, self.positions = at_start.base, dict(at_start.joints)
        self.chains: dict[str, Chain] = {}
        self.under_way: dict[str, tuple[Trajectory, int, Motion]] = {}
        self.holding: str | None = None
        self.given = False

    def step(self) -> None:
        """Go on to the next row of each trajectory; a finger that meets the bottle stays there."""
        for group, (trajectory, row, motion) in list(self.under_way.items()):
            if motion.state is not MotionState.MOVING:
                continue
            self._show(dict(zip(trajectory.names, trajectory.positions[row].tolist(), strict=True)))
            met = self._met(trajectory)
            state = MotionState.BLOCKED if met else MotionState.DONE
            over = met is not None or row + 1 == len(trajectory.positions)
            self.under_way[group] = (trajectory, row + 1, Motion(state, touch=met) if over else motion)

    def _show(self, values: Mapping[str, float]) -> None:
        self.positions |= {name: value for name, value in values.items() if name not in ("x", "y", "yaw")}
        x, y, yaw = self.base
        self.base = (values.get("x", x), values.get("y", y), values.get("yaw", yaw))

    def _met(self, trajectory: Trajectory) -> Touch | None:
        for arm in self.robot.arms:
            gripper = arm.gripper
            closes = gripper is not None and set(trajectory.names) == set(gripper.joints)
            if closes and trajectory.positions[-1][0] < trajectory.positions[0][0]:
                return next(iter(self.touches(gripper.finger_links)), None)
        return None

    def configuration(self) -> Configuration:
        """Where it is."""
        return Configuration(self.base, dict(self.positions))

    def link_pose(self, link: str) -> Pose:
        """Where a link is, by the angles of its joints."""
        chain = self.chains.setdefault(link, Chain.from_urdf(self.robot.urdf, self.robot.base_link, link))
        q = np.array([[self.positions[name] for name in chain.names]])
        return Pose.planar(*self.base) @ Pose.from_matrix(chain.fk(q)[0])

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Begin to play a trajectory back."""
        self.under_way[group] = (trajectory, 0, Motion(MotionState.MOVING))

    def motion(self, group: str) -> Motion:
        """How far that is."""
        return self.under_way[group][2] if group in self.under_way else Motion(MotionState.DONE)

    def halt(self, group: str) -> None:
        """Stop."""
        if self.motion(group).state is MotionState.MOVING:
            trajectory, row, _ = self.under_way[group]
            self.under_way[group] = (trajectory, row, Motion(MotionState.HALTED))

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """The bottle and the patient, as if it saw all around."""
        found = [Detection("Patient", self.patient, 1.0, SIZES["Patient"])]
        if self.holding is None and not self.given:
            found.append(Detection("DrinkingBottle", self.bottle, 1.0, SIZES["DrinkingBottle"]))
        return tuple(found)

    def scan(self, camera_link: str) -> tuple[Array, Any]:
        """No picture of depths."""
        return np.zeros((0, 3)), np.zeros(0, bool)

    def touches(self, links: Collection[str]) -> tuple[Touch, ...]:
        """Two fingers that are closed on the bottle."""
        for arm in self.robot.arms:
            gripper = arm.gripper
            if gripper is None or set(links) != set(gripper.finger_links):
                continue
            tip = self.link_pose(arm.tip)
            there = tip if arm.tip == self.holding else self.bottle
            narrow = abs(self.positions[gripper.joints[0]]) <= LEAST
            if narrow and not self.given and tip.distance(there) < NEAR:
                across = tip.rotation[:, 1]
                return tuple(
                    Touch(
                        link, tuple((there.position + side * 0.03 * across).tolist()), tuple((side * across).tolist())
                    )
                    for link, side in zip(gripper.finger_links, (1.0, -1.0), strict=False)
                )
        return ()

    def grip(self, link: str) -> None:
        """The bottle goes with the hand."""
        self.holding = link

    def loosen(self, link: str) -> None:
        """It stays where it is, or the patient has it."""
        if link == self.holding:
            self.given, self.holding = self.pulled(link), None

    def feels(self, link: str) -> bool:
        """Whether the bottle is in the hand."""
        return link == self.holding

    def pulled(self, link: str) -> bool:
        """Whether the hand is near the patient."""
        return link == self.holding and self.link_pose(link).distance(self.patient) < PULLS


@pytest.fixture
def served(stack: ExitStack) -> Callable[[type[MemoryRobot]], MemoryRobot]:
    """Lets a robot of a class serve a drink, with the bundled modules, and returns it."""

    def serve(kind: type[MemoryRobot]) -> MemoryRobot:
        robot = with_carrying(bind_robot("amigo"))
        semantic_map = read_map(load(bundled("ontologies") / "environments" / "hospital_room.omn"))
        believed = world_at_start(scene_of(semantic_map), robot, None, stack)
        poses = {thing.name: thing.pose for thing in semantic_map.objects if thing.pose is not None}
        real = kind(robot, believed.configuration(), poses["bottle1"], poses["patient1"])
        platform = platform_of(robot, semantic_map, real, believed, 0)
        executive = RobotExecutive(platform, bundled_registry().resolve([]), physics=None)
        plan = compiled(Path(bundled("recipes")) / "serve_a_drink.omn")
        run(plan, host=SimulationHost(real), executive=executive, max_steps=20_000)
        return real

    return serve


class Tiring(MemoryRobot):
    """The motors of one group give up, once or for ever."""

    tired, times = "base", 1

    def motion(self, group: str) -> Motion:
        """How far a motion is; the first ones of the group fail."""
        found = super().motion(group)
        if group == self.tired and self.times and found.state is MotionState.DONE and group in self.under_way:
            self.times -= 1
            trajectory, row, _ = self.under_way[group]
            self.under_way[group] = (trajectory, row, Motion(MotionState.FAILED, reason="motor 3 is off"))
            return self.under_way[group][2]
        return found


@pytest.mark.parametrize(
    ("group", "kind"),
    some([("base", NavigationFailure), ("right", ManipulationFailure)], every=2),
)
def test_a_motion_that_a_robot_does_not_make_is_a_failure_that_says_why(
    group: str, kind: type[PlanFailure], served: Callable[[type[MemoryRobot]], MemoryRobot]
) -> None:
    robot = type("Tired", (Tiring,), {"tired": group, "times": 1000})
    with pytest.raises(PlanFailure) as caught:
        served(robot)
    found = [one for one in caught.value.chain() if "motor 3 is off" in one.message]
    assert found
    assert isinstance(found[-1], kind)


@pytest.mark.long
def test_a_gripper_that_never_moves_is_given_up_for_the_other_hand(
    served: Callable[[type[MemoryRobot]], MemoryRobot],
) -> None:
    assert served(type("Tired", (Tiring,), {"tired": "gripper of right", "times": 1000})).given


def test_a_motion_that_a_robot_does_not_make_is_made_again(served: Callable[[type[MemoryRobot]], MemoryRobot]) -> None:
    assert served(type("Tired", (Tiring,), {"tired": "right", "times": 1})).given


def test_a_robot_that_is_no_simulator_serves_a_drink_with_the_bundled_modules(
    served: Callable[[type[MemoryRobot]], MemoryRobot],
) -> None:
    robot = served(MemoryRobot)
    assert robot.given
    assert robot.holding is None
