"""Grasp candidates: tip poses for the task of a hand, independent of where the base stands.

A candidate is a short series of tip poses with one rotation. All candidates of a reach are kept in arrays, so that
reachability maps can be inverted for many at once. Maps are queried with the *key* pose of a series.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.locations.reachability import GraspClass
from executive.motion import QuickCheck
from executive.robots.arms import ArmModel, HandFrame
from executive.robots.openings import TIGHT, Fingers, Openings, depths
from planlang.geometry import Array
from planlang.geometry.areas import Block
from planlang.geometry.matrices import product, rotated
from planlang.records import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Base class of tables: array fields are the columns, other fields apply to all rows."""

    def chosen(self, rows: ArrayLike) -> Self:
        """Select rows by indices or a mask."""
        index = np.asarray(rows)
        return replace(self, **{name: getattr(self, name)[index] for name in self._columns()})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Concatenate the rows of one or more tables; other fields are taken from the first."""
        names = parts[0]._columns()
        return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    def _columns(self) -> list[str]:
        return [field.name for field in fields(self) if isinstance(getattr(self, field.name), np.ndarray)]


APPROACH = 0.08
"""Distance of the pre-grasp pose from the grasp along the approach direction [m] (rules of `in_front_of`)."""
LIFT = 0.05
"""Height by which the hand lifts a thing before it retreats [m]."""
LIFTS = (LIFT, 0.08, 0.03)
"""The same for a thing that is already in the hand."""
HEADINGS = 16
"""Number of approach headings at first; for grasps it is doubled, twice, if these lead to nothing."""
FOREARM = 0.07
"""Height above a surface that leaves room for a level forearm [m]."""
OVER_EDGE = 0.4
"""Weight of a level grasp below that, possible only at the edge of a surface."""
OFF = 0.003
"""Distance of the palm from the gripped thing [m]: PyBullet adds a margin to meshes."""
GRIPPED = 0.01
"""Least height of a thing above the grip point [m]."""
ROOMS = (0.0, 0.02)
"""Distances of a hand on a handle from the rest of the thing [m]."""
UP = np.array([0.0, 0.0, 1.0])
FARTHER_BACK = 0.008
"""Distance by which a grip may move towards the fingertips [m]."""
AWRY, TIGHTER = 0.9, 0.8
"""Weights of off-centre grasps, and of grasps with little room for the fingers."""
OBLIQUE = 0.4
"""Weight of a grasp across the edges of a box, relative to one across its faces."""

CLASSES: tuple[GraspClass, ...] = tuple(GraspClass)
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class HandPoses:
    """One grasp candidate: tip poses (k, 4, 4) in order, a label for people, and the body that the hand may touch."""

    label: str
    poses: Array
    touches: str | None = None
    fingers: Fingers = ()
    """Positions of the fingers meanwhile, if they change."""


@dataclass(frozen=True, slots=True, eq=False)
class GraspCandidates(Columns):
    """n candidates; ``key`` is the index of the key pose in each series."""

    text: str
    """Description of the poses, for labels."""
    points: Array
    """Tip position at the key pose in the map, (n, 3)."""
    rotations: Array
    """Rotations of the tip in the map, (n, 3, 3)."""
    offsets: Array
    """Offsets from the key pose to each pose of the series, in the map, (n, k, 3)."""
    key: int
    grasps: Indices
    """Class of each candidate, an index into CLASSES, (n,)."""
    headings: Array
    """Headings of the approach axis; for the class "top", of the direction ahead of the closing axis [rad], (n,)."""
    rolls: Indices
    """1 or -1, (n,)."""
    weights: Array
    """Weights in (0, 1], higher for more natural ones, (n,)."""
    touches: str | None = None
    fingers: Fingers = ()
    spans: Array | None = None
    """Width of the thing between the fingers, and its extent behind the grip point [m], (n, 2)."""

    heights: tuple[float, ...] = ()
    """Offsets by which the thing can also be gripped higher or lower from the side [m]."""
    step: float = 0.0
    """Angle between headings if those in between are possible, too [rad]."""

    def __len__(self) -> int:
        return len(self.points)

    def poses(self, index: ArrayLike) -> Array:
        """Compute tip poses (m, k, 4, 4) of candidates (m,)."""
        chosen = np.asarray(index, np.intp)
        poses = np.zeros((len(chosen), self.offsets.shape[1], 4, 4))
        poses[..., :3, :3] = self.rotations[chosen][:, None]
        poses[..., :3, 3] = self.points[chosen][:, None] + self.offsets[chosen]
        poses[..., 3, 3] = 1.0
        return poses

    def plan(self, index: int) -> HandPoses:
        """Extract one candidate."""
        grasp = CLASSES[int(self.grasps[index])].value
        label = f"{self.text}, {grasp}, heading {math.remainder(float(self.headings[index]), 2 * math.pi):.2f}"
        return HandPoses(label, self.poses([index])[0], self.touches, self.fingers)

    def best(self, most: int) -> GraspCandidates:
        """Select the most natural ones, in that order."""
        return self.chosen(np.argsort(-self.weights.round(6), kind="stable")[:most])

    def variants(self, openings: Openings) -> list[GraspCandidates]:
        """List these and their variants for tight places: other grip points, then narrower openings as well."""
        if self.spans is None or not openings.fingers or not len(self):
            return [self]
        tight = openings.fingers[int(openings.around(self.spans, TIGHT, is_round=self.step > 0).max())]
        narrow = [] if tight == self.fingers else [replace(self, fingers=tight, weights=TIGHTER * self.weights)]
        return [variant for one in (self, *narrow) for variant in (one, *one._turned(), *one.elsewhere())]

    def _turned(self) -> list[GraspCandidates]:
        """List variants with headings in between, for what can be gripped from any."""
        variants = []
        for angle in (self.step / 3, -self.step / 3) if self.step else ():
            turn = upright(np.array([angle]))[0]
            turned = product(turn, self.rotations), self.offsets @ turn.T, self.headings + angle
            variants.append(replace(self, rotations=turned[0], offsets=turned[1], headings=turned[2]))
        return variants

    def elsewhere(self) -> list[GraspCandidates]:
        """List variants with the grip nearer to the fingertips, and higher or lower; not from above."""
        back, side = self.offsets[:, 0] - self.offsets[:, self.key], CLASSES.index(GraspClass.SIDE)
        moves = [np.outer(self.grasps == side, UP) * height for height in self.heights]
        if moves:
            moves.insert(0, back * (FARTHER_BACK / APPROACH))
        return [replace(self, points=self.points + move, weights=AWRY * self.weights, heights=()) for move in moves]

    def by_opening(self, openings: Openings) -> list[GraspCandidates]:
        """Split by the finger opening that the thing requires, the best candidate's first."""
        if self.spans is None or not openings.fingers or not len(self):
            return [self] if len(self) else []
        numbers = openings.around(self.spans, is_round=self.step > 0)
        middles = openings.middles(self.spans[:, 0])
        beside = self if not middles.any() else replace(self, points=self.points - rotated(self.rotations, middles))
        first = dict.fromkeys(numbers[np.argsort(-self.weights.round(6), kind="stable")].tolist())
        return [replace(beside.chosen(numbers == number), fingers=openings.fingers[number]) for number in first]


class Hand(NamedTuple):
    """Arm with its grasp candidates, and the collision check of its postures."""

    arm: ArmModel
    candidates: GraspCandidates
    check: QuickCheck


@lru_cache(maxsize=8)  # arms of one kind have the same candidates
def grasping(
    name: str,
    block: Block,
    frame: HandFrame,
    max_opening: float,
    classes: tuple[GraspClass, ...],
    headings: int,
    palm: tuple[tuple[float, ...], ...] = (),
    gaps: tuple[float, ...] = (),
) -> GraspCandidates:
    """Generate pre-grasp, grasp, lift and retreat; the fingers close horizontally across the body.

    They grip the middle, or higher if the ``palm``, given by corners in the tip's frame, would touch the body; where
    that is above its top, nearer to the hand instead: long boxes are gripped at their end. If the body does not fit as
    far as that between the open fingers, whose ``gaps`` are those of :attr:`Openings.widest_gaps`, hands grip it with
    their tips: those from above higher, level ones nearer to its side.
    """
    grasps, yaws, rolls, weights, spans = [], [], [], [], []
    level = 1.0 if block.centre[2] - block.low >= FOREARM else OVER_EDGE
    for grasp in classes:
        for number in range(headings):
            turn = number * 2 * math.pi / headings
            yaw = block.yaw + turn
            across = 2 * block.support(yaw + math.pi / 2)
            if across > max_opening:
                continue
            cosine, sine = math.cos(grasp.pitch), math.sin(grasp.pitch)
            # a round body is widest in its middle
            forward_extent = 0.0 if block.round else cosine * block.support(yaw)
            behind = forward_extent + sine * (block.high - block.low) / 2
            # the fingers lie flat on two opposite faces
            flat = block.round or abs(math.sin(2 * turn)) < 1e-6
            for roll in grasp.rolls:
                grasps.append(CLASSES.index(grasp))
                yaws.append(yaw)
                rolls.append(roll)
                weights.append((level if grasp is GraspClass.SIDE else 0.8) * (1.0 if flat else OBLIQUE))
                spans.append((across, behind))
    count, approaches = len(yaws), directions(grasps, yaws)
    points, offsets = np.tile(block.centre, (count, 1)), grasp_series(approaches)
    candidates = oriented(f"grasp {name}", points, offsets, 1, grasps, yaws, rolls, weights, frame, touches=name)
    ends = (block.high - block.centre[2]) / 2, (block.low - block.centre[2]) / 2
    candidates = replace(candidates, spans=np.array(spans).reshape(-1, 2), heights=ends)
    candidates = replace(candidates, step=2 * math.pi / headings if block.round else 0.0)
    if not count or not palm:
        return candidates
    closings = rotated(candidates.rotations, np.array(frame.closing))
    moves, grips = _clear_of(block, candidates, approaches, closings, np.array(palm))
    before = np.array(spans)
    around = before - np.column_stack([np.zeros(count), np.hypot(*moves[:, :2].T)])
    if gaps:
        farther, deep = _by_the_tips(block, before, moves, approaches, gaps)
        if block.axis is not None:  # across its axis, a lying cylinder is widest in its middle
            narrows = np.abs(np.cos(np.array(yaws) - block.axis)) > 1.0 - 1e-6
            farther, deep = np.where(narrows[:, None], 0.0, farther), np.where(narrows, np.inf, deep)
        moves, around[:, 1] = moves + farther, np.minimum(around[:, 1], deep)
    return replace(candidates, points=candidates.points + moves, spans=around).chosen(np.flatnonzero(grips))


def grasp_series(approaches: Array, lift: float = LIFT) -> Array:
    """Compute offsets (n, 4, 3) of pre-grasp, grasp, ``lift`` [m] and retreat for approach directions (n, 3)."""
    still = np.zeros_like(approaches)
    return np.stack([-APPROACH * approaches, still, still + lift * UP, _raised_and_back(approaches, lift)], axis=1)


def lifted(candidates: GraspCandidates, lift: float) -> GraspCandidates:
    """Limit the lift of grasps to a height [m], for a thing with little room above."""
    return replace(candidates, offsets=grasp_series(-candidates.offsets[:, 0] / APPROACH, lift))


def taken_out(candidates: GraspCandidates, way: Array) -> GraspCandidates:
    """Insert a path (k, 3) [m] of a thing out of what contains it, between grasp and lift."""
    ways = np.broadcast_to(way, (len(candidates), *way.shape))
    first, grasp, lift, back = candidates.offsets.swapaxes(0, 1)
    lift, back = lift + way[-1], back + way[-1] * [1.0, 1.0, 0.0]
    back[:, 2] = np.maximum(back[:, 2], lift[:, 2])
    steps = np.stack([first, grasp], axis=1), ways[:, :-1], np.stack([lift, back], axis=1)
    return replace(candidates, offsets=np.concatenate(steps, axis=1))


def _clear_of(
    block: Block, candidates: GraspCandidates, directions: Array, closings: Array, palm: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Compute offsets (n, 3) [m] that keep palms (m, 3) off a block, and which hands still grip it, (n,).

    The palm is behind the block, above it, or beyond a plane across the approach direction (n, 3) or, for hands that
    close a thumb before the palm, across the closing direction (n, 3). If it would be over
    the top, a level hand moves back instead, except from a round block, off which the fingers would slip.
    """
    corners = palm @ candidates.rotations.transpose(0, 2, 1)
    back = -directions * [1.0, 1.0, 0.0]
    back /= np.maximum(np.linalg.norm(back, axis=1), 1e-9)[:, None]
    half, raised = (block.high - block.low) / 2, np.full(len(directions), np.inf)
    for axes in (back, -directions, UP + 0.0 * directions, closings, -closings):
        level = np.hypot(axes[:, 0], axes[:, 1])
        sideways = [block.support(math.atan2(y, x)) for x, y, _ in axes.tolist()]
        gap = np.einsum("nmk,nk->nm", corners, axes).min(axis=1) - level * sideways - half * axes[:, 2] - OFF
        rise = np.where(gap >= 0.0, 0.0, -gap / np.maximum(axes[:, 2], 1e-9))
        raised = np.minimum(raised, np.where(level + axes[:, 2] > 1e-6, rise, np.inf))
    lengths = np.array([block.support(math.atan2(y, x)) for x, y, _ in back.tolist()])
    drawn = lengths + OFF - np.einsum("nmk,nk->nm", corners, back).min(axis=1)
    over = raised > half - GRIPPED
    level = np.abs(directions[:, 2]) < 1e-6
    grips = ~over | level & (drawn <= lengths - GRIPPED) & (not block.round)
    return np.where(over[:, None], drawn[:, None] * back, raised[:, None] * UP), grips


def _by_the_tips(
    block: Block, spans: Array, moves: Array, directions: Array, gaps: tuple[float, ...]
) -> tuple[Array, Array]:
    """Compute by how much more than ``moves`` (n, 3) hands stay off a block, so that no open finger penetrates it.

    Hands from above grip it higher, level ones nearer to its side, unless they would slip off a round one. Returns
    these offsets (n, 3) [m], zero where nothing has to or can be done, and the extent of the block behind the new grip
    points (n,) [m], infinite for unmoved ones.
    """
    deep, steep = depths(spans[:, 0], gaps), -directions[:, 2]
    excess = np.maximum(spans[:, 1] + np.einsum("nk,nk->n", moves, directions) - deep, 0.0)
    rise = np.where(steep > 1e-6, excess / np.maximum(steep, 1e-6), 0.0)
    helps = (rise > 0.0) & (moves[:, 2] + rise <= (block.high - block.low) / 2 - GRIPPED)
    drawn = np.where((steep <= 1e-6) & (spans[:, 1] - excess >= GRIPPED) & (not block.round), excess, 0.0)
    offsets = np.where(helps, rise, 0.0)[:, None] * UP - drawn[:, None] * directions
    return offsets, np.where(helps | (drawn > 0.0), deep, np.inf)


def beside(candidates: GraspCandidates, block: Block, handle: Block, corners: Array) -> GraspCandidates:
    """Move candidates at a handle away from its body until the hands are clear of it and still on the handle.

    ``corners`` (m, 3) of the hand are in the tip's frame. The separating plane touches the body: above it, or vertical,
    towards the handle or along a side. Once with no clearance, once with room for fingers that advance as they close.
    """
    hands = corners @ candidates.rotations.transpose(0, 2, 1) + candidates.points[:, None]
    outwards = math.atan2(handle.y - block.y, handle.x - block.x)
    sides = [outwards, *(block.yaw + number * math.pi / 2 for number in range(4))]
    normals = np.array([UP, *([math.cos(side), math.sin(side), 0.0] for side in sides)])
    reaches = [block.high - block.centre[2], *map(block.support, sides)]
    gaps = ((hands - block.centre) @ normals.T).min(axis=1) - reaches
    tables = []
    for room in ROOMS:
        missing = np.maximum(room - gaps, 0.0)
        shifts = missing.min(axis=1)[:, None] * normals[missing.argmin(axis=1)]
        on = np.ones(len(candidates), bool)
        for inwards, extent in ((-UP, (handle.high - handle.low) / 2), (-normals[1], handle.support(outwards))):
            on &= ((hands + shifts[:, None] - handle.centre) @ inwards).max(axis=1) >= GRIPPED - extent
        tables.append(replace(candidates, points=candidates.points + shifts).chosen(np.flatnonzero(on)))
    return GraspCandidates.joined(tables)


def retreating(name: str, grasp: Array, frame: HandFrame, way: Array, room: float) -> GraspCandidates:
    """Generate candidates that retreat with a held thing along the approach, raised so that it clears its support.

    ``grasp`` (4, 4) is the tip pose at which the thing was grasped, ``way`` (k, 3) [m] its path out of what contains
    it, ``room`` [m] the headroom.
    """
    kind, heading, roll = classified(grasp[:3, :3], frame)
    approach = rotated(grasp[:3, :3], np.asarray(frame.approach))
    lifts = LIFTS if len(way) else [lift for lift in LIFTS if lift <= room] or [room]
    rises = np.array([[0.0, 0.0, lift] for lift in lifts]) + (way[-1] if len(way) else 0.0)
    count = len(rises)
    back = _raised_and_back(np.tile(approach, (count, 1)), rises[:, 2]) + rises * [1.0, 1.0, 0.0]
    steps = np.concatenate([np.tile(way[:-1], (count, 1, 1)), rises[:, None], back[:, None]], axis=1)
    return GraspCandidates(
        f"lift {name}",
        grasp[:3, 3] + rises,
        np.tile(grasp[:3, :3], (count, 1, 1)),
        steps - rises[:, None],
        len(way[:-1]),
        np.full(count, kind, np.intp),
        np.full(count, heading),
        np.full(count, roll, np.intp),
        np.array([1.0, 0.9, 0.8])[:count],
        touches=name,
    )


def _raised_and_back(approaches: Array, rise: Array | float) -> Array:
    """Compute offsets (n, 3) back along approach directions (n, 3) with the thing raised by ``rise`` [m].

    The height gained by retreating along a tilted approach counts towards it.
    """
    back: Array = -APPROACH * approaches
    back[:, 2] = np.maximum(back[:, 2], rise)
    return back


def classified(rotation: Array, frame: HandFrame) -> tuple[int, float, int]:
    """Classify a tip rotation (3, 3): index in CLASSES, heading [rad] and roll of the nearest class."""
    approach = rotated(rotation, np.asarray(frame.approach))
    closing = rotated(rotation, np.asarray(frame.closing))
    pitch = math.asin(float(np.clip(-approach[2], -1.0, 1.0)))
    grasp = min(range(len(CLASSES)), key=lambda index: abs(CLASSES[index].pitch - pitch))
    if CLASSES[grasp] is GraspClass.TOP:
        return grasp, math.atan2(-closing[0], closing[1]), 1
    heading = math.atan2(approach[1], approach[0])
    left = -math.sin(heading) * closing[0] + math.cos(heading) * closing[1]
    return grasp, heading, 1 if left >= 0 else -1


def upright(angles: Array) -> Array:
    """Rotations (m, 3, 3) about the vertical by angles (m,) [rad]."""
    turns = np.zeros((len(angles), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0] = np.sin(angles)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns


def directions(grasps: list[int], yaws: list[float]) -> Array:
    """Approach directions (n, 3) of grasp classes and headings."""
    pitch = np.array([CLASSES[grasp].pitch for grasp in grasps])
    yaw = np.array(yaws, float)
    return np.stack([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)], axis=-1).reshape(-1, 3)


def oriented(
    text: str,
    points: Array,
    offsets: Array,
    key: int,
    grasps: list[int],
    yaws: list[float],
    rolls: list[int],
    weights: list[float],
    frame: HandFrame,
    *,
    touches: str | None = None,
) -> GraspCandidates:
    """Create candidates with the hand rotations of grasp classes, headings and rolls (1 or -1)."""
    kinds, heading, roll = np.array(grasps, np.intp), np.array(yaws, float), np.array(rolls, np.intp)
    rotations = np.zeros((len(kinds), 3, 3))
    for index, grasp in enumerate(CLASSES):
        mine = np.flatnonzero(kinds == index)
        rotations[mine] = grasp.rotations(heading[mine], roll[mine], frame)
    natural = np.array(weights, float)
    return GraspCandidates(text, points, rotations, offsets, key, kinds, heading, roll, natural, touches)
