"""How near a hand gets to where it would take something: a search that yields, for what is not possible.

Base, arm and grip are moved together, by damped least squares from many postures, so that the grip gets into what is
taken and the base onto the floor; then also so that nothing is touched that counts. What remains at best says how far
something is from possible. Of other arms nothing is asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pybullet

from executive.robots import Arm
from planlang.geometry import Array, Pose
from tests.benchmarks.homes.floor import Floor
from tests.support.locations.dense_sampler import Joints, crossed
from tests.support.locations.oracle import Oracle

STARTS, STEPS, DAMPING, LARGEST = 192, 50, 0.02, 0.4
"""Postures that are begun from, and steps of each; damping of these, and the largest move of a joint in one."""
INWARD = 0.2
"""Cosine up to which a hand may come from behind a leaf's front."""
TURNED = 0.1
"""Distance that counts like a radian [m]."""
MET = 0.01
"""What may remain of the distance of a posture that yields to contacts [m]."""
LOOKED_AT, OF, YIELDING = 16, 48, 20
"""Of such postures so many are moved, by so many steps: those of so many that are least deep in something."""
HOPELESS, SOON = 0.03, 8
"""One of which so much remains after so many steps is given up [m]."""
DONE = 2e-4
"""A posture of which no more remains is good [m]."""
LOOKED = 0.002
"""Distances up to this are asked for [m]."""
SPARE = 0.004
"""Room that is left between fingers on both sides together of what fits whole [m]."""


Axis = tuple[int, bool, Array, Array]
"""Link that a joint moves, if it slides, a point (3,) on its axis and that (3,)."""


@dataclass(frozen=True)
class Aim:
    """What a hand takes, wherever it may be: a point of its grip gets into one of some boxes."""

    poses: Sequence[Pose]
    half: Array
    """Half the extents (3,)."""
    outward: Array | None = None
    """Normal (3,) of the front before which it is."""
    between: tuple[float, float, float] | None = None
    """Extents that fit between the fingers as they are turned; None if it is taken by its edge."""
    whole: str = ""
    """Shape that fits whole between the fingers, "box" or "cylinder"; "" if no more is asked than that each extent does
    by itself, which is necessary.
    """
    room: float = math.inf
    """What fits between fingers [m], if that is less than they open."""

    @property
    def frames(self) -> Array:
        """Poses (n, 4, 4) of the boxes."""
        return np.array([pose.matrix() for pose in self.poses])


@dataclass(frozen=True)
class Postures:
    """Bases (n, 3) and joints (n, d) of an arm that are nearest to an aim, in the box (n,) of that number."""

    bases: Array
    joints: Array
    boxes: Array
    left: Array
    """What is left (n,): distances of the grip from the aim and of the base from the floor, turns of the hand [m]."""

    def row(self, number: int) -> Array:
        """Base and joints (3 + d,) of one of them."""
        return np.concatenate([self.bases[number], self.joints[number]])


class Nearest:
    """The nearest postures of a robot's arms."""

    def __init__(self, oracle: Oracle, chain: Joints, arm: Arm, floor: Floor, grip: tuple[float, float]) -> None:
        """Of an arm whose hand takes things between two distances ahead of its tip [m]."""
        self._oracle, self._chain, self._arm, self._floor = oracle, chain, arm, floor
        self._behind, self._ahead = grip
        self._approach = np.array(arm.approach)
        self._room = arm.gripper.max_opening if arm.gripper is not None else 0.0

    def postures(self, aim: Aim, seed: int = 0) -> Postures | None:
        """Return the nearest postures, contacts aside; None if no floor is near."""
        rng, chain = np.random.default_rng(seed), self._chain
        frames = aim.frames
        cells = self._floor.around(frames[:, :2, 3].mean(axis=0))
        if not len(cells):
            return None
        box = rng.integers(len(frames), size=STARTS)
        middle = frames[box, :2, 3]
        # near cells more often than far ones
        some = cells[rng.integers(len(cells), size=(STARTS, 4))]
        near = np.linalg.norm(some - middle[:, None], axis=2).argmin(axis=1)
        base = some[np.arange(STARTS), near]
        ahead = middle - base
        yaw = np.arctan2(ahead[:, 1], ahead[:, 0]) + rng.normal(0.0, 0.8, STARTS)
        x = np.column_stack([base, yaw, rng.uniform(chain.lower, chain.upper, (STARTS, len(chain.names)))])
        best, left = x.copy(), np.full(STARTS, np.inf)
        for _ in range(STEPS):
            rows, residuals, remains = self._aimed(x, frames[box], aim)
            better = remains < left
            best[better], left[better] = x[better], remains[better]
            x = self._moved(x, rows, residuals)
        order = np.argsort(left, kind="stable")
        return Postures(best[order, :3], best[order, 3:], box[order], left[order])

    def yielded(
        self,
        aim: Aim,
        found: Postures,
        prepare: Callable[[int], None],
        may: Callable[[int, str], bool],
        clear: float,
    ) -> Iterator[tuple[float, Array, Array, int]]:
        """Yield what remains of postures that also yield to contacts, with bases (3,), joints (d,) and boxes.

        ``prepare`` puts the bodies where they are for a box; what a link ``may`` touch does not count, from all else it
        is to be ``clear`` by a distance [m].
        """
        frames = aim.frames
        depths_of = {}
        for row in np.flatnonzero(found.left < MET)[:OF].tolist():
            prepare(int(found.boxes[row]))
            depths_of[row] = max(self._contacts(found.row(row), may, clear)[1], default=0.0)
        for row in sorted(depths_of, key=lambda one: depths_of[one])[:LOOKED_AT]:
            box = int(found.boxes[row])
            prepare(box)
            x = found.row(row)
            best = (np.inf, x)
            for step in range(YIELDING):
                rows, residuals, remains = self._aimed(x[None], frames[box][None], aim)
                more, depths = self._contacts(x, may, clear)
                worst = max(float(remains[0]), *depths, 0.0)
                best = min(best, (worst, x), key=lambda one: one[0])
                if worst < DONE or (step >= SOON and best[0] > HOPELESS):
                    break
                x = self._moved(
                    x[None],
                    np.concatenate([rows, np.array(more).reshape(1, -1, len(x))], axis=1),
                    np.concatenate([residuals, np.array(depths).reshape(1, -1)], axis=1),
                )[0]
            yield best[0], best[1][:3], best[1][3:], box

    def _moved(self, x: Array, rows: Array, residuals: Array) -> Array:
        square = rows @ rows.transpose(0, 2, 1) + DAMPING**2 * np.eye(rows.shape[1])
        step = (rows.transpose(0, 2, 1) @ np.linalg.solve(square, residuals[:, :, None]))[:, :, 0]
        x = x + np.clip(step, -LARGEST, LARGEST)
        x[:, 3:] = np.clip(x[:, 3:], self._chain.lower, self._chain.upper)
        return x

    def _aimed(self, x: Array, frames: Array, aim: Aim) -> tuple[Array, Array, Array]:
        """Return rows (n, k, 3 + d), residuals (n, k), and what remains (n,)."""
        number, base, yaw = len(x), x[:, :2], x[:, 2]
        pose, jacobian = self._chain.forward(x[:, 3:])
        turn = np.zeros((number, 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(yaw)
        turn[:, 1, 0] = np.sin(yaw)
        turn[:, 0, 1] = -turn[:, 1, 0]
        turn[:, 2, 2] = 1.0
        shifts, spins = turn @ jacobian[:, :3], turn @ jacobian[:, 3:]
        approach = turn @ pose[:, :3, :3] @ self._approach
        arm = (turn @ pose[:, :3, 3:])[:, :, 0]
        origin = np.zeros((number, 3))
        origin[:, :2] = base
        along = np.einsum("ni,ni->n", frames[:, :3, 3] - arm - origin, approach)
        along = np.clip(along, self._behind, self._ahead)[:, None] * approach
        grip = arm + origin + along
        local = np.einsum("nji,nj->ni", frames[:, :3, :3], grip - frames[:, :3, 3])
        missing = np.einsum("nij,nj->ni", frames[:, :3, :3], np.clip(local, -aim.half, aim.half) - local)
        rows = [self._rows(arm + along, shifts + crossed(spins, along[:, :, None]))]
        home = self._floor.shifts(base)
        standing = np.zeros((number, 2, x.shape[1]))
        standing[:, 0, 0] = standing[:, 1, 1] = (home != 0.0).any(axis=1)
        rows.append(standing)
        remains = np.linalg.norm(missing, axis=1) + np.linalg.norm(home, axis=1)
        residuals = [missing, home]
        for hinge, over in self._hinges(turn @ pose[:, :3, :3], arm, shifts, spins, frames, aim):
            rows.append((hinge * (over > 0)[:, None])[:, None])
            residuals.append(-np.maximum(over, 0.0)[:, None])
            remains = remains + np.maximum(over, 0.0)
        return np.concatenate(rows, axis=1), np.concatenate(residuals, axis=1), remains

    def _hinges(
        self, hand: Array, arm: Array, shifts: Array, spins: Array, frames: Array, aim: Aim
    ) -> Iterator[tuple[Array, Array]]:
        """Yield how far something is over a limit (n,), and how that changes (n, 3 + d)."""
        up, nothing = np.array([0.0, 0.0, 1.0]), np.zeros((len(arm), 2))
        approach = hand @ self._approach

        def turned(line: Array, way: Array) -> Array:
            by_yaw = line[:, 0] * way[:, 1] - line[:, 1] * way[:, 0]
            by_arm = np.einsum("nid,ni->nd", crossed(spins, line[:, :, None]), way)
            return np.concatenate([nothing, by_yaw[:, None], by_arm], axis=1)

        # the ends of the fingers stay over the ground
        every = np.tile(up, (len(arm), 1))
        rising = turned(approach, every) * self._ahead
        rising[:, 3:] += shifts[:, 2]
        yield -rising, -(arm[:, 2] + self._ahead * approach[:, 2])
        if aim.outward is not None:
            outward = np.tile(aim.outward, (len(arm), 1))
            yield TURNED * turned(approach, outward), TURNED * (approach @ aim.outward - INWARD)
        closing = hand @ np.array(self._arm.closing)
        if aim.between is not None and aim.whole:
            room = min(self._room, aim.room) - SPARE
            width, way = widths(aim.whole, aim.between, frames[:, :3, :3], closing)
            yield TURNED * turned(closing, way) / room, TURNED * (width / room - 1.0)
            return
        for axis, extent in enumerate(aim.between or ()):
            if extent > self._room:
                along = frames[:, :3, axis]
                share = np.einsum("ni,ni->n", closing, along)
                sign = np.sign(share)[:, None]
                yield TURNED * turned(closing, along) * sign, TURNED * (np.abs(share) - self._room / extent)

    @staticmethod
    def _rows(arm: Array, shifts: Array) -> Array:
        """Return how a point moves (n, 3, 3 + d) that is ``arm`` (n, 3) from the base's middle."""
        base = np.tile(np.eye(3)[:, :2], (len(arm), 1, 1))
        spin = np.stack([-arm[:, 1], arm[:, 0], np.zeros(len(arm))], axis=1)
        return np.concatenate([base, spin[:, :, None], shifts], axis=2)

    def _contacts(self, x: Array, may: Callable[[int, str], bool], clear: float) -> tuple[list[Array], list[float]]:
        """Return, for each contact of a posture that counts, how it opens (3 + d,), and how deep it is [m]."""
        oracle, chain, arm = self._oracle, self._chain, self._arm
        opened = dict(arm.gripper.opened) if arm.gripper is not None else {}
        base = (float(x[0]), float(x[1]), float(x[2]))
        oracle.place(base, {**oracle.posture, **opened, **dict(zip(chain.names, x[3:].tolist(), strict=True))})
        axes = self._axes()
        found = []
        for link in self._links:
            low, high = pybullet.getAABB(oracle.uid, link, physicsClientId=oracle.client)
            for uid, _ in pybullet.getOverlappingObjects(low, high, physicsClientId=oracle.client) or ():
                body = oracle.pieces.get(uid)
                if body is None or may(link, body):
                    continue
                points = pybullet.getClosestPoints(oracle.uid, uid, LOOKED, link, physicsClientId=oracle.client)
                if points:
                    deepest = min(points, key=lambda one: float(one[8]))
                    found.append((deepest, self._motion(axes, link, x, deepest[5])))
        for point in oracle.pressed_into_itself():
            if {point[3], point[4]} <= self._links:
                one, other = (self._motion(axes, link, x, at) for link, at in zip(point[3:5], point[5:7], strict=True))
                found.append((point, one - other))
        deep = [(np.array(point[7]) @ motion, clear - float(point[8])) for point, motion in found if point[8] < clear]
        return [row for row, _ in deep], [depth for _, depth in deep]

    @cached_property
    def _links(self) -> frozenset[int]:
        """Links of the base and of this arm: all that no other joints move."""
        ours = {self._oracle.joints[name] for name in self._chain.names}
        hand = self._oracle.hand_links(self._arm.name)
        moving = {*self._oracle.joints.values()}
        every = self._oracle.names
        return frozenset(one for one in every if one in hand or (moving & {*self._oracle.upwards(one)}) <= ours)

    def _axes(self) -> list[Axis]:
        """Return for each joint of the chain its link, if it slides, a point on its axis and that, where it is."""
        oracle, chain, found = self._oracle, self._chain, []
        for axis, slides, column in zip(chain.axes, chain.slides, chain.columns, strict=True):
            if column >= 0:
                link = oracle.joints[chain.names[column]]
                frame = oracle.link(oracle.names[link])
                found.append((link, bool(slides), frame[:3, 3], frame[:3, :3] @ axis))
        return found

    def _motion(
        self, axes: Sequence[tuple[int, bool, Array, Array]], link: int, x: Array, at: Sequence[float]
    ) -> Array:
        """Return how a point of a link moves (3, 3 + d)."""
        point, carried = np.array(at), {*self._oracle.upwards(link)}
        found = np.zeros((3, len(x)))
        found[:, :2] = np.eye(3)[:, :2]
        found[:, 2] = (x[1] - point[1], point[0] - x[0], 0.0)
        for column, (joint, slides, origin, axis) in enumerate(axes, 3):
            if joint in carried:
                found[:, column] = axis if slides else np.cross(axis, point - origin)
        return found


def widths(shape: str, size: Sequence[float], turns: Array, ways: Array) -> tuple[Array, Array]:
    """Return how long bodies of a shape and size, turned (n, 3, 3), are along directions (n, 3), and how that changes.

    The second (n, 3) is the derivative by the direction.
    """
    local = np.einsum("nji,nj->ni", turns, ways)
    if shape == "box":
        change = np.sign(local) * np.array(size)
    else:
        across = np.maximum(np.hypot(local[:, 0], local[:, 1]), 1e-9)[:, None]
        change = np.column_stack([local[:, :2] / across * max(size[:2]), np.sign(local[:, 2]) * size[2]])
    return np.einsum("ni,ni->n", local, change), np.einsum("nij,nj->ni", turns, change)
