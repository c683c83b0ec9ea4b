"""Candidates: the single changes after which a failed run may reach its goal, cheapest first.

docs/guides/why.md lists them. Where several are equally small, those of things that the failure names come first.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

from executive.maps.single_changes import leaf_moved, option_set, things_away, things_moved
from executive.maps.supports import FLOOR, Standing
from executive.why.costs import cost_of
from executive.why.evidence import Evidence
from executive.why.free_places import is_at_rest, is_free, is_in, poses_after
from planlang.advice import ARM, ATTEMPTS, BEFORE, GRASP, ROBOT, SCHEDULE, Change
from planlang.designators import GRASPS
from planlang.geometry import Pose
from planlang.records import dataclass
from planlang.recoveries import ASIDE
from sim import Scene
from sim.joints import Articulation
from sim.scene import BodyShape

STEPS, RISES = (0.05, 0.1, 0.2, 0.4), (0.05, 0.2)
"""Distances by which a thing is moved, to each of four sides, and up and down [m]."""
ORDERS = (1, 2, 3)
"""Schedules in which steps whose order is open are run."""
MOST_NAMED = 4
"""Number of things that a failure names and that are moved."""
AJAR = 0.05
"""How far from its end a leaf is no longer open as far as it goes [rad, m]."""
UNRELATED = 1_000_000
"""Rank of what the failure does not name."""
MOST_SINGLE = 80
"""Number of single changes."""
OPENING, CLOSING = "OpeningAContainerArtifact", "ClosingAContainerArtifact"
PUT_DOWN = "put down"
"""Kind of the change by which a held thing is put down."""


@dataclass(frozen=True, slots=True)
class Situation:
    """What a failed run began with."""

    scene: Scene
    """As the map has it, with the doors as they are at the start."""
    needed: frozenset[str]
    """Things of the plan, which are never taken away."""
    robot: str
    arms: tuple[str, ...]
    robots: tuple[str, ...]
    """Bundled robots."""
    evidence: Evidence
    in_use: frozenset[str] = frozenset()
    """Options of the run that are set already: they are not chosen anew."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """Changes that are tried together, and how small they are."""

    changes: tuple[Change, ...]
    kind: str
    """What is changed, for counts: "advice", "arm", "thing moved", ..."""
    cost: float
    smaller: tuple[Candidate, ...] = field(default=(), compare=False)
    """The same move by less, the least first: tried once this one helps."""
    parts: tuple[Candidate, ...] = field(default=(), compare=False)
    """What a pair was joined from."""


def advised(situation: Situation) -> list[Candidate]:
    """List what failures and searches advised, that of the last failure first; nothing after which a thing falls.

    What is at rest where a robot believes things to be may hang in the air where the map has them.
    """
    scene, names = situation.scene, {body.name for body in situation.scene.bodies}
    standing = Standing(scene)
    known = (
        changes
        for changes in situation.evidence.advised
        if all(one.thing is None or one.thing in names for one in changes) and _are_at_rest(changes, scene, standing)
    )
    return [Candidate(changes, "advice", cost_of(changes, scene)) for changes in known]


def _are_at_rest(changes: Sequence[Change], scene: Scene, standing: Standing) -> bool:
    """Check whether all things that changes move are at rest there."""
    poses = poses_after(changes, scene)
    return all(is_at_rest(scene, poses, name, standing) for name in poses)


def singles(situation: Situation) -> list[Candidate]:
    """List the single changes, at most :data:`MOST_SINGLE` with the smaller moves that they have.

    Those that can touch the reason of the failure come first, the cheapest of these first, then those of named things.
    Of moves to one side the farthest stands for all: it counts as much as the shortest.
    """
    chosen, number = list[Candidate](), 0
    for _, candidate in _ranked(situation):
        number += 1 + len(candidate.smaller)
        if number <= MOST_SINGLE:
            chosen.append(candidate)
    return chosen


def cheaper(situation: Situation, cost: float) -> list[Candidate]:
    """List the single changes that can touch the reason of the failure and cost less, as :func:`singles` does."""
    return [one for is_unlikely, one in _ranked(situation, cost) if not is_unlikely]


def _ranked(situation: Situation, below: float = math.inf) -> list[tuple[bool, Candidate]]:
    """List all single changes that cost less, in order, and whether each hardly touches the reason of the failure."""
    found = list[tuple[tuple[bool, float, int], Candidate]]()
    for rank, kind, moves in _Generator(situation).all():
        each = [Candidate(changes, kind, cost_of(changes, situation.scene)) for changes in moves]
        if less := [one for one in each if one.cost < below]:
            is_unlikely = rank == UNRELATED or _hardly_touches(kind, situation.evidence)
            key = (is_unlikely, round(less[0].cost, 6), rank)
            found.append((key, replace(less[-1], smaller=tuple(less[:-1]))))
    return [(key[0], one) for key, one in sorted(found, key=lambda one: one[0])]


def _hardly_touches(kind: str, evidence: Evidence) -> bool:
    """Check whether a kind of change hardly touches the reason of a failure."""
    if not evidence.is_of_places:
        return kind not in ("order", "robot", PUT_DOWN)
    return kind in (ARM, GRASP, ATTEMPTS) and evidence.is_of_search  # which tried all, and would find the same again


class _Generator:
    """Makes the changes of the list, each with a rank: the lower, the closer to the failure."""

    def __init__(self, situation: Situation) -> None:
        self._situation, self._scene = situation, situation.scene
        self._bodies = {body.name: body for body in self._scene.bodies}
        self._standing = Standing(self._scene)
        self._leaves = {name: joint for joint in self._scene.joints for name in joint.bodies}

    def all(self) -> Iterator[tuple[int, str, list[tuple[Change, ...]]]]:
        """Yield rank, kind and changes, those of equal rank in order; of moves to one side all, the shortest first."""
        for rank, kind, changes in (*self._choices(), *self._steps()):
            yield rank, kind, [changes]
        for rank, name in enumerate(self._moved):
            kind = "thing moved" if self._bodies[name].movable else "furniture moved"
            yield from ((rank, kind, moves) for moves in self._moves(name) if moves)
        for rank, kind, changes in (*self._doors(), *self._away()):
            yield rank, kind, [changes]
        others = (name for name in self._situation.robots if name != self._situation.robot)
        yield from ((0, "robot", [option_set(ROBOT, name)]) for name in others)

    def _choices(self) -> Iterator[tuple[int, str, tuple[Change, ...]]]:
        situation = self._situation
        if ARM not in situation.in_use and len(situation.arms) > 1:
            yield from ((0, ARM, option_set(ARM, name)) for name in situation.arms)
        if GRASP not in situation.in_use and situation.evidence.is_grasp_open:
            yield from ((1, GRASP, option_set(GRASP, name)) for name in GRASPS)
        if SCHEDULE not in situation.in_use and situation.evidence.is_concurrent:
            yield from ((2, "order", option_set(SCHEDULE, number)) for number in ORDERS)

    def _steps(self) -> Iterator[tuple[int, str, tuple[Change, ...]]]:
        if ATTEMPTS not in self._situation.in_use:
            yield 1, ATTEMPTS, option_set(ATTEMPTS, 1)
        for name, step in self._situation.evidence.held:
            if name in self._bodies:
                yield 0, PUT_DOWN, option_set(BEFORE, f"{ASIDE} {name}@{step}")
        for rank, joint in self._related_joints():
            act = OPENING if joint.is_shut(joint.first) else CLOSING
            yield rank, BEFORE, option_set(BEFORE, f"{act} {joint.leaf}")

    @cached_property
    def named(self) -> list[str]:
        """Bodies that the failure names, without rooms."""
        names = [name for name, body in self._bodies.items() if body.shape is not BodyShape.ROOM]
        return self._situation.evidence.named(names)

    @cached_property
    def _moved(self) -> list[str]:
        """Bodies that are moved: those named, in order, then what they stand on; parts are moved with the whole."""
        whole = list(dict.fromkeys(map(self._whole, self.named)))[:MOST_NAMED]
        below = (self._standing.support(name) for name in whole)
        supports = [name for name in below if name is not None and name != FLOOR]
        found = dict.fromkeys((*whole, *map(self._whole, supports)))
        return [name for name in found if self._bodies[name].shape is not BodyShape.ROOM]

    def _whole(self, name: str) -> str:
        """The furniture of which a leaf, or a part of one, belongs."""
        joint = self._leaves.get(name)
        return joint.holder if joint is not None and joint.holder in self._bodies else name

    def _moves(self, name: str) -> Iterator[list[tuple[Change, ...]]]:
        """Yield the moves of a body with what moves along to each side, and up and down, where there is room."""
        body, along = self._bodies[name], self._along(name)
        support = self._standing.support(name)
        turn = self._bodies[support].pose if support in self._bodies else body.pose
        ahead = turn.matrix()[:2, 0]
        yaw = math.atan2(float(ahead[1]), float(ahead[0]))
        ways = [(math.cos(yaw + k * math.pi / 2), math.sin(yaw + k * math.pi / 2), 0.0) for k in range(4)]
        for way, steps in (*((way, STEPS) for way in ways), ((0.0, 0.0, 1.0), RISES), ((0.0, 0.0, -1.0), RISES)):
            each = ({one: _displaced(self._bodies[one].pose, step, way) for one in (name, *along)} for step in steps)
            yield [things_moved(poses) for poses in each if self._fits(name, poses)]

    def _fits(self, name: str, poses: Mapping[str, Pose]) -> bool:
        """Check whether a body, with what moves along, has room at its new pose, and is at rest."""
        return is_at_rest(self._scene, poses, name, self._standing) and is_free(self._scene, poses)

    def _along(self, name: str) -> list[str]:
        """What moves along with a body: its leaves and parts, and what stands on these or in it."""
        found = [name]
        for one in found:
            parts = [part for joint in self._scene.joints if one in (joint.leaf, joint.holder) for part in joint.bodies]
            on_it = [other for other, below in self._supports.items() if below == one or self._is_in(other, one)]
            controls = [control.body for control in self._scene.controls if control.device == one]
            found += [other for other in (*parts, *on_it, *controls) if other not in found and other in self._bodies]
        return found[1:]

    @cached_property
    def _supports(self) -> dict[str, str | None]:
        """What each movable body stands on."""
        return {name: self._standing.support(name) for name, body in self._bodies.items() if body.movable}

    def _is_in(self, name: str, other: str) -> bool:
        """Check whether the centre of a body is inside the box of another."""
        return other != name and is_in(self._bodies[name].pose, self._bodies[other])

    def _doors(self) -> Iterator[tuple[int, str, tuple[Change, ...]]]:
        for rank, joint in self._related_joints():
            if not joint.is_shut(joint.first):
                yield rank, "door", leaf_moved(joint, 0.0)
            if joint.first < joint.upper - AJAR:
                yield rank, "door", leaf_moved(joint, joint.upper)

    def _related_joints(self) -> Iterator[tuple[int, Articulation]]:
        """Yield the doors, drawers and lids; those that the failure names, or whose furniture it names, first."""
        order = {name: rank for rank, name in enumerate(self.named)}
        for joint in self._scene.joints:
            if not joint.is_knob:
                names = (*joint.bodies, str(joint.holder), *joint.frame)
                yield min(order.get(name, UNRELATED) for name in names), joint

    def _away(self) -> Iterator[tuple[int, str, tuple[Change, ...]]]:
        """Yield what may be taken away: movable bodies, and furniture that is named; nothing that is needed."""
        order = {name: rank for rank, name in enumerate(self.named)}
        needed = self._needed()
        for name, body in self._bodies.items():
            if name in needed or body.shape in (BodyShape.ROOM, BodyShape.PERSON, BodyShape.MARKER):
                continue
            if (body.movable or name in order) and self._whole(name) == name:
                gone = [name, *self._along(name)]
                if not needed.intersection(gone):
                    yield order.get(name, UNRELATED), "away", things_away(gone)

    def _needed(self) -> set[str]:
        """Things of the plan, and what they stand on or belong to."""
        found, left = set[str](), list(self._situation.needed)
        while left:
            name = left.pop()
            if name in self._bodies and name not in found:
                found.add(name)
                left += [str(self._standing.support(name)), self._whole(name)]
        return found


def _displaced(pose: Pose, step: float, way: Sequence[float]) -> Pose:
    """Displace a pose, to a tenth of a millimetre."""
    x, y, z = (round(at + step * part, 4) for at, part in zip(pose.position, way, strict=True))
    return replace(pose, position=(x, y, z))


def kinds_of(candidates: Collection[Candidate]) -> dict[str, int]:
    """Count candidates by kind."""
    counts: dict[str, int] = {}
    for one in candidates:
        counts[one.kind] = counts.get(one.kind, 0) + 1
    return counts
