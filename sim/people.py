"""The people of a world: each step they watch what the robot holds, and reach for it when it is offered."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import field

import numpy as np

from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.matrices import facing, moved, rotated
from planlang.geometry.shapes import SolidKind, half_extents
from planlang.records import dataclass
from sim.bodies import Bodies, Part
from sim.scene import Body, BodyShape

HAND_SPEED = 0.4
"""Speed of a hand [m/s]."""
TAKING_DISTANCE = 0.05
"""Distance up to which a hand takes a thing [m]."""
TAKING_TIME = 1.0
"""Time for which a thing must be within that distance before it is taken [s]."""
COMFORT_ANGLE = math.radians(60)
"""Half opening angle of the cone in front of a shoulder in which a person likes to take things."""
NEAREST = 0.25
"""Smallest comfortable distance from the shoulder, as a share of the arm length."""
SHARES, RISES, TURNS = (0.7, 0.55, 0.85), (0.0, -0.12, 0.12), (0.0, 0.35, -0.35, 0.7, -0.7, 0.95, -0.95)
"""Sample points of the zone, most comfortable first: shares of the arm length, heights above the shoulder [m], and
turns from the facing direction [rad]."""
LOW = (-0.25, -0.35, -0.45)
"""Heights at which a person takes things as well, from robots that offer them no higher."""

_SKIN = (0.86, 0.68, 0.56, 1.0)
_CLOTHES = (0.45, 0.62, 0.78, 1.0)
_UP = np.array([0.0, 0.0, 1.0])
_UPPER, _FORE, _HAND = 0.30, 0.27, 0.09


@dataclass(frozen=True, slots=True)
class ComfortZone:
    """Zone in which a person takes things: in front of a shoulder, within arm's reach."""

    shoulders: tuple[tuple[float, float, float], tuple[float, float, float]]
    """Right and left, in the map."""
    arm_length: float
    """Distance from the shoulder to the palm [m]."""
    facing: tuple[float, float, float]
    """Horizontal direction in which the person looks, as a unit vector."""

    @property
    def heading(self) -> float:
        """Heading of the person [rad]."""
        return math.atan2(self.facing[1], self.facing[0])

    def arm_for(self, point: Sequence[float] | Array, arms: Collection[int] = (0, 1)) -> int | None:
        """Select the arm with a point in its zone, the nearer one of two: 0 (right), 1 (left), or None.

        ``arms`` are those that come into question, as a hand that holds something does not.

        The zone extends from a quarter of the arm length to all of it, within 60 degrees of the facing direction.
        """
        best: tuple[float, int] | None = None
        for k, shoulder in enumerate(self.shoulders):
            if k not in arms:
                continue
            offset = np.asarray(point, dtype=float) - np.asarray(shoulder)
            distance = float(np.linalg.norm(offset))
            if not NEAREST * self.arm_length <= distance <= self.arm_length:
                continue
            if float(offset @ np.asarray(self.facing)) < distance * math.cos(COMFORT_ANGLE):
                continue
            if best is None or distance < best[0] - 1e-9:
                best = (distance, k)
        return None if best is None else best[1]

    def contains(self, point: Sequence[float] | Array) -> bool:
        """Check whether the person would take something at this point of the map."""
        return self.arm_for(point) is not None

    def points(self, rises: Sequence[float] = RISES) -> Array:
        """Sample the zone sparsely, most comfortable points first, (n, 3), at some heights above the shoulder [m]."""
        points: dict[tuple[float, float, float], None] = {}
        for share, rise, turn in itertools.product(SHARES, rises, TURNS):
            for x, y, z in self.shoulders:
                step, heading = share * self.arm_length, self.heading + turn
                point = (x + step * math.cos(heading), y + step * math.sin(heading), z + rise)
                if self.contains(point):
                    points[point] = None
        return np.array(list(points)).reshape(-1, 3)

    def margins(self, points: Array) -> Array:
        """Compute how far inside the zone points (n, 3) are, (n,): as a share of the arm, or in terms of the cosine.

        The person may sit slightly differently than believed, so that things at the border may not be taken.
        """
        offsets = points[:, None] - np.array(self.shoulders)
        distances = np.linalg.norm(offsets, axis=2)
        ahead = offsets[..., 0] * math.cos(self.heading) + offsets[..., 1] * math.sin(self.heading)
        share, cosine = distances / self.arm_length, ahead / np.maximum(distances, 1e-9)
        return np.asarray(np.minimum(np.minimum(1.0 - share, share - NEAREST), cosine - 0.5).max(axis=1))


@dataclass(frozen=True, slots=True)
class Figure:
    """Parts and proportions in the frame of the body's box; ``turn`` rotates a frame with x ahead into that frame."""

    trunk: tuple[Part, ...]
    shoulders: tuple[Array, Array]
    hands: tuple[Array, Array]
    """Rest positions of the hands."""
    scale: float
    turn: Pose

    @property
    def arm_length(self) -> float:
        """Distance from the shoulder to the palm [m]."""
        return (_UPPER + _FORE + _HAND / 2) * self.scale


def figure_of(body: Body) -> Figure:
    """Build a figure: lying (long and low, upper body raised as far as the box is high), seated or standing."""
    length, width, height = body.size
    along = max(length, width)
    if along >= 1.2 and along > height:
        return _lying(along, height, Pose.planar(0.0, 0.0, 0.0 if length >= width else math.pi / 2))
    return _seated(length, height) if height < 1.45 else _standing(height)


def _lying(length: float, height: float, turn: Pose) -> Figure:
    scale, lean = length / 1.75, 0.0
    for _ in range(20):  # fixed-point iteration: the more upright the upper body, the longer the legs may be
        lean = math.asin(min(max((height - 0.2 * scale) / (0.80 * scale), 0.0), 0.94))
        scale = min(max(length / (0.92 + 0.80 * math.cos(lean) + 0.05), 0.5), 1.15)
    pelvis = np.array([length / 2 - 0.92 * scale, 0.0, -height / 2 + 0.10 * scale])
    up = np.array([-math.cos(lean), 0.0, math.sin(lean)])
    legs = _box(np.add(pelvis, (0.46 * scale, 0.0, 0.0)), (0.92, 0.34, 0.17), scale, _CLOTHES)
    return _figure(pelvis, up, scale, turn, [legs], np.array([0.18, 0.27, 0.03]))


def _standing(height: float) -> Figure:
    scale, ground = height / 1.75, -height / 2
    pelvis = np.array([0.0, 0.0, ground + 0.93 * scale])
    legs = [_box([0, 0, ground + 0.465 * scale], (0.2, 0.32, 0.93), scale, _CLOTHES)]
    return _figure(pelvis, _UP, scale, IDENTITY, legs, np.array([0.05, 0.25, -0.05]))


def _seated(length: float, height: float) -> Figure:
    scale, ground = height / 1.28, -height / 2
    pelvis = np.array([-length / 2 + 0.12 * scale, 0.0, ground + 0.47 * scale])
    shins = _box([pelvis[0] + 0.45 * scale, 0, ground + 0.22 * scale], (0.14, 0.32, 0.44), scale, _CLOTHES)
    thighs = _box(np.add(pelvis, (0.25 * scale, 0.0, 0.0)), (0.5, 0.34, 0.16), scale, _CLOTHES)
    return _figure(pelvis, _UP, scale, IDENTITY, [shins, thighs], np.array([0.35, 0.2, 0.14]))


def _figure(pelvis: Array, up: Array, scale: float, turn: Pose, legs: list[Part], rest: Array) -> Figure:
    """Put torso and head on top of the legs; ``rest`` is the left hand's rest position relative to the pelvis."""
    front = np.array([up[2], 0.0, -up[0]])
    torso = _posed(pelvis + up * 0.29 * scale, front, up, (0.2, 0.34, 0.52), scale, _CLOTHES)
    head = Part(SolidKind.SPHERE, (0.2 * scale,) * 3, turn @ Pose(_triple(pelvis + up * 0.68 * scale)), _SKIN)
    parts = [Part(p.kind, p.size, turn @ p.offset, p.color) for p in [*legs, torso]]
    spin = turn.rotation
    side = np.array([0.0, 0.21 * scale, 0.0])
    shoulder = pelvis + up * 0.48 * scale
    rest = rest * scale
    return Figure(
        (*parts, head),
        (rotated(spin, shoulder - side), rotated(spin, shoulder + side)),
        (rotated(spin, pelvis + rest * [1, -1, 1]), rotated(spin, pelvis + rest)),
        scale,
        turn,
    )


def _box(center: Array | Sequence[float], size: Sequence[float], scale: float, color: Sequence[float]) -> Part:
    return _posed(np.asarray(center, dtype=float), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), size, scale, color)


def _posed(center: Array, front: Array, up: Array, size: Sequence[float], scale: float, color: Sequence[float]) -> Part:
    scaled = (size[0] * scale, size[1] * scale, size[2] * scale)
    return Part(SolidKind.BOX, scaled, facing(center.tolist(), front, up), (color[0], color[1], color[2], color[3]))


def _triple(vector: Array) -> tuple[float, float, float]:
    return (float(vector[0]), float(vector[1]), float(vector[2]))


def reach_from(figure: Figure, pose: Pose) -> ComfortZone:
    """Compute the comfort zone of a figure whose body is at a pose."""
    matrix = pose.matrix()
    shoulders = [moved(matrix, shoulder) for shoulder in figure.shoulders]
    ahead = rotated(matrix[:3, :3], figure.turn.rotation[:, 0])
    ahead[2] = 0.0
    ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
    return ComfortZone((_triple(shoulders[0]), _triple(shoulders[1])), figure.arm_length, _triple(ahead))


def parts_of(body: Body) -> tuple[Part, ...]:
    """List the trunk, then upper arm, forearm and hand of the right and the left arm, hands at rest."""
    figure = figure_of(body)
    parts = list(figure.trunk)
    for k in (0, 1):
        parts += arm_parts(figure, k, figure.hands[k])
    return tuple(parts)


def arm_parts(figure: Figure, k: int, hand: Array) -> list[Part]:
    """Pose arm ``k`` with its palm at a point of the body's frame, or as near as possible; elbow down and outward."""
    scale, shoulder = figure.scale, figure.shoulders[k]
    upper, fore = _UPPER * scale, (_FORE + _HAND / 2) * scale
    offset = hand - shoulder
    distance = min(max(float(np.linalg.norm(offset)), 1e-3), (upper + fore) * 0.999)
    ahead = offset / max(float(np.linalg.norm(offset)), 1e-9)
    along = (upper**2 - fore**2 + distance**2) / (2 * distance)
    along = min(max(along, -upper), upper)
    outwards = rotated(figure.turn.rotation, np.array([-0.3, -0.5 if k == 0 else 0.5, -1.0]))
    aside = outwards - ahead * float(outwards @ ahead)
    aside /= max(float(np.linalg.norm(aside)), 1e-9)
    elbow = shoulder + ahead * along + aside * math.sqrt(max(upper**2 - along**2, 0.0))
    palm = shoulder + ahead * distance
    towards = (palm - elbow) / max(float(np.linalg.norm(palm - elbow)), 1e-9)
    wrist = palm - towards * _HAND / 2 * scale
    return [
        _limb(SolidKind.CYLINDER, shoulder, elbow, 0.08 * scale, _CLOTHES),
        _limb(SolidKind.CYLINDER, elbow, wrist, 0.065 * scale, _SKIN),
        _limb(SolidKind.BOX, wrist, palm + towards * _HAND / 2 * scale, 0.07 * scale, _SKIN),
    ]


def _limb(kind: SolidKind, start: Array, end: Array, width: float, color: tuple[float, float, float, float]) -> Part:
    along = end - start
    length = max(float(np.linalg.norm(along)), 1e-3)
    pose = facing(((start + end) / 2).tolist(), along, np.array([0.0, 0.0, 1.0]))
    if kind == SolidKind.CYLINDER:  # rotate its axis from z to x
        turn = math.sqrt(0.5)
        return Part(
            kind, (width, width, length), pose @ Pose((0.0, 0.0, 0.0), (0.0, turn, 0.0, turn)), color, limb=True
        )
    return Part(kind, (length, width, width * 0.5), pose, color, limb=True)


@dataclass(slots=True)
class Person:
    """State of a person's hands; positions are in the body's frame."""

    body: Body
    figure: Figure
    hands: list[Array]
    reaching: tuple[int, str] | None = None
    """Arm, and name of the object it reaches for."""
    close: int = 0
    """Number of steps for which the object has been within the hand's grasp."""
    holds: dict[str, tuple[int, Pose]] = field(default_factory=dict)
    """Object -> arm, and the object's pose when it was taken."""

    @staticmethod
    def of(body: Body) -> Person:
        """Create a person at rest."""
        figure = figure_of(body)
        return Person(body, figure, [hand.copy() for hand in figure.hands])

    def free(self, k: int) -> bool:
        """Check whether a hand holds nothing."""
        return all(arm != k for arm, _ in self.holds.values())

    def move_hand(self, k: int, goal: Array, rate: int) -> bool:
        """Move a hand by one step towards a point of the body's frame; return True if it moved."""
        offset = goal - self.hands[k]
        if not offset.any() or (distance := float(np.linalg.norm(offset))) < 1e-6:
            return False
        self.hands[k] = self.hands[k] + offset * min(1.0, HAND_SPEED / rate / distance)
        return True


def taking_point(pose: Pose, size: Sequence[float], shoulder: Sequence[float]) -> Array:
    """Compute where a palm goes to take an object: beside its upper half, on the shoulder's side, in the map."""
    center = np.asarray(pose.position)
    aside = np.asarray(shoulder, dtype=float) - center
    aside[2] = 0.0
    aside /= max(float(np.linalg.norm(aside)), 1e-9)
    half = np.asarray(size, dtype=float) / 2
    local = rotated(pose.rotation.T, aside)
    width = min(float(half[i] / abs(local[i])) for i in range(3) if abs(local[i]) > 1e-6)
    height = float(half_extents(pose, size)[2])
    point: Array = center + aside * (width + 0.03) + np.array([0.0, 0.0, height * 0.4])
    return point


_REST = 8
"""Steps for which an object must be at rest before it counts as offered."""
_LOST = 0.1
"""Displacement by the robot of a taken object above which the person lets go [m]."""


class People:
    """All persons of a scene; the world reports what the robot holds and asks who has taken what."""

    def __init__(self, bodies: Bodies, rate: int) -> None:
        self.bodies, self.rate = bodies, rate
        self.persons = {name: Person.of(b) for name, b in bodies.bodies.items() if b.shape is BodyShape.PERSON}
        self.still: dict[str, tuple[Pose, int]] = {}
        """Object in the robot's hand -> its pose, and the number of steps it has been at rest there."""
        self._reach: dict[str, tuple[Pose, ComfortZone]] = {}

    def reach(self, name: str) -> ComfortZone:
        """Comfort zone of a person now; ``KeyError`` if there is no such person."""
        if name not in self.persons:
            raise KeyError(f"{name!r} is not a person; persons: {', '.join(self.persons) or 'none'}")
        pose = self.bodies.poses[name]
        if name not in self._reach or self._reach[name][0] != pose:
            self._reach[name] = (pose, reach_from(self.persons[name].figure, pose))
        return self._reach[name][1]

    def hand(self, name: str, k: int) -> Array:
        """Locate a palm (0 right, 1 left) in the map."""
        return moved(self.bodies.poses[name].matrix(), self.persons[name].hands[k])

    def holder(self, name: str) -> str | None:
        """Name the person who has taken a body, if any."""
        return next((person for person, state in self.persons.items() if name in state.holds), None)

    def lose(self, name: str) -> None:
        """Record that no person holds the body any more."""
        for person in self.persons.values():
            person.holds.pop(name, None)

    def step(self, held: Mapping[str, Pose]) -> None:
        """Advance all persons by one step; ``held`` are the objects in the robot's hands, with their poses."""
        if not self.persons:
            return
        self._watch(held)
        for name, person in self.persons.items():
            for taken, (_, pose) in list(person.holds.items()):
                if taken in held and held[taken].distance(pose) > _LOST:
                    del person.holds[taken]
            if name not in self.bodies.removed:
                self._step(name, person, held)

    def _watch(self, held: Mapping[str, Pose]) -> None:
        for name, pose in held.items():
            before, count = self.still.get(name, (pose, 0))
            self.still[name] = (pose, count + 1 if before.distance(pose) < 1e-3 else 0)
        for name in [name for name in self.still if name not in held]:
            del self.still[name]

    def _step(self, name: str, person: Person, held: Mapping[str, Pose]) -> None:
        target = self._offer(name, person, held)
        person.reaching = target
        moved_hands = [False, False]
        if target is None:
            person.close = 0
            for k in (0, 1):
                if person.free(k):
                    moved_hands[k] = person.move_hand(k, person.figure.hands[k], self.rate)
        else:
            k, thing = target
            size = self.bodies.bodies[thing].size
            goal = taking_point(held[thing], size, self.reach(name).shoulders[k])
            inverse = self.bodies.poses[name].inverse().matrix()
            moved_hands[k] = person.move_hand(k, moved(inverse, goal), self.rate)
        if any(moved_hands):
            self.place_arms(name, [k for k in (0, 1) if moved_hands[k]])
        if target is not None:
            self._take(name, person, target, held)

    def _take(self, name: str, person: Person, target: tuple[int, str], held: Mapping[str, Pose]) -> None:
        k, thing = target
        palm = [self._limbs(name)[3 * k + 2]]
        near = self.bodies.gap(palm, self.bodies.of[thing], TAKING_DISTANCE) <= TAKING_DISTANCE
        person.close = person.close + 1 if near else 0
        if person.close >= round(TAKING_TIME * self.rate):
            person.holds[thing] = (k, held[thing])
            person.reaching, person.close = None, 0

    def _offer(self, name: str, person: Person, held: Mapping[str, Pose]) -> tuple[int, str] | None:
        """Select the arm and the object to reach for: at rest, in the comfort zone, not taken by anybody yet."""
        reach = self.reach(name)
        for thing, pose in held.items():
            if self.still[thing][1] < _REST or self.holder(thing):
                continue
            if person.reaching is not None and person.reaching[1] == thing and reach.contains(pose.position):
                return person.reaching[0], thing
            k = reach.arm_for(pose.position, [k for k in (0, 1) if person.free(k)])
            if k is not None:
                return k, thing
        return None

    def _limbs(self, name: str) -> list[int]:
        return [index for index in self.bodies.of[name] if self.bodies.pieces[index].part.limb]

    def place_arms(self, name: str, arms: Iterable[int]) -> None:
        """Pose arms to match their hands."""
        person, limbs = self.persons[name], self._limbs(name)
        for k in arms:
            parts = arm_parts(person.figure, k, person.hands[k])
            for index, part in zip(limbs[3 * k : 3 * k + 3], parts, strict=True):
                self.bodies.place_part(index, part.offset)
