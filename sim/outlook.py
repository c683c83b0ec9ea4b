"""Broad phase over time: the pairs that a motion may bring into contact in its next steps.

A motion is known before it is played. While the boxes around its moving parts are clear of all other boxes, nothing can
touch, and the robot need not be moved in PyBullet to find that out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import cross_matrix, inverse, moved, product, rigid, rotated, rotations
from planlang.geometry.shapes import overlaps
from planlang.records import dataclass
from sim.contact import GROUND, Contacts, Query
from sim.engine import bullet
from sim.robot import BASE, Robot

AHEAD = 96
"""World steps examined at once."""
MARGIN = 1e-4
"""Margin of boxes [m]: PyBullet returns link frames in single precision."""

Pairs = tuple[tuple[str, str], ...]


@dataclass(slots=True)
class Outlook:
    """Pairs that may touch in the next steps of the only motion in progress, valid while nothing else changes."""

    contacts: Contacts
    here: Callable[[], object]
    """Restores the robot's current configuration in the client."""
    _motion: object = None
    _row: int = -1
    """The last row queried."""
    _seen: object = None
    """State of the other bodies at that query."""
    _pairs: list[Pairs] = field(default_factory=list)
    """Pairs that may touch at the following rows, in reverse order."""

    def among(self, motion: object, names: Sequence[str], rows: Array, row: int, query: Query) -> Pairs | None:
        """Find the only pairs that can touch at a row of a motion; None if unknown, as after a change.

        The robot is at the row before. ``names`` are the coordinates that the motion moves, ``rows`` (k, len(names))
        their values, ``query`` is the contact query of the motion.
        """
        held = tuple((name, one.link, one.offset, one.moves) for name, one in self.contacts.held.items())
        seen = self.contacts.bodies.moves, held
        goes_on = motion is self._motion and row == self._row + 1 and seen == self._seen
        self._motion, self._row, self._seen = motion, row, seen
        if not goes_on or not all(moves for *_, moves in held):
            self._pairs.clear()
            return None
        if not self._pairs:
            self.here()
            self._pairs = _candidate_pairs(self.contacts, query, names, rows[row : row + AHEAD])[::-1]
        return self._pairs.pop()


def _candidate_pairs(contacts: Contacts, query: Query, names: Sequence[str], rows: Array) -> list[Pairs]:
    """Find the pairs that may touch at each row of a motion that starts at the configuration shown."""
    robot, bodies = contacts.robot, contacts.bodies
    carried = [index for name in contacts.held for index in bodies.of[name]]
    carried_names = [bodies.pieces[index].body for index in carried]
    links = robot.solid + [robot.links[contacts.held[name].link] for name in carried_names]
    motions = displacements(robot, names, rows, links)
    center, spans, half = (np.concatenate(both) for both in zip(robot.spans(), bodies.spans(carried), strict=True))
    boxes = _Boxes(moved(motions, center), product(motions[..., :3, :3], spans), half + MARGIN)
    lower, upper = _corners(boxes)
    every = bodies.within(lower.min(axis=(0, 1)) - MARGIN, upper.max(axis=(0, 1)) + MARGIN).tolist()
    center, spans, half = bodies.spans(every)
    around = _Boxes(center[None], spans[None], half)
    parts, others = robot.solid_names + carried_names, [bodies.pieces[index].body for index in every]
    pairs_of_rows: list[dict[tuple[str, str], None]] = [{} for _ in rows]
    for row, one, other in _near(boxes, around, _with_bodies(contacts, query, carried, every)):
        pairs_of_rows[row][parts[one], others[other]] = None
    for row, one, other in _near(boxes, boxes, _with_each_other(contacts, query, names, carried)):
        pairs_of_rows[row][parts[one], parts[other]] = None
    return [tuple(pairs) for pairs in pairs_of_rows]


@dataclass(frozen=True, slots=True, eq=False)
class _Boxes:
    """Oriented boxes at each of k rows; k is 1 for boxes that do not move."""

    center: Array
    """(k, n, 3)"""
    spans: Array
    """(k, n, 3, 3) axes, as columns."""
    half: Array
    """(n, 3) half extents along the axes [m]."""


def _near(boxes: _Boxes, others: _Boxes, may: NDArray[np.bool_]) -> Iterator[tuple[int, int, int]]:
    """Yield the rows at which boxes overlap others, with the numbers of both, among the pairs ``may`` (n, m).

    Map-aligned boxes first, over the whole motion, then per row; then separating axes, face normals only.
    """
    (lower, upper), (its_lower, its_upper) = map(_corners, (boxes, others))
    along = overlaps(lower.min(axis=0), upper.max(axis=0), its_lower.min(axis=0), its_upper.max(axis=0))
    first, second = np.nonzero(may & along)
    near = ((lower[:, first] <= its_upper[:, second]) & (upper[:, first] >= its_lower[:, second])).all(axis=2)
    rows, pairs = np.nonzero(near)
    first, second = first[pairs], second[pairs]
    mine, its = (rows, first), (rows % len(its_lower), second)
    offsets, to_other = others.center[its] - boxes.center[mine], np.swapaxes(boxes.spans[mine], 1, 2)
    turn, half, its_half = product(to_other, others.spans[its]), boxes.half[first], others.half[second]
    apart = np.abs(rotated(to_other, offsets)) > half + rotated(np.abs(turn), its_half)
    from_other, back = np.swapaxes(others.spans[its], 1, 2), np.swapaxes(turn, 1, 2)
    apart |= np.abs(rotated(from_other, offsets)) > its_half + rotated(np.abs(back), half)
    meets = ~apart.any(axis=1)  # no axis of one of the two boxes separates them
    yield from zip(rows[meets].tolist(), first[meets].tolist(), second[meets].tolist(), strict=True)


def _corners(boxes: _Boxes) -> tuple[Array, Array]:
    """Compute the lower and upper corners (k, n, 3) of map-aligned boxes around boxes."""
    reach = rotated(np.abs(boxes.spans), boxes.half)
    return boxes.center - reach, boxes.center + reach


def _with_bodies(contacts: Contacts, query: Query, carried: Sequence[int], every: Sequence[int]) -> NDArray[np.bool_]:
    """Select which pieces of other bodies, among m, may meet links and carried pieces (n, m)."""
    robot, bodies = contacts.robot, contacts.bodies
    is_carried, yields = np.isin(every, carried), np.array([bodies.pieces[k].yields for k in every], bool)
    may = np.zeros((len(robot.solid) + len(carried), len(every)), bool)
    may[sorted(_moving(contacts, query))] = True
    for row, k in zip(may[len(robot.solid) :], carried, strict=True):
        row[:] = bool(_carriers(contacts, k) & _moving(contacts, query))
    may[sorted(contacts.hands)] &= ~yields
    may[len(robot.solid) :] &= ~yields
    may[sorted(robot.grounded)] &= bodies.upper[every, 2] >= GROUND
    return np.asarray(may & ~is_carried)


def _with_each_other(
    contacts: Contacts, query: Query, names: Sequence[str], carried: Sequence[int]
) -> NDArray[np.bool_]:
    """Select which links and carried pieces may meet each other (n, n), the lower number first."""
    robot, moving = contacts.robot, _moving(contacts, query)
    count = len(robot.solid)
    may = np.zeros((count + len(carried),) * 2, bool)
    if query.itself:
        may[:count, :count] = contacts.watched & robot.moved_apart(frozenset(names))
    for number, k in enumerate(carried, count):
        name, together = contacts.bodies.pieces[k].body, bool(_carriers(contacts, k) & moving)
        if query.itself:
            meets = frozenset(range(count)) if together else moving
            may[sorted(meets - contacts.held[name].hand), number] = True
        for other, mate in enumerate(carried[: number - count], count):
            may[other, number] = contacts.bodies.pieces[mate].body != name
    return may


def _moving(contacts: Contacts, query: Query) -> frozenset[int]:
    return frozenset(range(len(contacts.robot.solid))) if query.links is None else query.links


def _carriers(contacts: Contacts, index: int) -> frozenset[int]:
    return contacts.carriers(contacts.held[contacts.bodies.pieces[index].body])


def displacements(robot: Robot, names: Sequence[str], rows: Array, links: Sequence[int]) -> Array:
    """Compute how links, by index, move from where they are shown to coordinate values (k, len(names)).

    Rigid motions (k, n, 4, 4) in the map, to single precision.
    """
    turned: dict[int, Array] = {}
    base = np.tile(np.array(robot.base), (len(rows), 1))
    for name, values in zip(names, rows.T, strict=True):
        if name in BASE:
            base[:, BASE.index(name)] = values
            continue
        by = values - robot.shown[name]
        turned[robot.joints[name]] = by
        turned |= {index: one.multiplier * by for index, one in robot.followers.get(name, ())}
    back = inverse(Pose.planar(*robot.base).matrix())
    motions = {-1: product(Pose.matrices(Pose.planar(*place) for place in base.tolist()), back)}

    def nearest(above: Sequence[int]) -> int:
        return next((index for index in above if index in turned), -1)

    for index in sorted(turned):  # a link's number is above that of what carries it
        motions[index] = product(motions[nearest(robot.ancestors(index)[1:])], _motion(robot, index, turned[index]))
    return np.stack([motions[nearest(robot.ancestors(link))] for link in links], axis=1)


def _motion(robot: Robot, index: int, by: Array) -> Array:
    """Compute the motions (k, 4, 4) in the map of a joint's link by angles or distances (k,) (Rodrigues' formula)."""
    info = bullet.getJointInfo(robot.uid, index, physicsClientId=robot.client)
    state = bullet.getLinkState(robot.uid, index, computeForwardKinematics=True, physicsClientId=robot.client)
    axis, point = rotated(rotations(np.array([state[1]]))[0], np.array(info[13])), np.array(state[4])
    if info[2] == bullet.JOINT_PRISMATIC:
        return rigid(np.tile(np.eye(3), (len(by), 1, 1)), by[:, None] * axis)
    cross, by = cross_matrix(axis), by[:, None, None]
    turns = np.eye(3) + np.sin(by) * cross + (1 - np.cos(by)) * product(cross, cross)
    return rigid(turns, point - rotated(turns, point))
