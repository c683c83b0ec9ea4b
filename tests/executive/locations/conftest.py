"""A judge of places and hand poses that shares no code with what it judges: a physics client of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import pybullet
import pytest

from executive.locations import HandSolution
from executive.robots import Robot
from planlang.geometry import Array
from sim import PlanningWorld
from tests.executive.conftest import Stage
from tests.support.locations.oracle import followers, led

TOUCHING = 0.002
"""Penetrations up to this depth are judged as touching [m]: the judge's cylinders are polyhedra, up to 1 mm wider."""

WITHIN = 0.001
"""Distances up to this are asked for [m]: asked for none at all, PyBullet does not tell all penetrations."""


class Judge:
    """The robot's URDF and primitives at the poses of a world, in a client of its own."""

    def __init__(self, robot: Robot, world: PlanningWorld) -> None:
        self.robot = robot
        self.client = pybullet.connect(pybullet.DIRECT)
        self.uid = pybullet.loadURDF(str(robot.urdf), useFixedBase=True, physicsClientId=self.client)
        self.joints: dict[str, int] = {}
        self.links = {robot.base_link: -1}
        self.parents: dict[int, int] = {}
        for index in range(pybullet.getNumJoints(self.uid, physicsClientId=self.client)):
            info = pybullet.getJointInfo(self.uid, index, physicsClientId=self.client)
            self.links[info[12].decode()] = index
            self.parents[index] = info[16]
            if info[2] != pybullet.JOINT_FIXED:
                self.joints[info[1].decode()] = index
        self.names = {index: name for name, index in self.links.items()}
        self.followers = followers(robot.urdf)
        self.pieces: dict[int, str] = {}
        for name in world.names():
            if world.scene.body(name).shape not in ("marker", "room") and name not in world.attached():
                self._build(world, name)

    def _build(self, world: PlanningWorld, name: str) -> None:
        for part, offset in world.pieces(name):
            size = part.size
            if part.kind == "box":
                shape = {"shapeType": pybullet.GEOM_BOX, "halfExtents": [extent / 2 for extent in size]}
            elif part.kind == "cylinder":
                shape = {"shapeType": pybullet.GEOM_CYLINDER, "radius": max(size[:2]) / 2, "height": size[2]}
            else:
                shape = {"shapeType": pybullet.GEOM_SPHERE, "radius": max(size) / 2}
            solid = pybullet.createCollisionShape(physicsClientId=self.client, **shape)
            seen = {key: value for key, value in shape.items() if key != "height"}
            if "height" in shape:
                seen["length"] = shape["height"]
            visual = pybullet.createVisualShape(physicsClientId=self.client, **seen)
            at = world.pose(name) @ offset
            uid = pybullet.createMultiBody(0, solid, visual, at.position, at.orientation, physicsClientId=self.client)
            self.pieces[uid] = name

    def close(self) -> None:
        """End the client."""
        pybullet.disconnect(self.client)

    def place(self, base: tuple[float, float, float], joints: Mapping[str, float]) -> None:
        """Put the robot somewhere; joints that mimic others go with them."""
        turn = pybullet.getQuaternionFromEuler([0.0, 0.0, base[2]])
        inertial = pybullet.getDynamicsInfo(self.uid, -1, physicsClientId=self.client)[3:5]
        there = pybullet.multiplyTransforms([base[0], base[1], 0.0], turn, *inertial)
        pybullet.resetBasePositionAndOrientation(self.uid, *there, physicsClientId=self.client)
        for name, value in {**joints, **led(joints, self.followers)}.items():
            pybullet.resetJointState(self.uid, self.joints[name], value, physicsClientId=self.client)

    def link(self, name: str) -> Array:
        """Frame (4, 4) of a link in the map."""
        state = pybullet.getLinkState(
            self.uid, self.links[name], computeForwardKinematics=True, physicsClientId=self.client
        )
        frame = np.eye(4)
        frame[:3, :3] = np.array(pybullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)
        frame[:3, 3] = state[4]
        return frame

    def touched(self, allowed: frozenset[tuple[str, str]] = frozenset()) -> set[tuple[str, str]]:
        """(link, body) pairs that penetrate, and (link, link) pairs of parts that are far apart along the robot."""
        found = set()
        for uid, body in self.pieces.items():
            for point in pybullet.getClosestPoints(self.uid, uid, WITHIN, physicsClientId=self.client):
                if point[8] < -TOUCHING:
                    found.add((self.names[point[3]], body))
        for point in pybullet.getClosestPoints(self.uid, self.uid, WITHIN, physicsClientId=self.client):
            if point[8] < -TOUCHING and not self._neighbours(point[3], point[4]):
                found.add((self.names[point[3]], self.names[point[4]]))
        return found - allowed

    def _neighbours(self, one: int, other: int) -> bool:
        """Return whether two links are at most four joints apart along the robot."""
        up, down = self._up(one), self._up(other)
        shared = next(link for link in up if link in down)
        return up.index(shared) + down.index(shared) <= 4

    def _up(self, link: int) -> list[int]:
        chain = [link]
        while chain[-1] != -1:
            chain.append(self.parents[chain[-1]])
        return chain

    def lowest(self, links: frozenset[str]) -> float:
        """Height of the lowest point of boxes around links [m]."""
        boxes = [pybullet.getAABB(self.uid, self.links[name], physicsClientId=self.client) for name in sorted(links)]
        return min(float(low[2]) for low, _ in boxes)

    def sees(self, name: str, base: tuple[float, float, float], joints: Mapping[str, float]) -> bool:
        """Return whether with some posture of the neck the camera's picture has at least 4 pixels of a body."""
        camera = self.robot.camera
        assert camera is not None
        self.place(base, joints)
        target = next(
            np.array(pybullet.getBasePositionAndOrientation(uid, physicsClientId=self.client)[0])
            for uid, body in self.pieces.items()
            if body == name
        )
        best: tuple[float, dict[str, float]] = (math.inf, {})
        limits = [self._limits(joint) for joint in self.robot.neck]
        for values in np.stack(np.meshgrid(*(np.linspace(*ends, 25) for ends in limits)), -1).reshape(-1, len(limits)):
            self.place(base, dict(zip(self.robot.neck, values, strict=True)))
            frame = self.link(camera.link)
            arrow = target - frame[:3, 3]
            away = float(np.linalg.norm(arrow))
            missed = math.acos(min(1.0, float(frame[:3, :3] @ camera.forward @ arrow) / away))
            best = min(best, (missed, dict(zip(self.robot.neck, values, strict=True))), key=lambda item: item[0])
        self.place(base, best[1])
        frame = self.link(camera.link)
        if not camera.near <= np.linalg.norm(target - frame[:3, 3]) <= camera.far:
            return False
        eye, ahead, up = frame[:3, 3], frame[:3, :3] @ camera.forward, frame[:3, :3] @ camera.up
        view = pybullet.computeViewMatrix(list(eye), list(eye + ahead), list(up))
        vertical = 2 * math.degrees(math.atan(math.tan(camera.fov / 2) * camera.height / camera.width))
        lens = pybullet.computeProjectionMatrixFOV(vertical, camera.width / camera.height, 0.02, 20.0)
        segments = pybullet.getCameraImage(
            camera.width,
            camera.height,
            view,
            lens,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )[4]
        wanted = [uid for uid, body in self.pieces.items() if body == name]
        return int(np.isin(np.asarray(segments), wanted).sum()) >= 4

    def _limits(self, joint: str) -> tuple[float, float]:
        info = pybullet.getJointInfo(self.uid, self.joints[joint], physicsClientId=self.client)
        return float(info[8]), float(info[9])

    def assert_possible(self, way: HandSolution, base: tuple[float, float, float], stage: Stage) -> None:
        """The joint values of a way put the tip where its poses say, within the limits, and nothing touches."""
        arm = self.robot.arm(way.arm.name)
        joints = {**stage.planning.configuration().joints, **dict(way.plan.fingers)}
        hand = [name for name in self.links if self.links[arm.hand_link] in self._up(self.links[name])]
        allowed = frozenset((link, way.plan.touches) for link in hand if way.plan.touches is not None)
        for pose, q in zip(way.plan.poses, way.joints, strict=True):
            assert np.all(q >= way.arm.lower - 1e-6), f"{way.plan.label}: below the limits of a joint"
            assert np.all(q <= way.arm.upper + 1e-6), f"{way.plan.label}: above the limits of a joint"
            self.place(base, joints | dict(zip(way.arm.joints, q, strict=True)))
            reached = self.link(arm.tip)
            assert np.linalg.norm(reached[:3, 3] - pose[:3, 3]) < 1e-3, f"{way.plan.label}: the tip is elsewhere"
            turned = (np.trace(reached[:3, :3].T @ pose[:3, :3]) - 1) / 2
            assert math.acos(min(1.0, turned)) < 2e-3, f"{way.plan.label}: the tip is turned otherwise"
            assert not self.touched(allowed), f"{way.plan.label} from {base} touches {self.touched(allowed)}"


MakeJudge = Callable[[Stage], Judge]


@pytest.fixture
def judge_of(amigo: Robot) -> Iterator[MakeJudge]:
    """Makes judges of stages: of what is believed there."""
    made: list[Judge] = []

    def make(stage: Stage) -> Judge:
        made.append(Judge(amigo, stage.planning))
        return made[-1]

    yield make
    for one in made:
        one.close()
