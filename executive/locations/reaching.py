"""Places for the base from which a hand can do what is asked: candidates of the maps, judged block by block.

Spheres inside the arm and warm-started inverse kinematics rule out most of them, the planning world judges the rest
one by one, only as many as are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from executive.belief.free_floor import BasePose
from executive.belief.visibility import Unseen
from executive.locations.between import between
from executive.locations.blind import Blind
from executive.locations.candidates import Candidates, Conjunct, Misses, invert
from executive.locations.effort import Effort
from executive.locations.hand_ways import ways_of
from executive.locations.judging import PLACES, BaseJudge, scored, unmet
from executive.locations.reach import Reach, ReachSolution, hand_is_stopped
from executive.locations.rejections import Rejections
from executive.locations.relations import BaseDemand
from executive.locations.solving import OFF_LATTICE, ON_LATTICE, arms_have_room, solve, unblocked
from executive.locations.ways import CLASSES, Ways
from executive.motion import QuickCheck
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.protocols import Solution

ALIKE = 0.06
"""A candidate this near to one that failed exactly, with the hand from the same side, is judged last [m]."""
AT_ONCE = 2048
"""Places of which room is looked at in one go, at most."""
TRAVEL = 8.0
"""Distance over which a place loses most of its worth [m]."""


class ReachingSearch:
    """One search for places from which all that is wanted can be reached."""

    def __init__(
        self,
        judge: BaseJudge,
        wanted: Sequence[Reach],
        demand: BaseDemand,
        arms: Sequence[ArmModel],
        effort: Effort,
        log: Rejections,
        is_taken: Callable[[BasePose], bool] | None = None,
    ) -> None:
        """``is_taken`` tells of which places nothing needs to be known any more."""
        self.is_taken = is_taken
        self.judge, self.scene, self.inverse = judge, judge.scene, judge.inverse
        self.wanted, self.demand, self.arms, self.effort, self.log = wanted, demand, arms, effort, log

    def places(self) -> Iterator[Solution]:
        """Places from which the first reach is possible by the maps, judged block by block."""
        scene, judge, effort, log = self.scene, self.judge, self.effort, self.log
        first = self.wanted[0]
        asked = [(arm, ways_of(first, arm, scene, log, effort.extent)) for arm in judge.arms_for(first, self.arms)]
        possible = [(arm, ways) for arm, ways in asked if ways is not None]
        if not possible:
            return
        reach = max(self.inverse(arm, CLASSES[g]).reach for arm, ways in possible for g in set(ways.grasps.tolist()))
        near = _sphere([ways.points for _, ways in possible], reach)
        hands, checks = [], []
        for arm, ways in possible:
            check = scene.collisions.arm_check(arm, ways.touches, opened=ways.opened, near=near)
            if len(free := unblocked(ways, check, log)):
                hands.append((arm, free))
                checks.append(check)
        if not hands:
            return
        middle = np.mean([ways.points.mean(axis=0) for _, ways in hands], axis=0)
        spread = max(float(np.linalg.norm(ways.points[:, :2] - middle[:2], axis=1).max()) for _, ways in hands)
        floor = scene.collisions.floor()
        room = floor.field((float(middle[0]), float(middle[1])), scene.bodies.block(first.body).yaw, spread + reach)
        bands = [(reach.body, judge.band(reach, self.arms)) for reach in self.wanted[1:]]
        conjuncts: list[Conjunct] = [(f"not in reach of {body}", partial(_within, *band)) for body, band in bands]
        conjuncts += [(unmet(term), partial(scored, term)) for term in self.demand.areas]
        found = invert(
            hands,
            self.inverse,
            room,
            conjuncts,
            scene.collisions.lifted,
            misses=self._unseen() if effort.fine else None,
            least=effort.least,
            rows=effort.rows,
            each=effort.each,
        )
        log.scored.append((found.bases, found.scores))
        log.add("no room for the base", found.without_room)
        for reason, number in found.unwanted.items():
            log.add(reason, number)
        log.add("not visible", found.unseen)
        if not len(found) and not found.without_room and not found.unwanted.total() and not found.unseen:
            log.add("out of reach", sum(len(ways) for _, ways in hands))
        if log.explained:
            judge.name_crowding(found.crowded, log)
        if len(found):
            some, stance = False, scene.collisions.stance_check(near)
            for solution in self._in_blocks(found, hands, checks, middle, stance):
                some = True
                yield solution
            if effort.then is not None and not some and self.is_taken is None:
                moved = between(found, floor, middle[:2], room.yaw, effort.most)
                then = self._between(effort.then)
                yield from then._in_blocks(moved, hands, checks, middle, stance, self._unseen()) if len(moved) else ()
        if not log.explained:
            judge.name_crowding(found.crowded, log)

    def _between(self, effort: Effort) -> ReachingSearch:
        """The same search for candidates that have been looked at elsewhere already: they are not counted again."""
        log = self.log
        log = Rejections(log.explained, places=log.places, scored=log.scored, refused=log.refused)
        return ReachingSearch(self.judge, self.wanted, self.demand, self.arms, effort, log)

    def _unseen(self) -> Misses | None:
        """Tells from which bases the robot itself is in the way of seeing what has to be seen."""
        view = self.scene.visibility.own_view()
        names = self.judge.to_see(self.demand)
        if view is None or not names:
            return None
        each = [Unseen(view, self.scene.bodies.block(name)) for name in names]
        return lambda bases: np.any([unseen(bases) for unseen in each], axis=0)

    def _in_blocks(
        self,
        found: Candidates,
        hands: Sequence[tuple[ArmModel, Ways]],
        checks: Sequence[QuickCheck],
        middle: Array,
        stance: QuickCheck,
        misses: Misses | None = None,
    ) -> Iterator[Solution]:
        scene, effort, log = self.scene, self.effort, self.log
        x, y, _ = scene.base()
        order = found.order(lambda bases: np.exp(-np.hypot(bases[:, 0] - x, bases[:, 1] - y) / TRAVEL), effort.most)
        found = found.chosen(order)
        bases = np.column_stack([found.bases[:, :2], np.arctan2(np.sin(found.bases[:, 2]), np.cos(found.bases[:, 2]))])
        bases = bases.round(PLACES)  # as they are told
        floor, judged, undecided = scene.collisions.floor(), 0, np.ones(len(found), bool)
        blind = Blind(middle[:2], strict=effort.fine)
        failed = _Failed()
        failures: dict[tuple[int, int], tuple[ReachSolution, BasePose]] = {}
        stopped: dict[tuple[int, int], bool] = {}
        bodies_around = frozenset(scene.bodies.names())
        postponed: list[tuple[int, ReachSolution]] = []

        def is_stopped(number: int, way: int) -> bool:
            """Whether the hand itself is in something, so that no place of a way that has failed before will do."""
            key = (number, way)
            if key in failures and key not in stopped:
                stopped[key] = hand_is_stopped(*failures[key], scene, checks[number])
            return stopped.get(key, False)

        def standing() -> Iterator[NDArray[np.intp]]:
            """Candidates with room for base and arms, block by block; looked at in ever larger parts."""
            waiting, first, size = np.zeros(0, np.intp), 0, effort.block
            while first < len(found):
                rows = np.arange(first, min(first + size, len(found)))
                first, size = first + size, min(2 * size, AT_ONCE)
                roomy = floor.holds(bases[rows])
                log.add("no room for the base", int((~roomy).sum()))
                undecided[rows] = roomy
                rows = rows[roomy]
                undecided[rows] = arms_have_room(bases[rows], stance, log)
                waiting = np.append(waiting, rows[undecided[rows]])
                while len(waiting) >= effort.block or (len(waiting) and first >= len(found)):
                    yield waiting[: effort.block]
                    waiting = waiting[effort.block :]

        def looked_at() -> Iterator[tuple[int, ReachSolution, bool]]:
            """Candidates that spheres and inverse kinematics leave; those like others that failed once more at last."""
            for rows in standing():
                undecided[rows] = [not is_stopped(int(found.arms[row]), int(found.ways[row])) for row in rows]
                rows = rows[undecided[rows]]
                undecided[rows], joints = self._solved(found, rows, bases, hands, checks)
                rows = rows[undecided[rows]]
                if misses is not None and len(rows):
                    undecided[rows] = ~misses(bases[rows])
                    rows = rows[undecided[rows]]
                for row in rows.tolist():
                    arm, ways = hands[int(found.arms[row])]
                    solution = ReachSolution(self.wanted[0], arm, ways.plan(int(found.ways[row])), joints[row])
                    yield row, solution, True
            if effort.fine:
                for row, solution in postponed:
                    yield row, solution, False

        for row, solution, first in looked_at():
            number, way = int(found.arms[row]), int(found.ways[row])
            base = bases[row]
            place = (float(base[0]), float(base[1]), float(base[2]))
            heading = float(hands[number][1].headings[way])
            if (self.is_taken is not None and self.is_taken(place)) or is_stopped(number, way):
                undecided[row] = False
                continue
            if first and (failed.near(number, base, heading) or blind.covers(base)):
                postponed.append((row, solution))
                continue
            if judged >= effort.exact:
                log.add("not looked at", int(undecided.sum()))
                return
            undecided[row] = False
            score = float(found.scores[row])
            answer = self.judge.complete(place, score, solution, self.wanted, self.demand, blind, log, checks[number])
            if isinstance(answer, Solution):
                yield answer
                continue
            judged += 1
            failed.add(number, base, heading)
            if answer in bodies_around:
                failures.setdefault((number, way), (solution, place))

    def _solved(
        self,
        found: Candidates,
        rows: NDArray[np.intp],
        bases: Array,
        hands: Sequence[tuple[ArmModel, Ways]],
        checks: Sequence[QuickCheck],
    ) -> tuple[NDArray[np.bool_], dict[int, Array]]:
        """Which candidates (rows) have joint values as far as spheres tell, and these (k, d) by row."""
        ok = np.zeros(len(rows), bool)
        joints: dict[int, Array] = {}
        for number, (arm, ways) in enumerate(hands):
            for grasp in np.unique(ways.grasps):
                mine = np.flatnonzero(
                    (found.arms[rows] == number) & (ways.grasps[found.ways[rows] % len(ways)] == grasp)
                )
                if not len(mine):
                    continue
                chosen = rows[mine]
                forward = self.inverse(arm, CLASSES[int(grasp)]).forward
                seeds = forward.seeds(found.rows[chosen], found.torsos[chosen])
                slack = OFF_LATTICE if arm.lift is None else ON_LATTICE
                solved = solve(
                    ways,
                    found.ways[chosen],
                    bases[chosen],
                    arm,
                    seeds[:, None],
                    checks[number],
                    slack=slack,
                )
                self.log.count(solved.reasons)
                ok[mine] = [reason is None for reason in solved.reasons]
                joints |= zip(chosen.tolist(), solved.joints, strict=True)
        return ok, joints


def _within(centre: tuple[float, float], least: float, most: float, bases: Array) -> Array:
    """1 for bases (m, 3) between two distances [m] from a place, 0 for others."""
    away = np.linalg.norm(bases[:, :2] - centre, axis=1)
    return np.where((away >= least) & (away <= most), 1.0, 0.0)


def _sphere(points: Sequence[Array], reach: float) -> tuple[Array, float]:
    """Middle (3,) and radius [m] of all that a robot may meet that reaches tip positions (n, 3)."""
    every = np.concatenate(points)
    return every[0], float(np.linalg.norm(every - every[0], axis=1).max()) + reach


class _Failed:
    """Places that failed exactly: those near to them, with the hand from the same side, are not judged next."""

    def __init__(self) -> None:
        self._places: list[tuple[int, float, float, float]] = []

    def add(self, arm: int, base: Array, heading: float) -> None:
        """One more."""
        self._places.append((arm, float(base[0]), float(base[1]), heading))

    def near(self, arm: int, base: Array, heading: float) -> bool:
        """Whether a place nearly like this one has failed."""
        x, y = float(base[0]), float(base[1])
        return any(
            number == arm
            and abs(other_x - x) + abs(other_y - y) < ALIKE
            and abs(math.remainder(heading - before, 2 * math.pi)) < 0.3
            for number, other_x, other_y, before in self._places
        )
