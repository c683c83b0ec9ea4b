"""What an arm's motion has to keep clear of, as spheres and pieces: read once from the planning world per posture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from executive.motion.collision import BASE, FIRST_JOINT, MAP, Mover, Obstacle, QuickCheck, Watched
from executive.motion.hulls import Hull
from executive.motion.kinematics import Chain
from executive.motion.solids import Solids
from executive.motion.spheres import Spheres, kept_spheres
from planlang.protocols import Array, Pose
from sim import Hulled, PyBulletWorld, Solid, hull_of
from sim.contact import SUPPORT_DEPTH

GROUND_SIZE = (60.0, 60.0, 0.1)
"""Of the piece that stands for the floor [m]."""


@dataclass(slots=True, eq=False)
class ArmBodies:
    """Movers and obstacles of the robot itself, with what it holds, for one chain and one posture of the rest."""

    chain: Chain
    movers: list[Mover] = field(default_factory=list)
    own: list[Obstacle] = field(default_factory=list)
    watched: list[Watched] = field(default_factory=list)
    """Of movers and obstacles of the robot itself."""
    hands: frozenset[int] = frozenset()
    """Movers that are links of any hand: people's arms, once they reach for something, do not mind them."""
    grounded: frozenset[int] = frozenset()
    """Movers to which the floor is no obstacle."""
    held: Mapping[int, frozenset[str]] = field(default_factory=dict)
    """Movers that are held objects, and what each has touched since it was grasped."""
    centre: Array = field(default_factory=lambda: np.zeros(3))
    """Middle of what can be reached, in the base frame."""
    reach: float = np.inf
    """No mover is ever farther away from there [m]."""
    whole: bool = True
    """Whether all that moves with the chain is among the movers."""

    def against(self, base: Array, solids: Solids, floor: str, ignored: Ignored) -> QuickCheck:
        """The check against a room, from a base pose (4, 4); hand links ``ignored`` may touch a body."""
        links, touches = ignored
        near = solids.near(base[:3, :3] @ self.centre + base[:3, 3], self.reach)
        obstacles, watched = list(self.own), list(self.watched)
        for body in dict.fromkeys(near.bodies):
            mine = np.array([name == body for name in near.bodies], bool)
            for limb in (False, True):
                pieces = near.only(mine & (near.limbs == limb))
                if not len(pieces):
                    continue
                for number, mover in enumerate(self.movers):
                    if limb and (number in self.hands or number in self.held):
                        continue
                    if mover.name == body or (body == touches and mover.name in links):
                        continue
                    touched = body in self.held.get(number, ())
                    watched.append(Watched(number, len(obstacles), SUPPORT_DEPTH if touched else 0.0))
                obstacles.append(Obstacle(body, MAP, pieces))
        ground = Solid(floor, "box", GROUND_SIZE, Pose((0.0, 0.0, -GROUND_SIZE[2] / 2)), limb=False)
        for number in range(len(self.movers)):
            if number not in self.grounded:
                touched = floor in self.held.get(number, ())
                watched.append(Watched(number, len(obstacles), SUPPORT_DEPTH if touched else 0.0))
        obstacles.append(Obstacle(floor, MAP, Solids.of([ground])))
        return QuickCheck(self.chain, base, self.movers, obstacles, watched, whole=self.whole)


Ignored = tuple[frozenset[str], str | None]
"""Links, and the body that they may touch."""


def arm_bodies(world: PyBulletWorld, chain: Chain, base_link: str) -> ArmBodies:
    """The robot, and what it holds, as it is now; the joints of the chain may be anywhere."""
    robot = world.robot
    now = world.configuration()
    base = world.link_pose(base_link).matrix()
    q = np.array([now.joints[name] for name in chain.names])
    frames = [np.eye(4), base, *(base @ chain.frames(q)[0])]
    carriers = {name: FIRST_JOINT + number for number, name in enumerate(chain.carriers)}
    moved = frozenset[int]().union(*(robot.moved_by(name) for name in chain.names))

    def frame_of(link: str) -> int:
        above = (robot.link_names[index] for index in robot.ancestors(robot.links[link]))
        return next((carriers[name] for name in above if name in carriers), BASE)

    found = ArmBodies(chain)
    every = _Every(found)
    hands = frozenset[int]().union(*(robot.hand_of(link) for link in robot.body.hands))
    of_link: dict[int, _Thing] = {}
    for number, link in enumerate(robot.solid_names):
        frame = frame_of(link)
        if (number in moved) != (frame >= FIRST_JOINT):  # moved by a joint that follows one of the chain
            found.whole = False
            continue
        there = np.linalg.inv(frames[frame]) @ robot.link_pose(link).matrix()
        of_link[number] = every.add(link, frame, robot.hulls(number), there)
    held: dict[str, tuple[_Thing, frozenset[int]]] = {}
    for name, link in world.attached().items():
        frame = frame_of(link)
        there = np.linalg.inv(frames[frame]) @ world.pose(name).matrix()
        shapes = [hull_of(part.kind, _even(part.kind, part.size), offset) for part, offset in world.pieces(name)]
        held[name] = every.add(name, frame, shapes, there), robot.hand_of(link)
    found.hands = frozenset(m for number in hands & of_link.keys() for m in of_link[number].movers)
    found.grounded = frozenset(m for number in robot.grounded & of_link.keys() for m in of_link[number].movers)
    found.held = {m: world.touched_since_grasp(name) for name, (thing, _) in held.items() for m in thing.movers}
    for a, b in robot.self_pairs:
        if a in of_link and b in of_link:
            every.watch(of_link[a], of_link[b])
    for index, (thing, hand) in enumerate(held.values()):
        for number, other in of_link.items():
            if number not in hand:
                every.watch(thing, other)
        for third, _ in list(held.values())[index + 1 :]:
            every.watch(thing, third)
    found.centre, found.reach = _extent(chain, found.movers)
    return found


@dataclass(frozen=True, slots=True)
class _Thing:
    """A link or a held object: its frame, the numbers of its movers and of its obstacle, whether that is exact."""

    frame: int
    movers: tuple[int, ...]
    obstacle: int
    exact: bool


@dataclass(slots=True, eq=False)
class _Every:
    """Collects things."""

    bodies: ArmBodies

    def add(self, name: str, frame: int, shapes: Sequence[Hulled], there: Array) -> _Thing:
        """A thing of some shapes, whose frame is at ``there`` (4, 4) in the frame it moves with."""
        pieces: list[Solid] = []
        slack, exact, movers = 0.0, True, []
        for shape in shapes:
            plain = shape.kind in ("box", "cylinder", "sphere")
            spheres = None if plain and frame < FIRST_JOINT else _filled(shape)
            if spheres is not None and frame >= FIRST_JOINT:
                movers.append(len(self.bodies.movers))
                centres = spheres.centres @ there[:3, :3].T + there[:3, 3]
                rows = np.column_stack([centres, spheres.radii])
                self.bodies.movers.append(Mover(name, frame, rows, spheres.slack))
            if plain:
                pose = Pose.from_matrix(there) @ shape.pose
                pieces.append(Solid(name, shape.kind, shape.size, pose, limb=False))
            elif spheres is not None:
                pieces += _balls(name, spheres, there)
                slack, exact = max(slack, spheres.slack), False
        self.bodies.own.append(Obstacle(name, frame, Solids.of(pieces), slack))
        return _Thing(frame, tuple(movers), len(self.bodies.own) - 1, exact)

    def watch(self, one: _Thing, other: _Thing) -> None:
        """Two things must not touch each other; nothing to do if they never move against each other."""
        if one.frame == other.frame or max(one.frame, other.frame) < FIRST_JOINT:
            return
        # spheres of the one that is farther out, against the other, if that is told exactly
        first, second = (one, other) if one.frame > other.frame else (other, one)
        if first.exact and not second.exact and second.movers:
            first, second = second, first
        self.bodies.watched += [Watched(mover, second.obstacle) for mover in first.movers]


def _balls(name: str, spheres: Spheres, there: Array) -> Iterator[Solid]:
    for centre, radius in zip(spheres.centres, spheres.radii.tolist(), strict=True):
        x, y, z = (there[:3, :3] @ centre + there[:3, 3]).tolist()
        yield Solid(name, "sphere", (2 * radius, 2 * radius, 2 * radius), Pose((x, y, z)), limb=False)


def _filled(shape: Hulled) -> Spheres:
    """The spheres in a shape, in the frame in which its pose is given."""
    spheres = kept_spheres(Hull(shape.points, shape.radius, shape.beyond))
    pose = shape.pose.matrix()
    return Spheres(spheres.centres @ pose[:3, :3].T + pose[:3, 3], spheres.radii, spheres.slack)


def _even(kind: str, size: tuple[float, float, float]) -> tuple[float, float, float]:
    """The extents of a round piece as the world makes it: as wide as its larger side."""
    x, y, z = size
    return size if kind == "box" else (max(x, y), max(x, y), z)


def _extent(chain: Chain, movers: Iterable[Mover]) -> tuple[Array, float]:
    """A place in the base frame, and a distance from it that nothing that moves ever exceeds."""
    ends = np.clip(np.stack([chain.lower, chain.upper]), -np.pi, np.pi)
    origins = chain.frames(ends)[:, :, :3, 3]
    # of a turning joint the distance from the one before is always the same, of a sliding one it is largest at an end
    steps = np.linalg.norm(np.diff(origins, axis=1), axis=2).max(axis=0)
    along = np.concatenate([[np.linalg.norm(origins[1, 0] - origins[0, 0]) / 2], steps]).cumsum()
    reach = 0.0
    for mover in movers:
        far = float((np.linalg.norm(mover.spheres[:, :3], axis=1) + mover.spheres[:, 3]).max())
        reach = max(reach, float(along[mover.frame - FIRST_JOINT]) + far + mover.slack)
    return origins[:, 0].mean(axis=0), reach
