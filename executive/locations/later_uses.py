"""Grips that suit what follows: a thing is offered to somebody, or put down somewhere.

A grip suits a use if the hand, with the thing in it, can be where the use needs it from some base pose: the
reachability map covers the height, and the hand itself is collision-free.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_part import Kept
from executive.locations.base_candidates import blocks
from executive.locations.deliveries import Spots
from executive.locations.grasp_candidates import CLASSES, GraspCandidates
from executive.locations.hand_predicates import Stage, candidates_of, delivering, spots_of
from executive.locations.inverse_maps import InverseMaps
from executive.locations.rejections import Rejections
from executive.robots.arms import ArmModel, Held
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, product, rigid
from planlang.kernel import still_computing
from planlang.relations.demands import Reach, ReachKind

UNSERVED = "no grip for what follows"
"""Reason to reject grasps that rule out what the thing is taken for."""
ALIKE = 3
"""Decimals to which grips are compared [m, 1]."""


BEHIND = (0.15, 0.3)
"""Distances behind a hand at which its arm needs as much room as the hand [m]."""
AT_ONCE = 64
"""Number of hand poses that are tested for collisions at once, the most natural ones first."""


class Grip(NamedTuple):
    """Grip of a hand on a thing."""

    arm: str
    kind: tuple[int, int]
    """Index into CLASSES, and roll."""
    offset: tuple[float, ...]
    """Position of the thing in the tip's frame, and its orientation if that matters [m, 1]."""


class LaterUses:
    """Selects grasps by what is done with the thing later; results are cached by where things and fingers are."""

    def __init__(self, scene: PlanningScene, maps: InverseMaps) -> None:
        self._scene, self._maps = scene, maps
        self._known: Kept[dict[tuple[Reach, Grip, object], float]] = Kept()
        self._spots: Kept[dict[tuple[Reach, str], tuple[Spots, ...]]] = Kept()

    def candidates(self, reach: Reach, arm: ArmModel, log: Rejections, stage: Stage) -> list[GraspCandidates]:
        """Generate the candidates of a reach; of a grasp only those that suit all later uses.

        If none does, those that grip the thing higher or lower: on a board, or below one, a few centimetres matter.
        """
        tables = candidates_of(reach, arm, self._scene, log, stage)
        if not reach.then:
            return tables
        kept = self._serving(tables, reach, arm, stage)
        if not kept and stage > Stage.NATURAL:
            kept = self._serving([one for table in tables for one in table.elsewhere()], reach, arm, stage)
        log.add(UNSERVED, max(sum(map(len, tables)) - sum(map(len, kept)), 0))
        return kept

    def _serving(
        self, tables: Iterable[GraspCandidates], reach: Reach, arm: ArmModel, stage: Stage
    ) -> list[GraspCandidates]:
        kept = (table.chosen(self.serving(table, reach, arm, stage)) for table in tables)
        return [table for table in kept if len(table)]

    def serving(
        self, table: GraspCandidates, reach: Reach, arm: ArmModel, stage: Stage = Stage.ALL
    ) -> NDArray[np.bool_]:
        """Check which grasps of a table suit all later uses, as soon as a stage of the search, (n,)."""
        scene, known = self._scene, self._known.of(self._scene.surroundings(), dict)
        body, thing = scene.world.scene.body(reach.body), scene.bodies.pose(reach.body).matrix()
        offsets = product(inverse(rigid(table.rotations, table.points)), thing)
        suits, fingers = np.ones(len(table), bool), scene.arms.fingers(arm)
        for use in reach.then:
            # a thing that is offered, or round and standing, may have any yaw
            turns = use.kind is ReachKind.OFFER or scene.bodies.block(reach.body).round
            for row, offset in enumerate(offsets):
                essential = offset[:3, 3] if turns else offset[:3].ravel()
                kind = int(table.grasps[row]), int(table.rolls[row])
                grip = Grip(arm.name, kind, tuple((essential.round(ALIKE) + 0.0).tolist()))
                if (use, grip, fingers) not in known:
                    held = Held(reach.body, Pose.from_matrix(offset), scene.world.size(reach.body), body.largest_tilt)
                    known[use, grip, fingers] = self._suits(use, arm, held)
                suits[row] &= known[use, grip, fingers] <= stage
        return suits

    def _suits(self, use: Reach, arm: ArmModel, held: Held) -> float:
        """Find the first stage at which an arm that holds a thing like this can perform a use, as far as known; or inf.

        Grips that leave the hand no room to lower the thing from as high as there is room for it come later, and so do
        those that leave none for the arm behind it: it is approximated by the hand at the distances :data:`BEHIND`.
        """
        still_computing()
        if use.arms is not None and arm.name not in use.arms:
            return math.inf
        table = delivering(use, arm, held, self._scene, Rejections(), Stage.ALL, self._spots_of(use, held.name))
        levels = list(
            zip(table.grasps.tolist(), table.rolls.tolist(), table.points[:, 2].round(ALIKE).tolist(), strict=True)
        )
        reached = {
            (grasp, roll, height): len(self._maps(arm, CLASSES[grasp]).rows(height, roll, 0.0, 1).row) > 0  # anywhere
            for grasp, roll, height in dict.fromkeys(levels)
        }
        table = table.chosen(np.array([reached[level] for level in levels], bool))
        if not len(table):
            return math.inf
        # doors that are closed now will have been opened
        shut = self._scene.bodies.shut_doors(use.body) if use.inside else ()
        opened = {None, *(name for leaf in shut for name in self._scene.belief.joints[leaf].bodies)}
        collisions = self._scene.collisions
        check = collisions.arm_check(arm, held.name, (), collisions.near(arm, table.points))

        def free_at(tips: Array) -> NDArray[np.bool_]:
            hits = check.hand_hit(tips.reshape(-1, 4, 4))
            return np.array([hit in opened for hit in hits], bool).reshape(tips.shape[:2])

        first = math.inf
        for part in blocks(len(table), AT_ONCE):  # one free hand is enough
            tips = table.poses(np.arange(part.start, part.stop))[:, : table.key + 1]
            free = free_at(tips)
            roomy = np.flatnonzero(free.all(axis=1))
            if len(roomy) and (use.kind is ReachKind.OFFER or free_at(_behind(tips[roomy], arm)).all(axis=1).any()):
                return Stage.NATURAL
            if free[:, table.key].any():
                first = Stage.ALL
        return first

    def _spots_of(self, use: Reach, name: str) -> tuple[Spots, ...] | None:
        """Find where a use may put a thing down, once for all grips; None if it is offered."""
        if use.kind is ReachKind.OFFER:
            return None
        known = self._spots.of(self._scene.surroundings(), dict)
        if (use, name) not in known:
            known[use, name] = spots_of(use, name, self._scene, Rejections(), Stage.ALL)
        return known[use, name]


def _behind(tips: Array, arm: ArmModel) -> Array:
    """Move tip poses (n, k, 4, 4) back against the approach, by each of some distances, (n, k m, 4, 4)."""
    approach = tips[..., :3, :3] @ np.asarray(arm.frame.approach)
    moved = [tips.copy() for _ in BEHIND]
    for poses, away in zip(moved, BEHIND, strict=True):
        poses[..., :3, 3] -= away * approach
    return np.concatenate(moved, axis=1)
