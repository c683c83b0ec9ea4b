"""Collision bodies for arm motions: links, held objects, and the bodies of a room.

What does not depend on the posture is computed once per chain (:class:`ArmShapes`), the rest once per posture
(:class:`ArmBodies`); :meth:`ArmBodies.against` combines it with a :class:`Room`. The same bodies serve arm path
planning and, as they are or held still in a posture, the search for base poses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from executive.motion.bodies import BASE, FIRST_JOINT, MAP, Bodies, Pairs, Solids, counts, kept_spheres
from executive.motion.collision import QuickCheck
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved, product
from planlang.geometry.shapes import ConvexSolid, SolidKind, convex_solid
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim import PlanningWorld, Solid
from sim.contact import SUPPORT_DEPTH

if TYPE_CHECKING:  # a plain run moves one arm at a time
    from executive.motion.arm_group import Movable

GROUND_SIZE = (60.0, 60.0, 0.1)
"""Size of the box that represents the floor [m]."""
AT_ORIGIN = (0.0, 0.0, 0.0)
"""Base pose at the origin."""

Ignored = tuple[frozenset[str], frozenset[str]]
"""Hand links, and the bodies that they may touch."""
Row = tuple[str, int, Solids, float, tuple[ConvexSolid, ...]]
"""Row of :class:`Bodies`: name, frame, pieces, slack and real shapes."""
_PLAIN = (SolidKind.BOX, SolidKind.CYLINDER, SolidKind.SPHERE)
"""Shapes that pieces can represent exactly."""


@dataclass(frozen=True, eq=False)
class Shaped:
    """Link or thing that consists of convex shapes."""

    name: str
    shapes: Sequence[ConvexSolid]

    @cached_property
    def _filled(self) -> tuple[tuple[Solids, float], ...]:
        """For each shape, the spheres inside it and how far it protrudes from them [m]."""
        filled = []
        for shape in self.shapes:
            points = np.ascontiguousarray(shape.points, float)
            spheres = kept_spheres(points.tobytes(), shape.radius, shape.beyond)
            centres = moved(shape.pose.matrix(), spheres.balls[:, :3])
            balls = np.column_stack([centres, spheres.balls[:, 3]])
            filled.append((Solids.spheres(self.name, balls), spheres.slack))
        return tuple(filled)

    def movers(self, frame: int) -> list[Row]:
        """Represent each shape by spheres that move with a frame."""
        filled = zip(self.shapes, self._filled, strict=True)
        return [(self.name, frame, spheres, slack, (shape,)) for shape, (spheres, slack) in filled]

    def obstacle(self, frame: int) -> Row:
        """Represent it as one obstacle: exact pieces if possible, else spheres."""
        if self.exact:
            plain = [Solid(self.name, shape.kind, shape.size, shape.pose, limb=False) for shape in self.shapes]
            return self.name, frame, Solids.of(plain), 0.0, ()
        solids, slacks = zip(*self._filled, strict=True)
        return self.name, frame, Solids.joined(solids), max(slacks), tuple(self.shapes)

    @property
    def exact(self) -> bool:
        """Whether its pieces as an obstacle represent it exactly."""
        return all(shape.kind in _PLAIN for shape in self.shapes)


def links_of(world: PlanningWorld) -> tuple[Shaped, ...]:
    """List the solid links of a world's robot, in their order."""
    robot = world.robot
    return tuple(Shaped(name, robot.hulls(number)) for number, name in enumerate(robot.solid_names))


def thing_in(world: PlanningWorld, name: str) -> Shaped:
    """Get a body of a world; round pieces are as wide as their larger side, as in the world itself."""
    shapes = []
    for part, at in world.pieces(name):
        x, y, z = part.size
        size = part.size if part.kind == SolidKind.BOX else (max(x, y), max(x, y), z)
        shapes.append(convex_solid(part.kind, size, at))
    return Shaped(name, shapes)


@dataclass(frozen=True, slots=True, eq=False)
class ArmBodies:
    """Movers and obstacles on the robot itself, held objects included, for one chain and one posture of the rest."""

    chain: Movable
    movers: Bodies
    own: Bodies
    watched: Pairs
    """Pairs of movers and of obstacles on the robot itself."""
    hands: NDArray[np.bool_]
    """Mask of movers that are links of any hand (m,): they may touch people's arms that reach for something."""
    grounded: NDArray[np.bool_]
    """Mask of movers that may touch the floor (m,)."""
    held: Mapping[str, frozenset[str]]
    """Movers that are held objects -> what each has touched since it was grasped."""
    centre: Array
    """Centre of the reachable space, in the base frame (3,)."""
    reach: float
    """Radius around it that no mover ever leaves [m]."""
    tip: tuple[Array, int]
    """Pose (4, 4) of the tip in the frame that carries it, and the number of that frame."""
    whole: bool
    """True if everything that moves with the chain is among the movers."""

    def against(self, base: Array, room: Room, ignored: Ignored) -> QuickCheck:
        """Build the check against a room, from a base pose (4, 4); ``ignored`` hand links may touch its bodies."""
        bodies = room.bodies
        own = replace(self.watched, obstacles=self.watched.obstacles + len(bodies))
        watched = self._watched(room, ignored).followed_by(own)
        obstacles = Bodies.joined([bodies, self.own])
        return QuickCheck(self.chain, base, self.movers, obstacles, watched, tip=self.tip, whole=self.whole)

    def _watched(self, room: Room, ignored: Ignored) -> Pairs:
        """List the pairs of movers and bodies of a room that may not touch, with their allowed depths."""
        mover_names, (links, touches) = self.movers.names, ignored
        held = [k for k, name in enumerate(mover_names) if name in self.held]
        spared = self.hands.copy()
        spared[held] = True
        watched = ~np.outer(spared, room.limbs)
        allowed = np.zeros(watched.shape)
        for k in held:
            touched = self.held[mover_names[k]]
            allowed[k, [body in touched for body in room.bodies.names]] = SUPPORT_DEPTH
        if touches:
            hand = np.array([name in links for name in mover_names], bool)
            touched_ones = np.array([body in touches for body in room.bodies.names], bool)
            watched[np.outer(hand, touched_ones)] = False
        watched[self.grounded, -1] = False
        movers, obstacles = np.nonzero(watched)
        return Pairs(movers, obstacles, allowed[movers, obstacles])


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Bodies of a room as obstacles, the floor last."""

    bodies: Bodies
    limbs: NDArray[np.bool_]
    """Mask of obstacles that are people's arms (o,)."""

    @staticmethod
    def of(solids: Solids, floor: str) -> Room:
        """Build a room from the pieces of bodies and the name of the floor."""
        each = list(zip(solids.bodies, solids.limbs.tolist(), strict=True))
        keys = list(dict.fromkeys(each))
        number = {key: k for k, key in enumerate(keys)}
        of_piece = np.array([number[key] for key in each], np.intp)
        ground = Solid(floor, SolidKind.BOX, GROUND_SIZE, Pose((0.0, 0.0, -GROUND_SIZE[2] / 2)), limb=False)
        sizes, count = np.bincount(of_piece, minlength=len(keys)), len(keys) + 1
        bodies = Bodies(
            (*(body for body, _ in keys), floor),
            np.full(count, MAP, np.intp),
            np.cumsum([0, *sizes.tolist(), 1]).astype(np.intp),
            Solids.joined([solids.only(np.argsort(of_piece, kind="stable")), Solids.of([ground])]),
            np.zeros(count),
            ((),) * count,
            np.tile(np.eye(4), (count, 1, 1)),
        )
        return Room(bodies, np.array([*(limb for _, limb in keys), False], bool))

    def without(self, names: Sequence[str]) -> Room:
        """Remove some bodies."""
        kept = np.array([name not in names for name in self.bodies.names], bool)
        return Room(self.bodies.only(kept), self.limbs[kept])

    def near(self, centre: Array, radius: float) -> Room:
        """Select the bodies with a piece that meets a sphere, and the floor."""
        solids, first = self.bodies.solids, self.bodies.first
        met = np.linalg.norm(solids.centres - centre, axis=1) <= radius + solids.reach
        kept = np.add.reduceat(met, first[:-1]) > 0
        kept[-1] = True
        return Room(self.bodies.only(kept), self.limbs[kept])


class ArmShapes:
    """Shapes of one chain: which of its moving joints carries each solid link, and which pairs must not touch."""

    def __init__(
        self, world: PlanningWorld, links: Sequence[Shaped], chain: Movable, base_link: str, tip_link: str
    ) -> None:
        """Assign ``links``, all solid links in their order, to the chain's joints."""
        robot = world.robot
        self._chain, self._base_link, self._links = chain, base_link, links
        self._carriers = {name: FIRST_JOINT + number for number, name in enumerate(chain.carriers)}
        carried = frozenset[int]().union(*(robot.moved_by(name) for name in chain.names))
        every = [self.frame_of(world, link) for link in robot.solid_names]
        # excluded: links that a mimic joint moves, whose motion no frame of the chain describes
        numbers = [k for k, frame in enumerate(every) if (k in carried) == (frame >= FIRST_JOINT)]
        self._whole = len(numbers) == len(every)
        self._frames = np.array(every, np.intp)
        moving = [number for number in numbers if every[number] >= FIRST_JOINT]
        rows = [(number, row) for number in moving for row in links[number].movers(every[number])]
        self._movers = Bodies.of([row for _, row in rows])
        self._of_mover = np.array([number for number, _ in rows], np.intp)
        self._own = Bodies.of([links[number].obstacle(every[number]) for number in numbers])
        self._of_own = np.array(numbers, np.intp)
        self._obstacle_of = {number: k for k, number in enumerate(numbers)}
        hands = frozenset[int]().union(*(robot.hand_of(link) for link in robot.body.hands))
        self._hands = np.isin(self._of_mover, sorted(hands))
        self._grounded = np.isin(self._of_mover, sorted(robot.grounded))
        parts = {number: self._part(number) for number in numbers}
        self._watched = Pairs.of(
            [pair for a, b in world.self_pairs if a in parts and b in parts for pair in self._pairs(parts[a], parts[b])]
        )
        self._centre, self._along = _extent(chain)
        q = (np.clip(chain.lower, -np.pi, np.pi) + np.clip(chain.upper, -np.pi, np.pi)) / 2
        frames, poses = chain.frames(q[None])[0], chain.fk(q[None])[0]
        last = self.frame_of(world, tip_link)
        self.tip: tuple[Array, int] = product(inverse(frames[last - FIRST_JOINT]), poses), last
        """Pose (4, 4) of the tip in the frame that carries it, and the number of that frame."""

    def frame_of(self, world: PlanningWorld, link: str) -> int:
        """Find the number of the frame that carries a link."""
        robot = world.robot
        above = (robot.link_names[index] for index in robot.ancestors(robot.links[link]))
        return next((self._carriers[name] for name in above if name in self._carriers), BASE)

    def now(self, world: PlanningWorld, joints: Mapping[str, float] | None = None) -> ArmBodies:
        """Get the robot and what it holds, in its present posture but for ``joints``; the chain may move."""
        robot = world.robot
        there, from_base, placed = self._placed(world, joints)
        q = np.array([there.joints[name] for name in self._chain.names])
        whole = np.tile(np.eye(4), (len(self._carriers) + FIRST_JOINT, 1, 1))
        whole[FIRST_JOINT:, :3] = self._chain.frames(q)[0][:, :3]
        back = inverse(whole)
        local = product(back[self._frames], placed)
        movers, own = self._movers.moved(local[self._of_mover]), self._own.moved(local[self._of_own])
        hands, grounded, watched, held = self._hands, self._grounded, self._watched, {}
        before: list[_Part] = []
        for name, (link, offset) in _held(world).items():
            frame = self.frame_of(world, link)
            at = product(back[frame], from_base, world.link_pose(link, there).matrix(), offset)
            thing = thing_in(world, name)
            more = Bodies.of(thing.movers(frame) if frame > BASE else [])
            part = _Part(frame, tuple(range(len(movers), len(movers) + len(more))), len(own), thing.exact)
            hand = robot.hand_of(link)
            others = [self._part(number) for number in self._obstacle_of if number not in hand]
            pairs = [pair for other in (*others, *before) for pair in self._pairs(part, other)]
            watched = watched.followed_by(Pairs.of(pairs))
            movers = Bodies.joined([movers, more.moved(np.tile(at, (len(more), 1, 1)))])
            own = Bodies.joined([own, Bodies.of([thing.obstacle(frame)]).moved(at[None])])
            hands, grounded = (np.append(mask, np.zeros(len(more), bool)) for mask in (hands, grounded))
            held[name] = world.touched_since_grasp(name)
            before.append(part)
        reach = _reach(movers, self._along)
        return ArmBodies(
            self._chain, movers, own, watched, hands, grounded, held, self._centre, reach, self.tip, whole=self._whole
        )

    @staticmethod
    def still(
        world: PlanningWorld, several: Sequence[ArmShapes], joints: Mapping[str, float] | None = None
    ) -> ArmBodies:
        """Freeze all that moves with one or more chains of a robot, in its present posture but for ``joints``.

        It moves with the base. It is checked against other bodies but not against the robot, so the result is never
        conclusive.
        """
        first = several[0]
        there, from_base, placed = first._placed(world, joints)
        movers, hands, grounded, held, known = list[Bodies](), [], [], {}, set[int]()
        for shapes in several:
            fresh = ~np.isin(shapes._of_mover, sorted(known))
            known.update(shapes._of_mover.tolist())
            hands.append(shapes._hands[fresh])
            grounded.append(shapes._grounded[fresh])
            movers.append(shapes._movers.only(fresh).moved(placed[shapes._of_mover[fresh]]))
        for name, (link, offset) in _held(world).items():
            if all(shapes.frame_of(world, link) == BASE for shapes in several):
                continue
            at = product(from_base, world.link_pose(link, there).matrix(), offset)
            more = Bodies.of(thing_in(world, name).movers(BASE))
            movers.append(more.moved(np.tile(at, (len(more), 1, 1))))
            for mask in (hands, grounded):
                mask.append(np.zeros(len(more), bool))
            held[name] = world.touched_since_grasp(name)
        every = Bodies.joined(movers)
        return ArmBodies(
            first._chain,
            replace(every, frames=np.full(len(every), BASE, np.intp)),
            Bodies.of(()),
            Pairs.of(()),
            np.concatenate(hands),
            np.concatenate(grounded),
            held,
            np.zeros(3),
            np.inf,
            first.tip,
            whole=False,
        )

    def _placed(self, world: PlanningWorld, joints: Mapping[str, float] | None) -> tuple[Configuration, Array, Array]:
        """Get the configuration but for ``joints``, the map (4, 4) and the links (n, 4, 4) in the base frame."""
        there = Configuration(AT_ORIGIN, {**world.configuration().joints, **(joints or {})})
        from_base = inverse(world.link_pose(self._base_link, there).matrix())
        return there, from_base, product(from_base, world.solid_frames(there))

    def _part(self, number: int) -> _Part:
        """Describe a solid link that a known frame carries."""
        movers = tuple(np.flatnonzero(self._of_mover == number).tolist())
        return _Part(int(self._frames[number]), movers, self._obstacle_of[number], self._links[number].exact)

    @staticmethod
    def _pairs(one: _Part, other: _Part) -> list[tuple[int, int]]:
        """List the pairs of movers and obstacle that decide whether two parts touch; empty without relative motion."""
        if one.frame == other.frame or max(one.frame, other.frame) < FIRST_JOINT:
            return []
        # spheres of the outer part against the inner one, unless only the outer one is represented exactly
        first, second = (one, other) if one.frame > other.frame else (other, one)
        if first.exact and not second.exact and second.movers:
            first, second = second, first
        return [(mover, second.obstacle) for mover in first.movers]


@dataclass(frozen=True, slots=True)
class _Part:
    """Link or held object: its frame, the numbers of its movers and of its obstacle, and whether that is exact."""

    frame: int
    movers: tuple[int, ...]
    obstacle: int
    exact: bool


def _held(world: PlanningWorld) -> dict[str, tuple[str, Array]]:
    """Map held objects to the link that holds each, and its pose (4, 4) there."""
    return {
        name: (link, (world.link_pose(link).inverse() @ world.pose(name)).matrix())
        for name, link in world.attached().items()
    }


def _extent(chain: Movable) -> tuple[Array, Array]:
    """Find a point in the base frame, and the greatest distance of each moving joint's frame from it (j,)."""
    ends = np.clip(np.stack([chain.lower, chain.upper]), -np.pi, np.pi)
    origins = chain.frames(ends)[:, :, :3, 3]
    # the distance to the joint before is constant for a turning joint, and largest at a limit for a sliding one
    steps = np.linalg.norm(np.diff(origins, axis=1), axis=2).max(axis=0)
    along = np.concatenate([[np.linalg.norm(origins[1, 0] - origins[0, 0]) / 2], steps]).cumsum()
    return origins[:, 0].mean(axis=0), along


def _reach(movers: Bodies, along: Array) -> float:
    """Bound the distance of anything that moves from that point [m]."""
    far = np.linalg.norm(movers.solids.centres, axis=1) + movers.solids.reach
    of_sphere = np.repeat(along[movers.frames - FIRST_JOINT] + movers.slack, counts(movers.first))
    return float((far + of_sphere).max(initial=0.0))
