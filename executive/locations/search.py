"""Base poses from which a hand can do what is asked: candidates of the maps, validated block by block.

Spheres inside the arm and warm-started inverse kinematics rule out most of them, the planning scene the rest, one by
one, only as many as are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose
from executive.locations.areas import Facing
from executive.locations.base_candidates import BaseCandidates, Conjunct, Inversion, Misses, moved_to_room
from executive.locations.demands import BaseDemand, Reach
from executive.locations.grasp_candidates import CLASSES, Hand
from executive.locations.hand_predicates import Stage, candidates_of
from executive.locations.hand_solutions import (
    OFF_LATTICE,
    ON_LATTICE,
    HandSolution,
    Trial,
    arms_have_room,
    as_keys,
    once,
    solve,
    unblocked,
)
from executive.locations.rejections import (
    NO_HOLD,
    NO_ROOM,
    NO_WAY,
    NOT_LOOKED_AT,
    NOT_VISIBLE,
    OUT_OF_REACH,
    FreeHands,
    Rejections,
)
from executive.locations.validation import PLACES, BaseValidator, SelfOcclusion, scored, unmet
from executive.motion import QuickCheck
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.protocols import Solution

ALIKE = 0.06
"""A candidate this near to one that failed exactly, with the hand from the same side, is validated last [m]."""
AT_ONCE = 2048
"""Base poses of which room is looked at in one go, at most."""
TRAVEL = 8.0
"""Distance over which a base pose loses most of its worth [m]."""


ALL = 1_000_000
"""More rows than a map has, more base poses than a candidate."""


@dataclass(frozen=True, slots=True)
class SearchBudget:
    """Bounds of one search."""

    stage: Stage
    least: float
    """Score of a map's rows that are used."""
    rows: int
    """So many of them for each height of the torso."""
    each: int
    """Base poses of one candidate."""
    most: int
    """Base poses in all."""
    block: int
    """Base poses whose inverse kinematics is solved at once."""
    exact: int
    """Base poses that are validated exactly."""
    then: SearchBudget | None = None
    """Bounds for base poses between those of the maps, when there is nothing at these: no more is looked for then."""

    @property
    def fine(self) -> bool:
        """Return True if not only natural candidates are looked at."""
        return self.stage > Stage.NATURAL


BETWEEN = SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=12_000, block=512, exact=500)
BUDGETS = (
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=16, most=384, block=48, exact=40),
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=256, most=6_000, block=48, exact=80),
    SearchBudget(Stage.ALL, least=0.05, rows=400, each=128, most=12_000, block=128, exact=150),
    SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=40_000, block=512, exact=500, then=BETWEEN),
)


class ReachSearch:
    """A search for base poses from which all that is wanted can be reached."""

    def __init__(
        self,
        validator: BaseValidator,
        wanted: Sequence[Reach],
        demand: BaseDemand,
        arms: Sequence[ArmModel],
        budget: SearchBudget,
        log: Rejections,
        is_taken: Callable[[BasePose], bool] | None = None,
    ) -> None:
        """``is_taken`` tells of which base poses nothing needs to be known any more."""
        self.is_taken = is_taken
        self.validator, self.scene, self.inverse = validator, validator.scene, validator.inverse
        self.wanted, self.demand, self.arms, self.budget, self.log = wanted, demand, arms, budget, log
        self.again = bool(demand.remembered)
        """True if the same was looked at before with more to be seen: what an arm cannot do is left out."""
        self.crowded: list[tuple[float, Array]] = []
        """Scores and base poses of grasp candidates without any that has room: named if nothing is found at last."""
        self.inverted = False
        """True once maps have given a base pose."""

    def places(self) -> Iterator[Solution]:
        """Yield base poses from which the first reach is possible by the maps, validated block by block."""
        scene, validator, budget, log = self.scene, self.validator, self.budget, self.log
        free = self._free_hands()
        hands, reach, near = free.hands, free.reach, free.near
        if not hands:
            return
        middle = np.mean([hand.candidates.points.mean(axis=0) for hand in hands], axis=0)
        aside = [np.linalg.norm(hand.candidates.points[:, :2] - middle[:2], axis=1).max() for hand in hands]
        bands = [(reach.body, validator.band(reach, self.arms)) for reach in self.wanted[1:]]
        log.hopeless = self._is_hopeless(middle[:2], float(max(aside)) + reach, bands)
        before = log.counts[NOT_VISIBLE]
        floor, block = scene.collisions.floor(), scene.bodies.block(self.wanted[0].body)
        room = floor.field((float(middle[0]), float(middle[1])), block.yaw, float(max(aside)) + reach)
        conjuncts: list[Conjunct] = [(f"not in reach of {body}", partial(_within, *band)) for body, band in bands]
        conjuncts += [(unmet(term), partial(scored, term)) for term in self.demand.areas]
        if log.findings.walled:
            drivable = scene.collisions.drivable()
            if not drivable.comes_near(middle[:2], float(max(aside)) + reach):
                log.add(NO_WAY, sum(len(hand.candidates) for hand in hands))
                return
            conjuncts.append((NO_WAY, lambda bases: drivable(bases).astype(float)))
        inversion = Inversion(room, conjuncts, self._unseen() if budget.fine else None, budget.each, budget.most)
        lifted = scene.collisions.lifted
        found = inversion.of(hands, self.inverse, lifted, least=budget.least, rows=budget.rows)
        log.scored.append((found.bases, found.scores))
        for reason, number in inversion.refused.items():
            log.add(reason, number)
        if not len(found) and not inversion.refused.total():
            log.add(OUT_OF_REACH.text, sum(len(hand.candidates) for hand in hands))
        self.crowded = inversion.crowded()
        if log.explained:
            validator.name_crowding(self.crowded, log)
        if len(found):
            self.inverted = True
            some, stance = False, scene.collisions.stance_check(near)
            for solution in self._in_blocks(found, hands, middle, stance):
                some = True
                yield solution
            if budget.then is not None and not some and self.is_taken is None:
                crowded = found.chosen(~self._have_room(_as_told(found.bases)))
                moved = moved_to_room(crowded, floor, middle[:2], room.yaw, budget.most)
                then = ReachSearch(validator, self.wanted, self.demand, self.arms, budget.then, log.uncounted())
                yield from then._in_blocks(moved, hands, middle, stance, self._unseen()) if len(moved) else ()
                log.findings.unseen |= then.log.counts[NOT_VISIBLE] + then.log.counts[NOT_LOOKED_AT] > 0
        log.findings.unseen |= log.counts[NOT_VISIBLE] > before or log.counts[NOT_LOOKED_AT] > 0

    def _free_hands(self) -> FreeHands:
        """Return the grasp candidates of the first reach in which the hand itself is inside nothing; count others."""
        known, stage = self.log.findings.hands, self.budget.stage
        if stage not in known:
            known[stage] = self._find_hands()
        self.log.include(known[stage].counted)
        return known[stage]

    def _find_hands(self) -> FreeHands:
        scene, first, counted, stage = self.scene, self.wanted[0], Rejections(), self.budget.stage
        arms = self.validator.arms_for(first, self.arms)
        possible = [(arm, candidates_of(first, arm, scene, counted, stage)) for arm in arms]
        tables = [(arm, table) for arm, found in possible for table in found]
        if not tables:
            return FreeHands([], 0.0, (np.zeros(3), 0.0), counted)
        reach = max(self.inverse(arm, CLASSES[g]).reach for arm, table in tables for g in set(table.grasps.tolist()))
        varied = stage is Stage.CLOSEST
        points = [one.points for arm, table in tables for one in (table.variants(arm.openings) if varied else [table])]
        near = _sphere(points, reach)
        hands = [hand for arm, found in possible for hand in unblocked(arm, found, scene, counted, near, varied=varied)]
        return FreeHands(hands, reach, near, counted)

    def _is_hopeless(
        self, middle: Array, radius: float, bands: Sequence[tuple[str, tuple[tuple[float, float], float, float]]]
    ) -> bool:
        """Return whether a conjunct about the base holds nowhere within a radius [m] of a place (2,)."""
        areas = (term for term in self.demand.areas if not isinstance(term, Facing))
        apart = any(math.dist(middle, centre) > radius + most for _, (centre, _, most) in bands)
        return apart or not all(term.nearly(middle[None], radius)[0] for term in areas)

    def _unseen(self) -> Misses | None:
        """Return a test of the bases from which the robot itself hides what has to be seen."""
        names, visibility = self.validator.to_see(self.demand), self.scene.visibility
        each = [unseen for name in names if (unseen := visibility.unseen(name)) is not None]
        return (lambda bases: np.any([unseen(bases) for unseen in each], axis=0)) if each else None

    def _have_room(self, bases: Array) -> NDArray[np.bool_]:
        """Return at which bases (n, 3) there is room for the base, each looked at once for a location."""
        floor = self.scene.collisions.floor()
        return np.array(once(self.log.findings.rooms, bases, lambda new: floor.holds(new).tolist()), bool)

    def _in_blocks(
        self,
        found: BaseCandidates,
        hands: Sequence[Hand],
        middle: Array,
        stance: QuickCheck,
        misses: Misses | None = None,
    ) -> Iterator[Solution]:
        scene, budget, log, validator = self.scene, self.budget, self.log, self.validator
        x, y, _ = scene.base()
        order = found.order(lambda bases: np.exp(-np.hypot(bases[:, 0] - x, bases[:, 1] - y) / TRAVEL), budget.most)
        found = found.chosen(order)
        bases, validated, undecided = _as_told(found.bases), 0, np.ones(len(found), bool)
        occlusion = SelfOcclusion(middle[:2], strict=budget.fine)
        failed = _Failed()
        failures: dict[tuple[int, int], tuple[HandSolution, BasePose]] = {}
        stopped: dict[tuple[int, int], bool] = {}
        bodies_around = frozenset(scene.bodies.names())
        postponed: list[tuple[int, HandSolution]] = []
        clumsy: set[tuple[float, ...]] = set()

        def known(rows: NDArray[np.intp]) -> list[bytes]:
            """Return what candidates are known by when the same is looked at again."""
            numbers = np.full(len(rows), float(budget.stage)), found.arms[rows], found.candidates[rows]
            return as_keys(np.column_stack([*numbers, found.torsos[rows], bases[rows]]))

        def remember(rows: NDArray[np.intp]) -> None:
            """Remember those of some candidates that arms cannot do."""
            if not self.again:
                log.findings.met.update(known(rows[~undecided[rows]]))

        def is_stopped(number: int, candidate: int) -> bool:
            """Return whether the hand itself is in something: then no base pose of a candidate that failed will do.

            To look at this takes as long as to validate many base poses: it is for when there are many.
            """
            key = (number, candidate)
            if key in failures and key not in stopped and 2 * validated > budget.exact:
                stopped[key] = Trial(*failures[key], scene, hands[number].check).hand_is_stopped()
            return stopped.get(key, False)

        def posture(row: int) -> tuple[float, ...]:
            """Return what an arm's posture depends on: with the same, a robot that touches itself does so anywhere."""
            number, candidate = int(found.arms[row]), int(found.candidates[row])
            mine = hands[number].candidates
            of_hand = int(mine.grasps[candidate]), int(mine.rolls[candidate]), float(mine.points[candidate, 2])
            return number, *of_hand, int(found.rows[row]), float(found.torsos[row])

        def is_hopeless(row: int) -> bool:
            """Return whether no base pose will do for a candidate, or none for a posture."""
            if clumsy and posture(row) in clumsy:
                return True
            return is_stopped(int(found.arms[row]), int(found.candidates[row]))

        def standing() -> Iterator[NDArray[np.intp]]:
            """Yield candidates with room for base and arms, block by block; looked at in ever larger parts."""
            waiting, first, size = np.zeros(0, np.intp), 0, budget.block
            while first < len(found):
                rows = np.arange(first, min(first + size, len(found)))
                first, size = first + size, min(2 * size, AT_ONCE)
                roomy = self._have_room(bases[rows])
                log.add(NO_ROOM, int((~roomy).sum()))
                undecided[rows] = roomy
                rows = rows[roomy]
                undecided[rows] = validator.has_way(bases[rows], log)
                rows = rows[undecided[rows]]
                if self.again:
                    undecided[rows] = [key not in log.findings.met for key in known(rows)]
                    rows = rows[undecided[rows]]
                undecided[rows] = arms_have_room(bases[rows], stance, log)
                remember(rows)
                waiting = np.append(waiting, rows[undecided[rows]])
                while len(waiting) >= budget.block or (len(waiting) and first >= len(found)):
                    yield waiting[: budget.block]
                    waiting = waiting[budget.block :]

        def looked_at() -> Iterator[tuple[int, HandSolution, bool]]:
            """Yield candidates that spheres and inverse kinematics leave; at last those like others that failed."""
            for rows in standing():
                undecided[rows] = [not is_hopeless(row) for row in rows.tolist()]
                rows = rows[undecided[rows]]
                undecided[rows] = validator.has_way(bases[rows], log)
                rows = rows[undecided[rows]]
                undecided[rows], joints = self._solved(found, rows, bases, hands)
                remember(rows)
                rows = rows[undecided[rows]]
                if misses is not None and len(rows):
                    undecided[rows] = ~misses(bases[rows])
                    log.add(NOT_VISIBLE, int((~undecided[rows]).sum()))
                    rows = rows[undecided[rows]]
                for row in rows.tolist():
                    arm, candidates, _ = hands[int(found.arms[row])]
                    plan = candidates.plan(int(found.candidates[row]))
                    yield row, HandSolution(self.wanted[0], arm, plan, joints[row]), True
            if budget.fine:
                for row, solution in postponed:
                    yield row, solution, False

        for row, solution, first in looked_at():
            number, candidate = int(found.arms[row]), int(found.candidates[row])
            base = bases[row]
            place = (float(base[0]), float(base[1]), float(base[2]))
            heading = float(hands[number].candidates.headings[candidate])
            if (self.is_taken is not None and self.is_taken(place)) or is_hopeless(row):
                undecided[row] = False
                continue
            if not validator.has_way(base[None], log)[0]:
                undecided[row] = False
                continue
            if first and (failed.near(number, base, heading) or occlusion.covers(base)):
                postponed.append((row, solution))
                continue
            if validated >= budget.exact:
                log.add(NOT_LOOKED_AT, int(undecided.sum()))
                return
            undecided[row] = False
            score = float(found.scores[row])
            answer = self.validator.complete(
                place, score, solution, self.wanted, self.demand, occlusion, log, hands[number].check
            )
            if isinstance(answer, Solution):
                yield answer
                continue
            validated += 1
            if isinstance(answer, str):
                remember(np.array([row]))
            failed.add(number, base, heading)
            if answer == NO_HOLD.text:  # from other bases the hand is as it is here
                stopped[number, candidate] = True
            elif answer in bodies_around:
                failures.setdefault((number, candidate), (solution, place))
            elif isinstance(answer, str) and budget is not BETWEEN:  # where postures are those of the maps
                clumsy.add(posture(row))

    def _solved(
        self, found: BaseCandidates, rows: NDArray[np.intp], bases: Array, hands: Sequence[Hand]
    ) -> tuple[NDArray[np.bool_], dict[int, Array]]:
        """Return which candidates (rows) have joint values as far as spheres tell, and these (k, d) by row."""
        ok = np.zeros(len(rows), bool)
        joints: dict[int, Array] = {}
        for number, (arm, candidates, check) in enumerate(hands):
            mine = np.flatnonzero(found.arms[rows] == number)
            if not len(mine):
                continue
            chosen = rows[mine]
            index, seeds = found.candidates[chosen], np.zeros((len(chosen), 1, len(arm.joints)))
            grasps = candidates.grasps[index]
            for grasp in np.unique(grasps).tolist():
                some = chosen[grasps == grasp]
                forward = self.inverse(arm, CLASSES[grasp]).forward
                seeds[grasps == grasp, 0] = forward.seeds(found.rows[some], found.torsos[some])
            slack = OFF_LATTICE if arm.lift is None else ON_LATTICE
            solved = solve(candidates, index, bases[chosen], arm, seeds, check, slack=slack)
            self.log.count(solved.reasons)
            ok[mine] = [reason is None for reason in solved.reasons]
            joints |= zip(chosen.tolist(), solved.joints, strict=True)
        return ok, joints


def _as_told(bases: Array) -> Array:
    """Return bases (n, 3) as solutions state them."""
    return np.column_stack([bases[:, :2], np.arctan2(np.sin(bases[:, 2]), np.cos(bases[:, 2]))]).round(PLACES)


def _within(centre: tuple[float, float], least: float, most: float, bases: Array) -> Array:
    """1 for bases (m, 3) between two distances [m] from a base pose, 0 for others."""
    away = np.linalg.norm(bases[:, :2] - centre, axis=1)
    return np.where((away >= least) & (away <= most), 1.0, 0.0)


def _sphere(points: Sequence[Array], reach: float) -> tuple[Array, float]:
    """Return middle (3,) and radius [m] of all that a robot may meet that reaches tip positions (n, 3)."""
    every = np.concatenate(points)
    return every[0], float(np.linalg.norm(every - every[0], axis=1).max()) + reach


class _Failed:
    """Base poses that failed exactly: those near to them, with the hand from the same side, are not validated next."""

    def __init__(self) -> None:
        self._places = np.zeros((0, 4))
        """Number of the arm, x, y [m] and heading [rad]."""

    def add(self, arm: int, base: Array, heading: float) -> None:
        """Add one more."""
        self._places = np.vstack([self._places, [arm, base[0], base[1], heading]])

    def near(self, arm: int, base: Array, heading: float) -> bool:
        """Return whether a base pose nearly like this one has failed."""
        other, x, y, before = self._places.T
        turned = np.abs(np.remainder(heading - before + math.pi, 2 * math.pi) - math.pi)
        alike = (other == arm) & (np.abs(x - base[0]) + np.abs(y - base[1]) < ALIKE) & (turned < 0.3)
        return bool(alike.any())
