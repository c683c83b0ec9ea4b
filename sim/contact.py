"""Contact queries: the robot and what it holds against bodies, and the robot against itself.

Boxes around links and pieces are compared first, in NumPy; PyBullet computes exact distances for the remaining pairs. A
query with Amigo in a furnished room takes about 0.1 ms.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import combinations
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.shapes import overlaps
from planlang.protocols import Configuration, Contact, Touch
from planlang.records import dataclass
from sim.bodies import Bodies
from sim.engine import bullet
from sim.leaves import LeafGrasp, Leaves
from sim.robot import Robot

TOLERANCE = 0.0005
"""Penetration up to which two things touch without being in contact [m]."""

_SAMPLES = 120
"""Random postures in which pairs of links are tested: enough to recognise pairs that always touch."""
_ALWAYS = 0.95
"""Share of the postures above which a pair overlaps by design, such as covers around a joint."""
_MOSTLY = 0.5
"""Share of the postures above which near links touch because their shapes are coarse."""
_NEAR = 3
"""Most moving joints between near links."""
_COINCIDENT = 0.03
"""Distance within which frames of several joints form one joint, such as a shoulder [m]."""
_pairs_of: dict[str, tuple[tuple[int, int], ...]] = {}

SUPPORT_DEPTH = 0.02
"""Penetration allowed between a held object and what it touched when it was grasped [m]."""

PARTED = 0.003
"""Distance beyond which a held object has parted from what it touched [m]."""

SKIN = 0.01
"""Distance up to which a link feels a body [m]: soft skin, or the gap left by the last step."""

OPPOSITE = -0.5
"""Largest cosine between the normals of opposite sides."""

FOLD = 0.05
"""Distance between two fingers on something soft up to which they have a fold of it between them [m]."""

GROUND = 0.001
"""Greatest height of a piece that counts as floor [m]."""

GivesWay = Callable[[str], bool]
"""Whether a body is a substance that gives way to what is pushed into it."""
Ignored = Collection[str | tuple[str, str]]


@dataclass(slots=True)
class HeldObject:
    """Object in one or several hands, or standing on an object that is."""

    link: str
    offset: Pose
    """Pose of the object in the link's frame."""
    hand: frozenset[int]
    """Numbers of the hand's links, which may touch the object."""
    touched: set[str] = field(default_factory=set)
    """Bodies in touch with it without interruption since it was grasped."""
    placed: int | None = None
    """Value of the robot's ``moves`` when it was last placed; None if it has to be placed again."""
    others: dict[str, Pose] = field(default_factory=dict)
    """Links of further hands that hold it, with the object's pose in their frames."""
    needs: int = 1
    """Number of hands that it takes to move it."""
    on: str | None = None
    """The held object on which it stands; None if hands hold it."""

    @property
    def links(self) -> dict[str, Pose]:
        """Links that hold it, with the object's pose in their frames."""
        return {self.link: self.offset, **self.others}

    @property
    def moves(self) -> bool:
        """Whether it moves with the first link: enough hands hold it."""
        return len(self.links) >= self.needs


@dataclass(frozen=True, slots=True)
class Query:
    """Contact query; ``links`` are numbers of solid links (all if None)."""

    links: frozenset[int] | None = None
    apart: NDArray[np.bool_] | None = None
    """Pairs of solid links to test against each other (n, n): those that move relative to each other (all if None)."""
    ignore: Ignored = ()
    grip: bool = False
    """True to include contacts of a hand with what it holds (while its fingers close)."""
    itself: bool = True
    """True to look for self-collision; a motion of the base alone causes none."""
    others: bool = True
    """True to look for collisions with bodies that are not held."""
    among: Collection[tuple[str, str]] | None = None
    """Candidate pairs (link or held body, link or body), if it is known that no others can touch."""

    def ignores(self, part: str, body: str) -> bool:
        """Check whether two things may touch."""
        return bool(self.ignore) and not {part, body, (part, body), (body, part)}.isdisjoint(self.ignore)


class Contacts:
    """Finds penetrations at the configuration shown last; held objects must have been moved along."""

    def __init__(
        self, robot: Robot, bodies: Bodies, held: dict[str, HeldObject], leaves: Leaves, gives_way: GivesWay
    ) -> None:
        self.robot, self.bodies, self.held, self.leaves, self.gives_way = robot, bodies, held, leaves, gives_way
        self.self_pairs = watched_pairs(robot)
        """Pairs of solid links, by number, that must not touch."""
        self.watched = np.zeros((len(robot.solid), len(robot.solid)), bool)
        for pair in self.self_pairs:
            self.watched[pair] = True
        hands = [robot.hand_of(link) for link in robot.body.hands]
        self.hands = frozenset().union(*hands)
        self.fingers = frozenset(robot.whole(link) for links in robot.body.hands.values() for link in links)

    def find(self, query: Query) -> tuple[Contact, ...]:
        """Find all contacts: of links, in the order of the URDF, then of held objects in the order of grasping."""
        depths: dict[tuple[str, str], float] = {}
        if query.among is not None:
            for part, body in query.among:
                self._of_pair(part, body, query, depths)
            return tuple(Contact(part, body, depth) for (part, body), depth in depths.items())
        lower, upper = self.robot.boxes()
        if query.others:
            self._of_links(query, lower, upper, depths)
        if query.itself:
            self._of_the_robot_itself(query, lower, upper, depths)
        for name, held in self.held.items():
            if query.others and (query.links is None or self.carriers(held) & query.links):
                self._of_held(name, query, depths)
            if query.itself:
                self._of_held_and_robot(name, query, lower, upper, depths)
        for leaf, led in self.leaves.led.items():
            if query.others and (query.links is None or self.robot.carrier(led.link) & query.links):
                self._of_led(leaf, led, query, lower, upper, depths)
        return tuple(Contact(part, body, depth) for (part, body), depth in depths.items())

    def carriers(self, held: HeldObject) -> frozenset[int]:
        """List the numbers of the links with which a held object moves."""
        return frozenset().union(*map(self.robot.carrier, held.links))

    def _of_pair(self, part: str, body: str, query: Query, depths: dict[tuple[str, str], float]) -> None:
        """Test one pair; support contacts of a held object count only beyond :data:`SUPPORT_DEPTH`."""
        if query.ignores(part, body):
            return
        if part not in self.held and body in self.held:
            part, body = body, part
        number, other = self.robot.number.get(part), self.robot.number.get(body)
        if number is not None and other is not None:
            _deepen(depths, part, body, self.robot.depth_between(number, other))
            return
        for index in () if other is not None else self.bodies.of[body]:
            if number is None:
                self._of_held_and_piece(part, self.bodies.of[part], index, depths)
            elif not self._lets_in(index, number):
                _deepen(depths, part, body, self.robot.depth_with(number, self.bodies.uid(index)))
        if number is None and other is not None:
            link_depths = (self.robot.depth_with(other, self.bodies.uid(mine)) for mine in self.bodies.of[part])
            _deepen(depths, part, body, max(link_depths, default=0.0))

    def _lets_in(self, index: int, number: int) -> bool:
        """Check whether a link may touch a piece: a hand a limb, or the handle that it holds."""
        piece = self.bodies.pieces[index]
        is_taken = bool(self.leaves.led) and number in self.leaves.hands_on(piece.body)
        return is_taken or (piece.yields and number in self.hands)

    def _of_held_and_piece(
        self, name: str, mine: Sequence[int], index: int, depths: dict[tuple[str, str], float]
    ) -> None:
        """Test pieces of a held object against one of another body; a blade may go under it, all into a puddle."""
        piece = self.bodies.pieces[index]
        if piece.yields or self.bodies.lets_touch(name, piece.body) or self.gives_way(piece.body):
            return
        depth = -self.bodies.gap(mine, [index], 0.0)
        if piece.body not in self.held[name].touched or depth > SUPPORT_DEPTH:
            _deepen(depths, name, piece.body, depth)

    def _of_links(self, query: Query, lower: Array, upper: Array, depths: dict[tuple[str, str], float]) -> None:
        for number, index in zip(*self.bodies.near(lower, upper), strict=True):
            piece = self.bodies.pieces[index]
            part = self.robot.solid_names[number]
            if query.links is not None and number not in query.links:
                continue
            if query.ignores(part, piece.body):
                continue
            if self._lets_in(index, number):
                continue
            if number in self.robot.grounded and self.bodies.upper[index, 2] < GROUND:
                continue
            if piece.body in self.held and not query.grip and number in self.held[piece.body].hand:
                continue
            if piece.body in self.held and number not in self.held[piece.body].hand:
                continue  # reported as a contact of the held object
            _deepen(depths, part, piece.body, self.robot.depth_with(number, self.bodies.uid(index)))

    def _of_the_robot_itself(
        self, query: Query, lower: Array, upper: Array, depths: dict[tuple[str, str], float]
    ) -> None:
        near = self.watched if query.apart is None else self.watched & query.apart
        near = near & overlaps(lower, upper, lower, upper)
        for a, b in zip(*(axis.tolist() for axis in np.nonzero(near)), strict=True):
            first, second = self.robot.solid_names[a], self.robot.solid_names[b]
            if not query.ignores(first, second):
                _deepen(depths, first, second, self.robot.depth_between(a, b))

    def _of_held(self, name: str, query: Query, depths: dict[tuple[str, str], float]) -> None:
        for mine in self.bodies.of[name]:
            for index in self.bodies.within(self.bodies.lower[mine], self.bodies.upper[mine]).tolist():
                body = self.bodies.pieces[index].body
                if body != name and not query.ignores(name, body):
                    self._of_held_and_piece(name, [mine], index, depths)

    def _of_led(
        self, leaf: str, led: LeafGrasp, query: Query, lower: Array, upper: Array, depths: dict[tuple[str, str], float]
    ) -> None:
        """Test a leaf that a hand moves against other bodies, and against the robot without that hand."""
        for name in (*self.leaves.joints[leaf].bodies, *led.carried):
            for mine in self.bodies.of[name]:
                low, high = self.bodies.lower[mine], self.bodies.upper[mine]
                for index in self.bodies.within(low, high).tolist():
                    other = self.bodies.pieces[index].body
                    mate = other == name or other in led.touched or other in led.carried or other in self.held
                    if not mate and not query.ignores(name, other):
                        _deepen(depths, name, other, -self.bodies.gap([mine], [index], 0.0))
                overlap = np.all((lower <= high) & (upper >= low), axis=1)
                for number in np.nonzero(overlap)[0].tolist():
                    if number not in led.hand and not query.ignores(self.robot.solid_names[number], name):
                        _deepen(
                            depths,
                            self.robot.solid_names[number],
                            name,
                            self.robot.depth_with(number, self.bodies.uid(mine)),
                        )

    def _of_held_and_robot(
        self, name: str, query: Query, lower: Array, upper: Array, depths: dict[tuple[str, str], float]
    ) -> None:
        held = self.held[name]
        every = query.links is None or bool(self.carriers(held) & query.links)
        for mine in self.bodies.of[name]:
            overlap = np.all((lower <= self.bodies.upper[mine]) & (upper >= self.bodies.lower[mine]), axis=1)
            for number in np.nonzero(overlap)[0].tolist():
                link = self.robot.solid_names[number]
                if number in held.hand or not (every or (query.links and number in query.links)):
                    continue
                if query.ignores(name, link):
                    continue
                _deepen(depths, name, link, self.robot.depth_with(number, self.bodies.uid(mine)))

    def touching(self, name: str, within: float) -> set[str]:
        """Find the bodies within a distance [m] of a body, not counting the robot."""
        mine = self.bodies.of[name]
        lower, upper = self.bodies.box_of(name)
        return {
            self.bodies.pieces[index].body
            for index in self.bodies.within(lower - within, upper + within).tolist()
            if index not in mine and self.bodies.gap(mine, [index], within) <= within
        }

    def part(self) -> None:
        """Drop bodies from which held objects have parted from their ``touched`` sets."""
        for name, held in self.held.items():
            held.touched = self.still_touched(name)

    def still_touched(self, name: str) -> set[str]:
        """Find the bodies from which a held object has not parted since it was grasped."""
        touched = self.held[name].touched
        return touched & self.touching(name, PARTED) if touched else set()

    def touches(self, links: Collection[str]) -> tuple[Touch, ...]:
        """List where links are touched: the nearest point of each piece within :data:`SKIN` of a link.

        The floor of a dish and each segment of its rim count separately: a finger between two feels both.
        """
        return tuple(touch for _, touch in self._touches(links))

    def between(self, link: str) -> tuple[str, ...]:
        """Find the body that two fingers of the hand at a link touch from opposite sides, if any.

        If they touch two different bodies, pressed against each other, both are returned; one body takes precedence.
        """
        fingers = [name for name in self.robot.hand_links(link) if name in self.fingers]
        pairs = [
            (one != other, float(np.dot(here.normal, there.normal)), one, other)
            for (one, here), (other, there) in combinations(self._touches(fingers), 2)
            if here.link != there.link
        ]
        opposed = min((pair for pair in pairs if pair[1] < OPPOSITE), default=None)
        return () if opposed is None else tuple(dict.fromkeys(opposed[2:]))

    def _touches(self, links: Collection[str]) -> list[tuple[str, Touch]]:
        """List the touches of links, each with the touching body."""
        numbers = sorted(self.robot.number[link] for link in links if link in self.robot.number)
        lower, upper = self.robot.boxes_of(numbers)
        candidates = [
            (self.bodies.pieces[index].body, self._touch(numbers[row], [index], SKIN))
            for row, index in zip(*self.bodies.near(lower - SKIN, upper + SKIN), strict=True)
        ]
        felt = [(name, touch) for name, touch in candidates if touch is not None]
        return [*felt, *self._folds(felt)]

    def _folds(self, felt: list[tuple[str, Touch]]) -> Iterator[tuple[str, Touch]]:
        """Yield opposite touches for two links close together on something soft: its fold between them."""
        soft = [(name, touch) for name, touch in felt if self.bodies.bodies[name].soft]
        for (name, one), (other, two) in combinations(soft, 2):
            offset = np.subtract(one.point, two.point)
            distance = float(np.linalg.norm(offset))
            if name == other and one.link != two.link and 0 < distance <= FOLD:
                x, y, z = (offset / distance).tolist()
                yield name, Touch(one.link, one.point, (x, y, z))
                yield name, Touch(two.link, two.point, (-x, -y, -z))

    def felt(self, contact: Contact) -> Touch | None:
        """Locate the touch of a link or held object by a body; None for self-contacts."""
        if contact.body not in self.bodies.of:
            return None
        if contact.part in self.robot.number:
            return self._touch(self.robot.number[contact.part], self.bodies.of[contact.body], 0.0)
        uids = [self.bodies.uid(index) for index in self.bodies.of[contact.part]]
        held = self.held.get(contact.part)
        link = self.leaves.leader(contact.part) if held is None else held.link
        return (
            None
            if link is None
            else self._nearest(link, [(uid, -1) for uid in uids], self.bodies.of[contact.body], 0.0)
        )

    def _touch(self, number: int, pieces: Sequence[int], reach: float) -> Touch | None:
        """Locate the point of some pieces nearest to a link, within ``reach`` [m]."""
        here = [(self.robot.uid, self.robot.solid[number])]
        return self._nearest(self.robot.solid_names[number], here, pieces, reach)

    def _nearest(
        self, link: str, mine: Collection[tuple[int, int]], pieces: Sequence[int], reach: float
    ) -> Touch | None:
        """Locate the same for shapes given by id and link number of the client, as a touch of ``link``."""
        points = [
            point
            for uid, part in mine
            for index in pieces
            for point in bullet.getClosestPoints(
                uid, self.bodies.uid(index), reach, part, -1, physicsClientId=self.robot.client
            )
        ]
        nearest = min(points, key=lambda point: float(point[8]), default=None)
        return None if nearest is None else Touch(link, nearest[6], nearest[7])


def _deepen(depths: dict[tuple[str, str], float], part: str, body: str, depth: float) -> None:
    if depth > TOLERANCE and depth > depths.get((part, body), 0.0):
        depths[part, body] = depth


def watched_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
    """List pairs of solid links that must not touch, computed once per URDF and robot body.

    Excluded are pairs that are allowed to touch, are rigidly connected, share one joint, or touch nearly always, and
    pairs that touch in the initial posture: there the model is wrong, not the robot.
    """
    body = robot.body
    allowed = sorted(tuple(sorted(pair)) for pair in body.allowed)
    moving = None if body.moving is None else sorted(body.moving)
    text = robot.description.text + repr((allowed, moving, sorted(robot.shown.items())))
    key = hashlib.sha256(text.encode()).hexdigest()
    if key not in _pairs_of:
        _pairs_of[key] = _find_pairs(robot)
    return _pairs_of[key]


def _find_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
    allowed = {frozenset(map(robot.whole, pair)) for pair in robot.body.allowed}
    names = robot.solid_names
    pairs = [
        (a, b)
        for a in range(len(names))
        for b in range(a + 1, len(names))
        if frozenset((names[a], names[b])) not in allowed and not _adjacent(robot, robot.solid[a], robot.solid[b])
    ]
    if robot.body.posture:
        touching = {pair for pair in robot.near_pairs(pairs) if robot.depth_between(*pair) > TOLERANCE}
        pairs = [pair for pair in pairs if pair not in touching]
    always = _often(robot, pairs, _ALWAYS)
    return tuple(pair for pair in pairs if pair not in always)


def coarse_pairs(robot: Robot, slides: Iterable[str]) -> list[tuple[str, str]]:
    """List links near each other that touch in most postures, or in most of those with one of ``slides`` at its end.

    Their shapes are coarser than the links, such as hulls around the parts of a wrist or of a head above a lift: as the
    model states them, the robot could hardly move. Links that meet only when it folds are not among them.
    """
    near = [pair for pair in watched_pairs(robot) if _motors_between(robot, *pair) <= _NEAR]
    found = dict.fromkeys(_often(robot, near, _MOSTLY))
    for slide in slides:
        apart = robot.moved_apart(frozenset({slide}))
        for end in robot.limits[slide]:
            others = [pair for pair in near if apart[pair] and pair not in found]
            found |= dict.fromkeys(_often(robot, others, _MOSTLY, {slide: end}))
    return [(robot.solid_names[a], robot.solid_names[b]) for a, b in found]


def _often(
    robot: Robot, pairs: Sequence[tuple[int, int]], share: float, still: Mapping[str, float] = MappingProxyType({})
) -> list[tuple[int, int]]:
    """Select the pairs of solid links that touch in this share of random postures, with some joints ``still``."""
    spans = {
        name: (max(low, -np.pi), min(high, np.pi))
        for name, (low, high) in robot.limits.items()
        if robot.joints[name] not in robot.fixed
    }
    lower, upper = np.array([*spans.values()]).reshape(-1, 2).T
    touched = dict.fromkeys(pairs, _SAMPLES)
    often = list(pairs)
    with _configuration_kept(robot):
        for values in np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, len(spans))).tolist():
            if not often:  # further postures cannot change the result
                break
            robot.show(Configuration(robot.base, dict(zip(spans, values, strict=True)) | dict(still)))
            touching = {pair for pair in robot.near_pairs(often) if robot.depth_between(*pair) > TOLERANCE}
            for pair in often:
                touched[pair] -= pair not in touching
            often = [pair for pair in often if touched[pair] >= share * _SAMPLES]
    return often


def _motors_between(robot: Robot, a: int, b: int) -> int:
    """Count the joints that move two solid links apart; those that follow one another count once, as in a telescope."""
    above = (set(robot.ancestors(robot.solid[number])) for number in (a, b))
    masters = {index: robot.joints[name] for name, several in robot.followers.items() for index, _ in several}
    return len({masters.get(index, index) for index in next(above).symmetric_difference(next(above)) - robot.fixed})


@contextlib.contextmanager
def _configuration_kept(robot: Robot) -> Iterator[None]:
    before = robot.configuration()
    yield
    robot.show(before)


def _adjacent(robot: Robot, a: int, b: int) -> bool:
    """Check whether at most one joint separates two links; several joints in one place (a shoulder) count as one."""
    up_a, up_b = robot.ancestors(a), robot.ancestors(b)
    between = [i for i in up_a if i not in up_b] + [i for i in up_b if i not in up_a]
    moving = [index for index in between if index not in robot.fixed]
    if len(moving) <= 1:
        return True
    if a not in up_b and b not in up_a:
        return False
    frames = np.array([bullet.getLinkState(robot.uid, i, physicsClientId=robot.client)[4] for i in moving], dtype=float)
    return bool(np.all(np.linalg.norm(frames - frames[0], axis=1) < _COINCIDENT))
