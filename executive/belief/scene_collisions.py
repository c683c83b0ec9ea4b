"""Collisions in the believed world: exact contacts, and quick checks that rule them out."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import combinations
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from executive.belief.belief import Belief
from executive.belief.believed_bodies import MEANT, handles_of
from executive.belief.memory import BasePose as BasePose
from executive.belief.scene_floor import SceneFloor
from executive.belief.scene_part import Kept
from executive.motion import QuickCheck
from executive.motion.arm_bodies import ArmBodies, ArmShapes, Ignored, Room, links_of
from executive.robots import Gripper
from executive.robots.arms import ArmModel, RobotModel
from executive.robots.openings import Fingers
from planlang.geometry import Array
from planlang.geometry.areas import Block
from planlang.geometry.matrices import moved
from planlang.kernel import still_computing
from planlang.protocols import Configuration, Contact, Touch
from sim import WorldMirror
from sim.bodies import FLOOR
from sim.scene import BodyShape

if TYPE_CHECKING:  # a plain run moves one arm at a time
    from executive.motion.arm_group import ArmGroup

CLOSING_STEPS = 24
"""Steps in which to check closing fingers: with Amigo's gripper, which opens 10 cm, about 2 mm each per finger."""

MANY = 5000
"""Pieces of bodies from which on a check leaves out distant ones; fewer are checked at once, for all questions."""
BEYOND = 1.0
"""Distance by which fingers that open, and the hand on its way, may be farther than the arm at a point [m]."""
OPPOSED = -0.5
"""Cosine of the angle between two touch normals below which they count as opposed."""


def opposed(touches: Iterable[Touch], least: float = OPPOSED) -> tuple[Touch, Touch] | None:
    """Find the most opposed touches of two links; None if the cosine between all normals is above ``least``."""
    pairs = [
        (float(np.dot(one.normal, other.normal)), one, other)
        for one, other in combinations(touches, 2)
        if one.link != other.link
    ]
    cosine, *pair = min(pairs, key=itemgetter(0), default=(math.inf,))
    return None if cosine > least else (pair[0], pair[1])


def pinched(touches: Iterable[Touch]) -> Array | None:
    """Find the map point (3,) midway between opposed touches of two fingers; None if no touches are opposed."""
    pair = opposed(touches)
    return None if pair is None else np.add(pair[0].point, pair[1].point) / 2


def _names(touches: str | None) -> frozenset[str]:
    return frozenset() if touches is None else frozenset({touches})


def _closing(gripper: Gripper, fingers: Fingers) -> list[dict[str, float]]:
    """Interpolate the joint positions of fingers from ``fingers`` to closed."""
    return [
        {name: (1.0 - share) * value + share * gripper.closed[name] for name, value in fingers}
        for share in np.linspace(0.0, 1.0, CLOSING_STEPS + 1)[1:].tolist()
    ]


class SceneCollisions(SceneFloor):
    """Collisions of the robot and its held objects in the planning world; results are cached until something moves."""

    def __init__(self, mirror: WorldMirror, model: RobotModel, belief: Belief) -> None:
        super().__init__(mirror, model, belief)
        world = self._world
        self._links = frozenset(world.robot.solid_names)
        self._rest = {arm.name: self._links - self._own_links(arm) for arm in model.arms}
        links, root = links_of(world), model.robot.base_link
        self._chains = {arm.name: ArmShapes(world, links, arm.chain, root, arm.tip) for arm in model.arms}
        self._checks: Kept[dict[object, QuickCheck]] = Kept()
        self._obstacles: Kept[Room] = Kept()
        self._near: Kept[Room] = Kept()
        """Most recent query only, since consecutive checks ask for the same."""
        self._touched: Kept[tuple[Contact, ...]] = Kept()
        self._lifts: Kept[dict[tuple[str, float], list[tuple[str, str]]]] = Kept()
        self._groups: dict[tuple[str, ...], ArmShapes] = {}
        self._arm_bodies: dict[tuple[str, Fingers], Kept[ArmBodies]] = {}

    # Exact checks

    def contacts(
        self,
        base: BasePose,
        arm: ArmModel | None = None,
        q: Array | None = None,
        touches: str | None = None,
        fingers: Fingers = (),
        among: Collection[tuple[str, str]] | None = None,
    ) -> tuple[Contact, ...]:
        """Compute penetrations with the base at a pose and an arm at ``q`` (d,), all other joints as they are.

        The arm's fingers may touch the body ``touches``; ``fingers``: their joint positions, by default the current
        ones. ``among``: the only pairs that can touch, if known.
        """
        still_computing()
        current = self._world.configuration().joints
        if arm is None or q is None:
            contacts = self._world.contacts(Configuration(base, current), ("base",), among=among)
            return contacts if among is not None else (*contacts, *self._own_contacts(current))
        joints = self._joined(arm, q, fingers)
        ignore = [(link, touches) for link in sorted(self.touching_links(arm))] if touches is not None else []
        moving = (*arm.joints, *(name for name, _ in fingers))
        return self._world.contacts(Configuration(base, joints), moving, ignore=ignore, among=among)

    def _joined(self, arm: ArmModel, q: Array, fingers: Fingers) -> dict[str, float]:
        """All joint positions, those of an arm at ``q`` (d,) and of its fingers at others."""
        joints = self._world.configuration().joints
        return {**joints, **dict(fingers), **dict(zip(arm.joints, map(float, q), strict=True))}

    def _own_contacts(self, joints: Mapping[str, float]) -> tuple[Contact, ...]:
        """Compute self-collisions of the robot with its held objects, which do not depend on the base pose."""
        state = tuple(joints.items()), self._belief.held
        configuration = Configuration(self._world.configuration().base, joints)
        return self._touched.of(state, lambda: self._world.self_contacts(configuration))

    def stops_closing(self, base: BasePose, arm: ArmModel, q: Array, around: str, fingers: Fingers) -> str | None:
        """Find the body that stops a closing finger before it touches ``around``; None if there is none.

        Hinged fingers move forward while they close, so a body behind the object may stop them.
        """
        gripper = arm.gripper
        if gripper is None:
            return None
        joints = self._joined(arm, q, fingers)
        steps = _closing(gripper, fingers)
        links = [self._world.robot.moved_by(name) for name in gripper.joints]
        independent = len(frozenset[int]().union(*links)) == sum(map(len, links))
        if independent and self._world.passed(Configuration(base, joints), steps) <= {around}:
            return None  # no finger's motion depends on whether another one has been stopped
        return self._close(base, joints, steps, around)

    def closed_on(
        self, base: BasePose, arm: ArmModel, q: Array, around: str, fingers: Fingers | None = None
    ) -> Mapping[str, float] | None:
        """Compute the joint positions of fingers closed on a body; None if they do not pinch it.

        ``fingers``: their positions before, by default fully open.
        """
        gripper = arm.gripper
        joints = self.closed(base, arm, q, around, arm.openings.widest if fingers is None else fingers)
        if gripper is None or joints is None:
            return None
        point = pinched(self._world.touches(gripper.finger_links, Configuration(base, joints)))
        if point is None or (distance := self._distance(around, point)) > MEANT:
            return None
        others = (body.name for body in self._world.scene.bodies if body.graspable and body.name != around)
        if any(self._distance(name, point) < distance for name in others):
            return None
        return {name: joints[name] for name in gripper.joints}

    def closed(
        self, base: BasePose, arm: ArmModel, q: Array, around: str, fingers: Fingers
    ) -> Mapping[str, float] | None:
        """Compute all joint positions with fingers, first at ``fingers``, closed until they touch a body.

        None if another body stops them.
        """
        gripper = arm.gripper
        if gripper is None:
            return None
        joints = self._joined(arm, q, fingers)
        return joints if self._close(base, joints, _closing(gripper, fingers), around) is None else None

    def _distance(self, name: str, point: Array) -> float:
        """Compute the distance of a map point (3,) from a body or its handles [m]."""
        body, pose = self._world.scene.body(name), self._world.pose(name)
        return min(one.away(point) for one in (Block.of(pose, body.size), *handles_of(body, pose)))

    def _close(
        self, base: BasePose, joints: dict[str, float], steps: Sequence[Mapping[str, float]], around: str
    ) -> str | None:
        """Close fingers step by step until they touch ``around``; return another body that stops them, or None.

        Updates ``joints`` to the positions reached.
        """
        moving = list(steps[0])
        for step in steps:
            together = joints | {name: step[name] for name in moving}
            if len(moving) > 2 and not self._world.contacts(Configuration(base, together), moving):
                joints.update(together)  # hands of many joints: one query while nothing is touched
                continue
            for name in tuple(moving):
                value = step[name]
                contacts = self._world.contacts(Configuration(base, joints | {name: value}), [name])
                bodies = [contact.body for contact in contacts]
                if not bodies:
                    joints[name] = value
                elif around in bodies or set(bodies) <= self._links:
                    moving.remove(name)
                else:
                    return next(body for body in bodies if body not in self._links)
        return None

    def lifted(self, arm: ArmModel, torsos: Sequence[float]) -> tuple[float, ...]:
        """Select the torso positions without self-collision of the robot's other parts in their current posture."""
        if arm.lift is None:
            return tuple(torsos)
        current = self._world.configuration()
        cached, joint, rest = self._lifts.of(self._posture(), dict), arm.lift.joint, self._rest[arm.name]
        for torso in torsos:
            if (joint, torso) not in cached:
                contacts = self._world.self_contacts(Configuration(current.base, {**current.joints, joint: torso}))
                cached[joint, torso] = [(contact.part, contact.body) for contact in contacts]
        return tuple(torso for torso in torsos if not any(rest.issuperset(pair) for pair in cached[joint, torso]))

    # Quick checks

    def prepare(self) -> None:
        """Fill the caches of all arms now, so that no plan has to wait for that."""
        for arm in self._arms:
            self.quick_check(arm, None)

    def quick_check(self, arm: ArmModel, touches: str | None) -> QuickCheck:
        """Build a check, without PyBullet, of an arm's motions from here; ``touches`` as in :meth:`contacts`."""
        bodies = self._bodies_of(arm, ())
        base = self._world.link_pose(self._robot.base_link).matrix()
        centre = moved(base, bodies.centre)
        return bodies.against(
            base, self._room().near(centre, bodies.reach), (self.touching_links(arm), _names(touches))
        )

    def group_check(
        self,
        group: ArmGroup,
        arms: Sequence[ArmModel],
        base_link: Array,
        touches: frozenset[str] = frozenset(),
        gone: frozenset[str] = frozenset(),
    ) -> QuickCheck:
        """Build a check, without PyBullet, of joint motions of several arms; held blades may slide under thin bodies.

        ``base_link``: pose (4, 4) of the robot's base link in the map; ``touches``: bodies that the fingers may touch;
        ``gone``: bodies to ignore.
        """
        world, names = self._world, tuple(arm.name for arm in arms)
        if names not in self._groups:
            tip = self._robot.arm(names[0]).tip
            self._groups[names] = ArmShapes(world, links_of(world), group, self._robot.base_link, tip)
        bodies = self._groups[names].now(world)
        room = self._room().near(moved(base_link, bodies.centre), bodies.reach)
        if any(world.scene.body(name).blade for name in world.attached()):
            room = room.without([body.name for body in world.scene.bodies if body.thin])
        room = room.without(sorted(gone)) if gone else room
        return bodies.against(base_link, room, (frozenset[str]().union(*map(self.touching_links, arms)), touches))

    def touching(
        self,
        joints: Mapping[str, float],
        base: BasePose | None = None,
        *,
        ignore: Collection[str | tuple[str, str]] = (),
    ) -> list[tuple[str, str]]:
        """List the forbidden contacts with some joints, and optionally the base, at other positions.

        ``ignore``: bodies, or pairs of a link and a body, that may touch.
        """
        current = self._world.configuration()
        configuration = Configuration(base or current.base, {**current.joints, **joints})
        contacts = self._world.contacts(configuration, tuple(joints), ignore=ignore)
        return [(contact.part, contact.body) for contact in contacts]

    def touching_links(self, arm: ArmModel) -> frozenset[str]:
        """Collect the links that may touch an arm's object: fingers, but not the palm; without gripper, the hand."""
        gripper = arm.gripper
        return frozenset(gripper.finger_links) if gripper is not None else arm.hand_links

    def arm_check(
        self, arm: ArmModel, touches: str | None, fingers: Fingers, near: tuple[Array, float] | None = None
    ) -> QuickCheck:
        """Build a check that rules out postures of an arm from any base pose, and poses of its hand.

        ``near``: centre (3,) and radius [m] of a sphere of the map; only bodies that intersect it are checked.
        """
        key, ignored = ("arm", arm.name, touches, fingers), (self.touching_links(arm), _names(touches))
        return self._check(key, near, lambda: self._bodies_of(arm, fingers), ignored)

    def near(self, arm: ArmModel, points: Array) -> tuple[Array, float] | None:
        """Bound what an arm may touch with its base or its tip at points (n, 3); None if few bodies are in the map."""
        if len(self.solids().bodies) < MANY:
            return None
        low, high = np.floor(points.min(axis=0)), np.ceil(points.max(axis=0))  # so that questions share a check
        bodies = self._bodies_of(arm, ())
        beyond = float(np.linalg.norm(bodies.centre)) + bodies.reach + BEYOND
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2 + beyond

    def stance_check(self, near: tuple[Array, float] | None = None) -> QuickCheck:
        """Build a check that rules out base poses at which an arm in its current posture would be in collision."""
        several = [self._chains[arm.name] for arm in self._arms]
        return self._check("stance", near, lambda: ArmShapes.still(self._world, several), (frozenset(), frozenset()))

    def _check(
        self, key: object, near: tuple[Array, float] | None, bodies: Callable[[], ArmBodies], ignored: Ignored
    ) -> QuickCheck:
        """Build a check of parts of the robot against the room, or look it up until something moves."""
        cached = self._checks.of((self._state(), self._posture()), dict)
        full_key = key, None if near is None else (near[0].tobytes(), near[1])
        if full_key not in cached:
            cached[full_key] = bodies().against(np.eye(4), self._room_near(near), ignored)
        return cached[full_key]

    def _room_near(self, near: tuple[Array, float] | None) -> Room:
        """Select the obstacles that intersect a sphere, or all."""
        room = self._room()
        return room if near is None else self._near.of((room, near[0].tobytes(), near[1]), lambda: room.near(*near))

    def _room(self) -> Room:
        """Collect all bodies as obstacles."""
        solids = self.solids()
        rooms = (body.name for body in self._world.scene.bodies if body.shape is BodyShape.ROOM)
        return self._obstacles.of(solids, lambda: Room.of(solids, next(rooms, FLOOR)))

    def _bodies_of(self, arm: ArmModel, fingers: Fingers) -> ArmBodies:
        """Build the shapes of an arm with all that it moves, and the parts of the robot that it may touch.

        They are valid for all positions of the arm's own joints.
        """
        joints = self._world.configuration().joints
        rest = tuple(item for item in joints.items() if item[0] not in arm.joints)
        chain, changed = self._chains[arm.name], {name: value for name, value in fingers if joints.get(name) != value}
        cached = self._arm_bodies.setdefault((arm.name, fingers if changed else ()), Kept())
        # Not of what they touched since the grasp: that only shrinks, and a larger set leaves more to exact checks.
        held = self._state() if self._belief.held else None
        return cached.of((rest, held), lambda: chain.now(self._world, changed))

    def _own_links(self, arm: ArmModel) -> frozenset[str]:
        """Collect the links that the joints of an arm move, the torso's left out."""
        robot = self._world.robot
        links = (robot.moved_by(name) for name in arm.joints if arm.lift is None or name != arm.lift.joint)
        return frozenset(robot.solid_names[number] for number in frozenset[int]().union(*links))
