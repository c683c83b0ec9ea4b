"""Collisions in the believed world: exact contacts, and quick checks that rule them out."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from operator import itemgetter
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from executive.belief.belief import Belief
from executive.belief.believed_bodies import MEANT, Block, handles_of
from executive.belief.floor import CELL, Floor
from executive.motion import Boxes, Grid, QuickCheck
from executive.motion.arm_bodies import ArmBodies, ArmShapes, Ignored, Room, links_of
from executive.motion.bodies import Solids
from executive.motion.clearance import Band, outlines
from executive.motion.drivable import EVERY, LACKING, SPARE, Drivable, drivable, free_poses
from executive.robots import Gripper, Robot
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.geometry import Array
from planlang.geometry.matrices import moved
from planlang.kernel import still_computing
from planlang.protocols import Configuration, Contact, Touch
from sim import PlanningWorld
from sim.bodies import FLOOR
from sim.scene import BodyShape

if TYPE_CHECKING:  # a plain run moves one arm at a time
    from executive.motion.arm_group import ArmGroup

BasePose = tuple[float, float, float]
"""Pose of the base in the map (x [m], y [m], yaw [rad])."""

NEAR_ITS_END = 0.4
"""Distance from the end of a straight way up to which a base has less than a cell of room to turn [m]."""
ASIDE = (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6)
"""Distances from the middle of the straight way at which a way with one turn is tried [m]."""
MOST_FLOOR = 10_000.0
"""Area of a map of which it is worked out where the base can get to [m^2]."""


T = TypeVar("T")


class Latest(Generic[T]):
    """A value that is kept as long as the state for which it was worked out stays."""

    def __init__(self) -> None:
        self._known: tuple[object, T] | None = None

    def of(self, state: object, work_out: Callable[[], T]) -> T:
        """Return the value for a state."""
        if self._known is None or self._known[0] != state:
            self._known = state, work_out()
        return self._known[1]


CLOSING_STEPS = 24
"""In how many steps closing fingers are looked at: with Amigo's gripper, which opens 10 cm, about 2 mm each."""


OPPOSED = -0.5
"""Cosine up to which the directions from which two fingers are touched count as opposed."""

MOST_REMOVED = 8
"""Bodies near the way of which is worked out whether the base would get farther without them."""


def pinched(touches: Iterable[Touch]) -> Array | None:
    """Return the point (3,) of the map about which two fingers feel something between them; None if they do not."""
    sides = [
        (float(np.dot(one.normal, other.normal)), one, other)
        for one, other in combinations(touches, 2)
        if one.link != other.link
    ]
    opposed, one, other = min(sides, key=itemgetter(0), default=(0.0, None, None))
    if one is None or other is None or opposed > OPPOSED:
        return None
    return np.add(one.point, other.point) / 2


def _names(touches: str | None) -> frozenset[str]:
    return frozenset() if touches is None else frozenset({touches})


def _closing(gripper: Gripper, fingers: Fingers) -> list[dict[str, float]]:
    """Return the joint values of fingers on their way from where they are to closed."""
    return [
        {name: (1.0 - share) * value + share * gripper.closed[name] for name, value in fingers}
        for share in np.linspace(0.0, 1.0, CLOSING_STEPS + 1)[1:].tolist()
    ]


def _flood(base: BasePose, floor: Floor, slack: float = LACKING) -> Drivable:
    """Return where a base can get to on a floor, if it may lack some room [m]."""
    x_min, y_min, x_max, y_max = floor.bounds
    grid = Grid.over((x_min, y_min), (x_max, y_max))
    return drivable(base, grid, free_poses(grid, floor.boxes, floor.silhouette, floor.outlines, slack))


class SceneCollisions:
    """Collisions of the robot, with what it holds, in the planning world; what does not change is kept."""

    def __init__(self, world: PlanningWorld, robot: Robot, belief: Belief, arms: Sequence[ArmModel]) -> None:
        self._world, self._robot, self._belief, self._arms = world, robot, belief, tuple(arms)
        self._bodies: Latest[tuple[Boxes, Solids]] = Latest()
        self._floor: Latest[Floor] = Latest()
        self._drivable: Latest[Drivable] = Latest()
        self._reached: Latest[Drivable] = Latest()
        self._links = frozenset(world.robot.solid_names)
        self._rest = {arm.name: self._links - self._own_links(arm) for arm in arms}
        links = links_of(world)
        self._chains = {
            arm.name: ArmShapes(world, links, arm.solver.chain, robot.base_link, robot.arm(arm.name).tip)
            for arm in arms
        }
        self._checks: Latest[dict[object, QuickCheck]] = Latest()
        self._obstacles: Latest[Room] = Latest()
        self._near: Latest[Room] = Latest()
        """The last, as several checks ask for the same."""
        self._touched: Latest[tuple[Contact, ...]] = Latest()
        self._lifts: Latest[dict[tuple[str, float], list[tuple[str, str]]]] = Latest()
        self._groups: dict[tuple[str, ...], ArmShapes] = {}
        self._arm_bodies: dict[tuple[str, Fingers], Latest[ArmBodies]] = {}

    # Room

    def floor(self) -> Floor:
        """Return the floor that is left to the base: with the robot's body, arms left out, as it is now."""

        def work_out() -> Floor:
            arms = [name for arm in self._robot.arms for name in arm.joints]
            shapes = outlines(self._world.outlines(arms))
            return Floor(self.obstacles(), self._world.silhouette(arms), shapes, self._world.scene.bounds)

        return self._floor.of((self._state(), self._posture()), work_out)

    def floor_without(self, body: str) -> Floor:
        """Return the floor that would be left to the base if a body were not there."""
        return replace(self.floor(), boxes=self.boxes_but((body,))[0])

    def has_way(self, base: BasePose) -> bool:
        """Return whether the base can get to a pose: with a turn at most, or else over places and headings."""
        return self._goes_straight(base) or bool(self._surely()(np.array([base]))[0])

    def _goes_straight(self, base: BasePose) -> bool:
        """Return whether there is room to turn on two lines to a pose, which meet beside its middle, one of a few.

        Before its end there has to be more room than that: so much that a flood over cells would get there, too.
        """
        floor, start, end = self.floor(), np.array(self._world.configuration().base[:2]), np.array(base[:2])
        way = end - start
        across = np.array([-way[1], way[0]]) / max(float(np.hypot(*way)), CELL)
        corners = ((start + end) / 2 + np.outer(ASIDE, across))[:, None]
        count = math.ceil(2 * (float(np.hypot(*way)) / 2 + max(ASIDE)) / CELL) + 1
        shares = np.linspace(0.0, 1.0, count)[None, :, None]
        lines = np.concatenate([start + shares * (corners - start), corners + shares * (end - corners)], axis=1)
        room = floor.at(lines.reshape(-1, 2)).reshape(lines.shape[:2])
        before = np.hypot(*np.moveaxis(lines - end, 2, 0)) > NEAR_ITS_END
        return bool((room >= np.where(before, CELL, 0.0)).all(axis=1).any())

    def drivable(self) -> Drivable:
        """Return where the base can get to from where it is, arms left out; a little room may be missing.

        Nothing is ruled out for a base that stands in something, nor on a map that is too large to be filled.
        """
        return self._flooded(self._drivable, self.floor(), LACKING)

    def _surely(self) -> Drivable:
        """Return where the base can get to from where it is, arms left out; no room may be missing on the way."""
        return self._flooded(self._reached, self.floor(), -SPARE)

    def _flooded(self, known: Latest[Drivable], floor: Floor, slack: float) -> Drivable:
        """Return where the base can get to on a floor, if it may lack some room [m]."""
        now = self._world.configuration()

        def work_out() -> Drivable:
            x_min, y_min, x_max, y_max = floor.bounds
            large = (x_max - x_min) * (y_max - y_min) > MOST_FLOOR
            if large or self._world.contacts(now, ("base",)):
                return Drivable(Grid(0.0, 0.0, 1, 1), np.full((1, 1), EVERY), beyond=True)
            return _flood(now.base, floor, slack)

        return known.of((floor, now.base), work_out)

    def whole(self) -> Floor:
        """Return the floor that is left to the base: with the robot's body and its arms, as they are now."""
        shapes = outlines(self._world.outlines())
        return Floor(self.obstacles(), self.silhouette(), shapes, self._world.scene.bounds)

    def closes_way(self, place: Array, within: float) -> str | None:
        """Return the body without which the base would get to more floor ``within`` [m] of a place (2,), if one does.

        Of several the one that keeps the base from most of that floor; bodies far from the straight line are not tried.
        """
        known = self.drivable()
        if known.beyond:
            return None
        base, cells = self._world.configuration().base, known.near(place, within)
        boxes, names = self.boxes_but(())
        line = np.linspace(base[:2], place, 20)
        away = np.linalg.norm(boxes.centres[:, None, :2] - line, axis=2).min(axis=1) - boxes.half_extents[:, :2].max(
            axis=1
        )
        nearest = dict.fromkeys(names[row] for row in np.argsort(away, kind="stable").tolist())
        gains = {
            name: _flood(base, self.floor_without(name)).near(place, within) - cells
            for name in list(nearest)[:MOST_REMOVED]
        }
        best = max(gains, key=lambda name: gains[name], default=None)
        return best if best is not None and gains[best] > 0 else None

    def obstacles(self) -> Boxes:
        """Return boxes around the pieces of all bodies that are not held, the floor left out."""
        return self.boxes_but(())[0]

    def boxes_but(self, without: Sequence[str]) -> tuple[Boxes, tuple[str, ...]]:
        """Return boxes around the pieces of all bodies that are not held, some left out; and whose they are."""
        boxes, solids = self._of_bodies()
        if not set(without) & set(solids.bodies):
            return boxes, solids.bodies
        kept = np.flatnonzero([body not in without for body in solids.bodies])
        return boxes.only(kept), tuple(solids.bodies[index] for index in kept)

    def solids(self) -> Solids:
        """Return the pieces of all bodies that are not held."""
        return self._of_bodies()[1]

    def silhouette(self) -> tuple[Band, ...]:
        """Return what the robot needs of room when it stands or turns, with what it holds, in its present posture."""
        return self._world.silhouette()

    def _of_bodies(self) -> tuple[Boxes, Solids]:
        """Return boxes around the pieces, and the pieces themselves."""

        def work_out() -> tuple[Boxes, Solids]:
            pieces = self._world.solids()
            sizes = np.array([piece.size for piece in pieces]).reshape(-1, 3)
            return Boxes.around([piece.pose for piece in pieces], sizes), Solids.of(pieces)

        return self._bodies.of(self._state(), work_out)

    def _posture(self) -> object:
        """Return the joint values as a value that can be compared."""
        return tuple(self._world.configuration().joints.items())

    def _state(self) -> object:
        """Return what the places of all bodies depend on."""
        return self._belief.revision, tuple(self._belief.held), tuple(self._world.attached())

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
        """Return penetrations with an arm at ``q``, all else as it is; its fingers may touch the body ``touches``.

        ``fingers``: where those of the arm are, if not as they are. ``among``: the only pairs that can touch, if known.
        """
        still_computing()
        now = self._world.configuration().joints
        if arm is None or q is None:
            found = self._world.contacts(Configuration(base, now), ("base",), among=among)
            return found if among is not None else (*found, *self._own_contacts(now))
        joints = {**now, **dict(fingers), **dict(zip(arm.joints, map(float, q), strict=True))}
        ignore = [(link, touches) for link in sorted(self.touching_links(arm))] if touches is not None else []
        moving = (*arm.joints, *(name for name, _ in fingers))
        return self._world.contacts(Configuration(base, joints), moving, ignore=ignore, among=among)

    def _own_contacts(self, joints: Mapping[str, float]) -> tuple[Contact, ...]:
        """Return where the robot, as it is, with what it holds, touches itself: wherever it stands."""
        state = tuple(joints.items()), tuple(self._world.attached())
        there = Configuration(self._world.configuration().base, joints)
        return self._touched.of(state, lambda: self._world.self_contacts(there))

    def stops_closing(self, base: BasePose, arm: ArmModel, q: Array, around: str, fingers: Fingers) -> str | None:
        """Return the body that a finger, closing, meets before it meets ``around``; None if there is none.

        Fingers on hinges go forward while they close: what is behind a thing may keep them from it.
        """
        gripper = self._robot.arm(arm.name).gripper
        if gripper is None:
            return None
        joints = dict(self._world.configuration().joints) | dict(zip(arm.joints, map(float, q), strict=True))
        joints |= fingers
        steps = _closing(gripper, fingers)
        links = [self._world.robot.moved_by(name) for name in gripper.joints]
        apart = len(frozenset[int]().union(*links)) == sum(map(len, links))
        if apart and self._world.passed(Configuration(base, joints), steps) <= {around}:
            return None  # each finger goes its way whatever becomes of the others
        stopped = self._close(base, joints, steps, around)
        return stopped if isinstance(stopped, str) else None

    def closed_on(
        self, base: BasePose, arm: ArmModel, q: Array, around: str, fingers: Fingers | None = None
    ) -> Mapping[str, float] | None:
        """Return where the fingers of an arm come to rest with a body between them, as joint values; None elsewhere.

        ``fingers``: where they begin, if not opened as far as they go.
        """
        fingers = arm.openings.widest if fingers is None else fingers
        gripper = self._robot.arm(arm.name).gripper
        if gripper is None:
            return None
        joints = dict(self._world.configuration().joints) | dict(zip(arm.joints, map(float, q), strict=True))
        joints |= fingers
        stopped = self._close(base, joints, _closing(gripper, fingers), around)
        if isinstance(stopped, str):
            return None
        point = pinched(self._world.touches(gripper.finger_links, Configuration(base, joints)))
        if point is None or (away := self._away(around, point)) > MEANT:
            return None
        others = (body.name for body in self._world.scene.bodies if body.graspable and body.name != around)
        return None if any(self._away(name, point) < away for name in others) else stopped

    def _away(self, name: str, point: Array) -> float:
        """Return how far a point (3,) of the map is from a body [m]."""
        body, pose = self._world.scene.body(name), self._world.pose(name)
        return min(one.away(point) for one in (Block.of(pose, body.size), *handles_of(body, pose)))

    def _close(
        self, base: BasePose, joints: dict[str, float], steps: Sequence[Mapping[str, float]], around: str
    ) -> str | Mapping[str, float]:
        """Return the fingers' joint values where they meet a body, or what they meet before."""
        moving = list(steps[0])
        for step in steps:
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
        return {name: joints[name] for name in steps[0]}

    def lifted(self, arm: ArmModel, torsos: Sequence[float]) -> tuple[float, ...]:
        """Return the torso positions at which the rest of the robot, in its present posture, does not touch itself."""
        if arm.lift is None:
            return tuple(torsos)
        now = self._world.configuration()
        known, joint, rest = self._lifts.of(self._posture(), dict), arm.lift.joint, self._rest[arm.name]
        for torso in torsos:
            if (joint, torso) not in known:
                found = self._world.self_contacts(Configuration(now.base, {**now.joints, joint: torso}))
                known[joint, torso] = [(contact.part, contact.body) for contact in found]
        return tuple(torso for torso in torsos if not any(rest.issuperset(pair) for pair in known[joint, torso]))

    # Quick checks

    def prepare(self) -> None:
        """Work out now what arms need to find their way, once for this robot: later a plan would wait for it."""
        for arm in self._arms:
            self.quick_check(arm, None)

    def quick_check(self, arm: ArmModel, touches: str | None) -> QuickCheck:
        """Return a check, without PyBullet, of how an arm may move here; ``touches`` as in :meth:`contacts`."""
        bodies = self._bodies_of(arm, ())
        base = self._world.link_pose(self._robot.base_link).matrix()
        middle = moved(base, bodies.centre)
        return bodies.against(
            base, self._room().near(middle, bodies.reach), (self.touching_links(arm), _names(touches))
        )

    def group_check(
        self,
        group: ArmGroup,
        arms: Sequence[ArmModel],
        base_link: Array,
        touches: frozenset[str] = frozenset(),
        gone: frozenset[str] = frozenset(),
    ) -> QuickCheck:
        """Return a check, without PyBullet, of how arms may move together; blades may go under what is thin.

        ``base_link``: the pose (4, 4) of the robot's base link in the map from which they do; ``touches``: the bodies
        that their fingers may touch; ``gone``: those that are elsewhere by then.
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
        """Return which two bodies penetrate each other, wrongly, with some joints, and perhaps the base, elsewhere.

        ``ignore``: bodies, or pairs of a link and a body, that may touch.
        """
        now = self._world.configuration()
        there = Configuration(base or now.base, {**now.joints, **joints})
        return [(contact.part, contact.body) for contact in self._world.contacts(there, tuple(joints), ignore=ignore)]

    def touching_links(self, arm: ArmModel) -> frozenset[str]:
        """Return the links that may touch what an arm takes or pushes: its fingers; its palm would be in the way."""
        gripper = self._robot.arm(arm.name).gripper
        return frozenset(gripper.finger_links) if gripper is not None else arm.hand_links

    def arm_check(
        self, arm: ArmModel, touches: str | None, fingers: Fingers, near: tuple[Array, float] | None = None
    ) -> QuickCheck:
        """Return a check that rules out postures of an arm from any base, and poses of its hand."""
        key, ignored = ("arm", arm.name, touches, fingers), (self.touching_links(arm), _names(touches))
        return self._check(key, near, lambda: self._bodies_of(arm, fingers), ignored)

    def stance_check(self, near: tuple[Array, float] | None = None) -> QuickCheck:
        """Return a check that rules out bases from which an arm, in its present posture, would stick into something."""
        several = [self._chains[arm.name] for arm in self._arms]
        return self._check("stance", near, lambda: ArmShapes.still(self._world, several), (frozenset(), frozenset()))

    def _check(
        self, key: object, near: tuple[Array, float] | None, bodies: Callable[[], ArmBodies], ignored: Ignored
    ) -> QuickCheck:
        """Return the check of some bodies against the room, kept as long as nothing moves."""
        kept = self._checks.of((self._state(), self._posture(), tuple(self._belief.held.values())), dict)
        whole = key, None if near is None else (near[0].tobytes(), near[1])
        if whole not in kept:
            kept[whole] = bodies().against(np.eye(4), self._room_near(near), ignored)
        return kept[whole]

    def _room_near(self, near: tuple[Array, float] | None) -> Room:
        """Return the bodies that meet a sphere, or all."""
        room = self._room()
        return room if near is None else self._near.of((room, near[0].tobytes(), near[1]), lambda: room.near(*near))

    def _room(self) -> Room:
        """Return all bodies as obstacles."""
        solids = self.solids()
        rooms = (body.name for body in self._world.scene.bodies if body.shape is BodyShape.ROOM)
        return self._obstacles.of(solids, lambda: Room.of(solids, next(rooms, FLOOR)))

    def _bodies_of(self, arm: ArmModel, fingers: Fingers) -> ArmBodies:
        """Return an arm with all that its joints move and may meet of the robot; its own joints may be anywhere."""
        joints = self._world.configuration().joints
        rest = tuple(item for item in joints.items() if item[0] not in arm.joints)
        chain, there = self._chains[arm.name], {name: value for name, value in fingers if joints.get(name) != value}
        kept = self._arm_bodies.setdefault((arm.name, fingers if there else ()), Latest())
        return kept.of((rest, self._in_hands()), lambda: chain.now(self._world, there))

    def _in_hands(self) -> object:
        """Return what the bodies of arms depend on beside joints: with empty hands nothing."""
        held = tuple(self._belief.held.values())
        return (self._state(), held) if held or self._world.attached() else None

    def _own_links(self, arm: ArmModel) -> frozenset[str]:
        """Return links that other joints of an arm than the torso's move."""
        robot = self._world.robot
        moved = (robot.moved_by(name) for name in arm.joints if arm.lift is None or name != arm.lift.joint)
        return frozenset(robot.solid_names[number] for number in frozenset[int]().union(*moved))
