"""Paths of one hand with its grips of a handle, followed by inverse kinematics from value to value of the joint.

They are searched for many base poses at once; the best are checked exactly in the planning scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.hand_solutions import base_matrices
from executive.locations.rejections import COLLISION, OUT_OF_REACH, Reason, Rejections, first_body
from executive.modules.furniture.leaf_grips import LAGS, Grips
from executive.motion import Chain, cartesian_path
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, product, rotated
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.joints import Articulation

MOST_WAYS = 240
"""Candidates of a batch to follow to their end; more differ little."""
MOST_CHECKED = 24
"""Candidates of a batch that may fail the exact check before the batch is given up."""
HEIGHTS = 13
"""Torso heights at which to check the lifted upper body for self-collision."""
FARTHEST = 0.5
"""Largest step of an arm joint between two postures [rad, m]."""
LEAVING = (0.25, 0.5, 1.0)
"""Shares of the retreat from the handle at which to check the hand."""


@dataclass(frozen=True, slots=True, eq=False)
class LeafPath:
    """Base pose, grip of the handle, and motion of the arm that moves the leaf from there."""

    arm: ArmModel
    handle: str
    base: BasePose
    fingers: Fingers
    """Opening of the hand for the approach to the handle."""
    before: Array
    """Joint positions of the arm before the handle (d,)."""
    poses: Array
    """Poses of the tip in the map, before the handle and then at each value (1 + n, 4, 4)."""
    values: Array
    """Values of the leaf's joint (n,)."""
    joints: Array
    """Joint positions of the arm at each value (n, d)."""
    ends: NDArray[np.bool_]
    """Values at which the hand can let go of the handle, the last one, too (n,)."""

    def until(self, count: int) -> LeafPath:
        """Cut it to its first ``count`` values."""
        poses, values, joints, ends = (
            self.poses[: 1 + count],
            self.values[:count],
            self.joints[:count],
            self.ends[:count],
        )
        return replace(self, poses=poses, values=values, joints=joints, ends=ends)


def draws_back(scene: PlanningScene, path: LeafPath) -> bool:
    """Check whether the arm can draw its open hand straight back where a path ends, in a scene with the leaf there."""
    arm, start = path.arm, path.joints[-1]
    turned = path.poses[-1][:3, :3] @ path.poses[1][:3, :3].T
    back = rotated(turned, path.poses[0][:3, 3] - path.poses[1][:3, 3])
    there, begin = inverse(base_matrices(np.array([path.base]))[0]), arm.chain.fk(start)[0]

    def is_free(q: Array) -> bool:
        return not scene.collisions.contacts(path.base, arm, q, path.handle, path.fingers)

    def has_line(share: float) -> bool:
        end = path.poses[-1].copy()
        end[:3, 3] += share * back
        return cartesian_path(arm.chain, start, begin, product(there, end), is_free).waypoints is not None

    return any(map(has_line, LEAVING))


def _lifted(scene: PlanningScene, arm: ArmModel) -> Chain:
    """Get the chain of an arm, its torso limited to heights without self-collision of the upper body."""
    if arm.lift is None:
        return arm.chain
    chain, column = arm.chain, arm.lift.column
    heights = np.linspace(chain.lower[column], chain.upper[column], HEIGHTS).tolist()
    free = scene.collisions.lifted(arm, heights)
    if len(free) in (0, HEIGHTS):
        return arm.chain
    return chain.between(arm.lift.joint, min(free), max(free))


class HandPaths:
    """Search for the paths of one arm with its grips of a handle."""

    def __init__(
        self,
        scene: PlanningScene,
        joint: Articulation,
        arm: ArmModel,
        grips: Grips,
        values: Array,
        roomy: NDArray[np.bool_],
        rejected: Rejections,
    ) -> None:
        self._scene, self._joint, self._arm, self._grips, self._values = scene, joint, arm, grips, values
        self._roomy, self._rejected, self._before, self._poses = (
            roomy,
            rejected,
            grips.before,
            grips.along(joint, values),
        )
        lags = np.ones((len(grips), len(LAGS)), bool)
        lags[~grips.turns, 1:] = False
        self._lags = lags
        self._chain = _lifted(scene, arm)

    def of(self, bases: Array, steps: NDArray[np.intp]) -> Iterator[LeafPath]:
        """Yield paths from base poses (m, 3), from which the leaf can move for ``steps`` values (m,), longest first."""
        tried, checked = set[BasePose](), 0
        for base, grip, lag, joints in self._solved(bases, steps):
            if base in tried:
                continue
            path = self._checked(base, grip, lag, joints)
            if path is not None:
                tried.add(base)
                yield path
            elif (checked := checked + 1) == MOST_CHECKED:
                return

    def _solved(self, bases: Array, steps: NDArray[np.intp]) -> list[tuple[BasePose, int, int, Array]]:
        """Solve for base pose, grip, lag, and joint positions (k, d) from before the handle on, longest paths first."""
        # Followed from value to value, each solution seeds the next, so that the arm moves without a jump between
        # branches of its inverse kinematics. All candidates take each step together, as one call of the solver for
        # hundreds of rows is much cheaper than one for each; those that are left behind drop out.
        there = inverse(base_matrices(bases))
        rows, grips, before, start = self._at_handle(bases, there)
        numbers, lags = np.nonzero(self._lags[grips])
        joints = np.zeros((len(numbers), len(self._values) + 1, len(self._arm.joints)))
        joints[:, 0], joints[:, 1] = before[numbers], start[numbers]
        rows, grips = rows[numbers], grips[numbers]
        reached = np.ones(len(rows), np.intp)
        active = np.arange(len(rows))
        for k in range(1, len(self._values)):
            active = active[steps[rows[active]] > k]
            if not len(active):
                break
            targets = product(there[rows[active]], self._poses[grips[active], lags[active], k])
            q, good = self._chain.solve(targets, joints[active, k][:, None])
            joints[active, k + 1] = q
            active = active[good & (np.abs(q - joints[active, k]).max(axis=1) < FARTHEST)]
            reached[active] = k + 1
        order = [row for row in np.argsort(-reached, kind="stable").tolist() if reached[row] > 1]
        poses = [(x, y, yaw) for x, y, yaw in bases.tolist()]
        return [(poses[rows[row]], int(grips[row]), int(lags[row]), joints[row, : reached[row] + 1]) for row in order]

    def _at_handle(self, bases: Array, there: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Find the collision-free starts: rows of bases (w,), grips (w,), joints before and at the handle (w, d).

        ``there``: inverse base poses (m, 4, 4).
        """
        arm, grips = self._arm, self._grips
        rows, numbers, before, start = self._reached(bases, there)
        self._rejected.count([OUT_OF_REACH] * (len(bases) - len(np.unique(rows))))
        check = self._scene.collisions.arm_check(arm, self._joint.handle, grips.fingers)
        poses = base_matrices(bases)[rows]
        hits = [one or other for one, other in zip(check.hit(poses, start), check.hit(poses, before), strict=True)]
        self._rejected.count(Reason(COLLISION, one) for one in hits if one is not None)
        free = np.flatnonzero([one is None for one in hits])
        free = free[:: max(1, len(free) // MOST_WAYS)]
        return rows[free], numbers[free], before[free], start[free]

    def reach(self, bases: Array) -> bool:
        """Check whether the arm reaches a grip from one of base poses (m, 3), ignoring collisions."""
        return len(self._reached(bases, inverse(base_matrices(bases)))[0]) > 0

    def _reached(self, bases: Array, there: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Find the reachable starts, as :meth:`_at_handle` does, ignoring collisions."""
        arm, grips = self._arm, self._grips
        rows, numbers = (grid.ravel() for grid in np.indices((len(bases), len(grips))))
        seeds = np.broadcast_to(arm.seeds, (len(rows), *arm.seeds.shape))
        start, good = self._chain.solve(product(there[rows], grips.starts[numbers]), seeds)
        kept = np.flatnonzero(good)
        q, good = self._chain.solve(product(there[rows[kept]], self._before[numbers[kept]]), start[kept][:, None])
        good &= np.abs(q - start[kept]).max(axis=1) < 2 * FARTHEST
        kept, before = kept[good], q[good]
        # Solve the grip again from before the handle, because the arm will come from there: the first solution may be
        # on another branch, to which no straight line leads.
        q, good = self._chain.solve(product(there[rows[kept]], grips.starts[numbers[kept]]), before[:, None])
        kept = kept[good]
        return rows[kept], numbers[kept], before[good], q[good]

    def _checked(self, base: BasePose, grip: int, lag: int, joints: Array) -> LeafPath | None:
        """Cut a candidate to its collision-free part; None if not even the handle can be grasped and left again."""
        arm, handle, collisions = self._arm, self._joint.handle, self._scene.collisions
        fingers = self._grips.fingers
        assert handle is not None

        def is_free(q: Array, touches: str | None = handle) -> bool:
            contacts = collisions.contacts(base, arm, q, touches, fingers)
            self._rejected.count([Reason(COLLISION, first_body(contacts))] if contacts else [])
            return not contacts

        if collisions.contacts(base) or not (is_free(joints[0], None) and is_free(joints[1])):
            return None
        poses = np.concatenate([self._before[grip][None], self._poses[grip, lag]])
        ends = product(inverse(base_matrices(np.array([base]))[0]), poses[:2])
        line = cartesian_path(self._chain, joints[0], ends[0], ends[1], is_free)
        if line.waypoints is None or np.abs(line.waypoints[-1] - joints[1]).max() > 0.1:
            return None
        closed = collisions.closed_on(base, arm, joints[1], handle, fingers)
        if closed is None:
            self._rejected.add("no hold for the fingers")
            return None
        count = 1 + self._free_steps(base, joints[1:], closed)
        lets_go = self._roomy[:count] & self._leaves(grip, lag, count)
        free = np.flatnonzero(lets_go)
        if not free.any():  # from none, or only from where the leaf is now
            self._rejected.add("no way for the fingers to leave the handle")
            return None
        count = 1 + int(free[-1])
        return LeafPath(
            arm, handle, base, fingers, joints[0], poses, self._values[: len(lets_go)], joints[1:], lets_go
        ).until(count)

    def _leaves(self, grip: int, lag: int, count: int) -> NDArray[np.bool_]:
        """Mark the first ``count`` values of the joint at which the open hand can retreat from the leaf (count,).

        A hand that turned less than the leaf is at an angle to it, with a finger between leaf and handle.
        """
        tips, grips = self._poses[grip, lag, :count], self._grips
        approaches = tips[:, :3, :3] @ grips.approach
        retreats = np.repeat(tips[:, None], len(LEAVING), axis=1)
        retreats[..., :3, 3] -= grips.back * np.multiply.outer(LEAVING, approaches).swapaxes(0, 1)
        # The scene has the leaf at its current value: move the hands there instead of the leaf to each value.
        first = self._joint.motion(float(self._values[0])).inverse().matrix()
        motions = np.stack([product(self._joint.motion(one).matrix(), first) for one in self._values[:count].tolist()])
        check = self._scene.collisions.arm_check(self._arm, self._joint.handle, grips.fingers)
        hits = check.hand_hit(product(inverse(motions)[:, None], retreats).reshape(-1, 4, 4))
        return np.asarray(np.array([one != self._joint.leaf for one in hits]).reshape(count, -1).all(axis=1))

    def _free_steps(self, base: BasePose, rows: Array, fingers: Mapping[str, float]) -> int:
        """Count the collision-free steps of the arm with the fingers closed on the handle and the leaf moving along."""
        scene, arm = self._scene, self._arm
        joints = {**scene.world.configuration().joints, **fingers}
        at = Configuration(base, joints | dict(zip(arm.joints, rows[0].tolist(), strict=True)))
        led = {**scene.belief.led, self._joint.leaf: arm.tip}
        world = scene.supposing(replace(scene.belief.state.with_robot(scene.belief.robot, at), led=led)).world
        for number, row in enumerate(rows[1:]):
            hits = world.contacts(Configuration(base, joints | dict(zip(arm.joints, row.tolist(), strict=True))))
            if hits:
                self._rejected.count([Reason(COLLISION, first_body(hits))])
                return number
        return len(rows) - 1
