"""The search among candidates of base poses: block by block, those first that cost least to look at.

Room for the base, a way to it, room for the arms, inverse kinematics among spheres, and lines of sight rule out most
of them; the planning scene is asked of the rest, one by one, only as many as are asked for.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose
from executive.locations.base_candidates import BaseCandidates, Misses
from executive.locations.base_poses import BasePoses
from executive.locations.budgets import BETWEEN, SearchBudget
from executive.locations.demands import BaseDemand, Reach
from executive.locations.grasp_candidates import CLASSES, Hand
from executive.locations.hand_solutions import (
    OFF_LATTICE,
    ON_LATTICE,
    HandSolution,
    Trial,
    base_matrices,
    solve,
)
from executive.locations.looking_once import LookedAt, as_keys, numbered
from executive.locations.questions import Findings, Question
from executive.locations.rejections import COLLISION, NO_HOLD, NO_ROOM, NOT_LOOKED_AT, NOT_VISIBLE, Reason, Rejections
from executive.locations.validation import PLACES, BaseValidator, SelfOcclusion
from executive.motion import QuickCheck
from planlang.geometry import Array
from planlang.protocols import Solution
from planlang.records import dataclass

ALIKE = 0.06
"""A candidate this near to one that failed exactly, with the hand from the same side, is validated last [m]."""
AT_ONCE = 2048
"""Base poses of which room is looked at in one go, at most."""
TRAVEL = 8.0
"""Distance over which a base pose loses most of its worth [m]."""


@dataclass(frozen=True, slots=True)
class Sought:
    """The aim of a search for base poses, and its bounds."""

    validator: BaseValidator
    wanted: Sequence[Reach]
    demand: BaseDemand
    budget: SearchBudget
    question: Question
    is_taken: Callable[[BasePose], bool] | None = None
    """Tells of which base poses nothing needs to be known any more."""
    blind: BaseDemand | None = None
    """The same demand without sight of what is handled; None if sight of nothing can be left out."""

    @property
    def log(self) -> Rejections:
        """What is refused, and why."""
        return self.question.log

    @property
    def known(self) -> Findings:
        """What was found out before."""
        return self.question.known

    @property
    def poses(self) -> BasePoses:
        """The base poses of the scene, for this question."""
        return BasePoses(self.validator.scene, self.question)


class CandidateSearch:
    """A search for solutions among candidates of base poses."""

    def __init__(
        self,
        sought: Sought,
        found: BaseCandidates,
        hands: Sequence[Hand],
        middle: Array,
        stance: QuickCheck,
        misses: Misses | None = None,
    ) -> None:
        """``middle`` (3,) of what hands reach, ``stance`` a check of all arms at rest, ``misses`` what is not seen."""
        self._sought, self._hands, self._misses = sought, hands, misses
        budget = sought.budget
        x, y, _ = sought.validator.scene.base()
        order = found.order(lambda bases: np.exp(-np.hypot(bases[:, 0] - x, bases[:, 1] - y) / TRAVEL), budget.most)
        self._found = found.chosen(order)
        self._bases = as_told(self._found.bases)
        each = numbered(self._bases)
        self._poses = sought.poses
        self._rooms = self._poses.rooms(each)
        self._stances = LookedAt(each, sought.known.stances, lambda new: stance.hit(base_matrices(new)))
        self._undecided = np.ones(len(self._found), bool)
        self._validated = self._tried_blind = 0
        self._occlusion = SelfOcclusion(middle[:2], strict=budget.fine)
        self._failed = _Failed()
        self._around = frozenset(sought.validator.scene.bodies.names())
        self._stopped = sought.known.stopped
        self._failures: dict[tuple[int, int], tuple[HandSolution, BasePose, Reason]] = {}
        """The first solution with the hand in something, and in what, for each arm and candidate."""
        self._hits: Counter[tuple[int, int]] = Counter()
        """Solutions with the hand in something, for each arm and candidate."""
        self._hand_keys: dict[tuple[int, int], tuple[object, ...]] = {}
        self._clumsy: dict[tuple[float, ...], Reason] = {}
        """Postures in which the robot touches itself, with the part that it touches."""

    def solutions(self) -> Iterator[Solution]:
        """Yield base poses that are validated exactly, until as many failed as may.

        The first base pose that lacks nothing but sight of what is handled is kept in the findings.
        """
        sought, log = self._sought, self._sought.log
        for row, solution, missed in self._open():
            if self._validated >= sought.budget.exact:
                log.add(NOT_LOOKED_AT, int(self._undecided.sum()))
                sought.known.untried = True
                return
            self._undecided[row] = False
            if missed:
                self._keep_blind(row, solution)
                continue
            unseen = log.counts[NOT_VISIBLE]
            answer = self._completed(row, solution, sought.demand, sought.question)
            if isinstance(answer, Solution):
                yield answer
            else:
                self._validated += 1
                self._note_failure(row, solution, answer)
            if log.counts[NOT_VISIBLE] > unseen:
                self._keep_blind(row, solution)

    def _completed(
        self, row: int, solution: HandSolution, demand: BaseDemand, question: Question
    ) -> Solution | str | None:
        """Validate a candidate exactly, as :meth:`BaseValidator.complete` does."""
        return self._sought.validator.complete(
            self._place(row),
            float(self._found.scores[row]),
            solution,
            self._sought.wanted,
            demand,
            self._occlusion,
            question,
            self._hands[self._key(row)[0]].check,
        )

    def _wants_blind(self) -> bool:
        """Return True as long as no base pose is known that lacks nothing but sight of what is handled."""
        return self._sought.blind is not None and self._sought.known.blind is None

    def _keep_blind(self, row: int, solution: HandSolution) -> None:
        """Keep a candidate from which what is handled is not seen, if nothing else is wrong with it."""
        sought, findings = self._sought, self._sought.known
        if sought.blind is None or findings.blind is not None:
            return
        if self._tried_blind >= sought.budget.exact:
            findings.untried = True
            return
        self._tried_blind += 1
        answer = self._completed(row, solution, sought.blind, sought.question.uncounted())
        if isinstance(answer, Solution):
            findings.blind = answer
        else:
            self._note_failure(row, solution, answer)

    def _note_failure(self, row: int, solution: HandSolution, answer: str | None) -> None:
        """Remember what failed exactly, and whether it does so from other bases, too."""
        number, candidate = self._key(row)
        if isinstance(answer, str):
            self._remember(np.array([row]))
        self._failed.add(number, self._bases[row], self._heading(row))
        if answer == NO_HOLD.text:  # from other bases the hand is as it is here
            self._stopped[self._hand_key(number, candidate)] = NO_HOLD
        elif answer in self._around:
            self._failures.setdefault((number, candidate), (solution, self._place(row), Reason(COLLISION, answer)))
            self._hits[number, candidate] += 1
        elif isinstance(answer, str) and self._sought.budget is not BETWEEN:  # where postures are those of the maps
            self._clumsy[self._posture(row)] = Reason(COLLISION, answer)

    def _open(self) -> Iterator[tuple[int, HandSolution, bool]]:
        """Yield candidates of which nothing is known that rules them out; those like others that failed at last.

        With each, whether what is to be seen is surely not seen from there.
        """
        sought = self._sought
        postponed: list[tuple[int, HandSolution, bool]] = []
        for row, solution, first, missed in self._looked_at(postponed):
            if missed and not self._wants_blind():
                self._undecided[row] = False
                continue
            taken = sought.is_taken is not None and sought.is_taken(self._place(row))
            if taken or self._are_hopeless(np.array([row]))[0] or not self._have_way(np.array([row]))[0]:
                self._undecided[row] = False
                continue
            base = self._bases[row]
            alike = first and self._failed.near(self._key(row)[0], base, self._heading(row))
            if alike or (first and not missed and self._occlusion.covers(base)):
                postponed.append((row, solution, missed))
                continue
            yield row, solution, missed

    def _looked_at(
        self, postponed: list[tuple[int, HandSolution, bool]]
    ) -> Iterator[tuple[int, HandSolution, bool, bool]]:
        """Yield candidates that spheres and inverse kinematics leave; at last those that were postponed meanwhile.

        With each, whether it comes for the first time, and whether what is to be seen is surely not seen from there.
        """
        undecided = self._undecided
        for rows in self._standing():
            undecided[rows] = ~self._are_hopeless(rows)
            rows = rows[undecided[rows]]
            undecided[rows] = self._have_way(rows)
            rows = rows[undecided[rows]]
            undecided[rows], joints = self._solved(rows)
            self._remember(rows)
            rows = rows[undecided[rows]]
            missed = np.zeros(len(rows), bool)
            if self._misses is not None and len(rows):
                missed = self._misses(self._bases[rows])
                self._sought.log.refuse(NOT_VISIBLE, self._bases[rows[missed]])
            for row, unseen in zip(rows.tolist(), missed.tolist(), strict=True):
                number, candidate = self._key(row)
                arm, candidates, _ = self._hands[number]
                solution = HandSolution(self._sought.wanted[0], arm, candidates.plan(candidate), joints[row])
                yield row, solution, True, unseen
        if self._sought.budget.fine:
            for row, solution, unseen in postponed:
                yield row, solution, False, unseen

    def _standing(self) -> Iterator[NDArray[np.intp]]:
        """Yield candidates with room for base and arms, block by block; looked at in ever larger parts."""
        budget, log, undecided = self._sought.budget, self._sought.log, self._undecided
        again = bool(self._sought.demand.remembered)  # the same was looked at before with more to be seen
        waiting, first, size, block = np.zeros(0, np.intp), 0, budget.block, budget.block
        while first < len(self._found):
            rows = np.arange(first, min(first + size, len(self._found)))
            first, size = first + size, min(2 * size, AT_ONCE)
            roomy = np.array(self._rooms(rows), bool)
            log.refuse(NO_ROOM, self._bases[rows[~roomy]])
            undecided[rows] = roomy
            rows = rows[roomy]
            undecided[rows] = self._have_way(rows)
            rows = rows[undecided[rows]]
            if again:
                undecided[rows] = [key not in self._sought.known.met for key in self._known(rows)]
                rows = rows[undecided[rows]]
            undecided[rows] = self._arms_have_room(rows)
            self._remember(rows)
            waiting = np.append(waiting, rows[undecided[rows]])
            while len(waiting) >= block or (len(waiting) and first >= len(self._found)):
                yield waiting[:block]
                waiting, block = waiting[block:], min(2 * block, AT_ONCE)

    def _arms_have_room(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return at which candidates no arm, in its present posture, is inside something as far as spheres tell.

        Others are counted.
        """
        bodies = self._stances(rows)
        for body, number in Counter(bodies).items():
            if body is not None:
                self._sought.log.crowded(body, number)
        self._sought.log.show(NO_ROOM, self._bases[rows[[body is not None for body in bodies]]])
        return np.array([body is None for body in bodies], bool)

    def _solved(self, rows: NDArray[np.intp]) -> tuple[NDArray[np.bool_], dict[int, Array]]:
        """Return which candidates (rows) have joint values as far as spheres tell, and these (k, d) by row."""
        found, ok = self._found, np.zeros(len(rows), bool)
        joints: dict[int, Array] = {}
        for number, (arm, candidates, check) in enumerate(self._hands):
            mine = np.flatnonzero(found.arms[rows] == number)
            if not len(mine):
                continue
            chosen = rows[mine]
            index, seeds = found.candidates[chosen], np.zeros((len(chosen), 1, len(arm.joints)))
            grasps = candidates.grasps[index]
            for grasp in np.unique(grasps).tolist():
                some = chosen[grasps == grasp]
                forward = self._sought.validator.inverse(arm, CLASSES[grasp]).forward
                seeds[grasps == grasp, 0] = forward.seeds(found.rows[some], found.torsos[some])
            slack = OFF_LATTICE if arm.lift is None else ON_LATTICE
            solved = solve(candidates, index, self._bases[chosen], arm, seeds, check, slack=slack)
            self._sought.log.count_at(solved.reasons, self._bases[chosen])
            ok[mine] = [reason is None for reason in solved.reasons]
            joints |= zip(chosen.tolist(), solved.joints, strict=True)
        return ok, joints

    def _have_way(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return which candidates the base can drive to; asked again, as what is known of ways grows meanwhile."""
        return self._poses.have_way(self._bases[rows])

    def _known(self, rows: NDArray[np.intp]) -> list[bytes]:
        """Return what candidates are known by when the same is looked at again."""
        found = self._found
        numbers = np.full(len(rows), float(self._sought.budget.stage)), found.arms[rows], found.candidates[rows]
        return as_keys(np.column_stack([*numbers, found.torsos[rows], self._bases[rows]]))

    def _remember(self, rows: NDArray[np.intp]) -> None:
        """Remember those of some candidates that arms cannot do."""
        if not self._sought.demand.remembered:
            self._sought.known.met.update(self._known(rows[~self._undecided[rows]]))

    def _are_hopeless(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return for which candidates (rows) no base pose will do, or none for a posture; these are counted."""
        keys = np.column_stack([self._found.arms[rows], self._found.candidates[rows]])
        each, number = np.unique(keys, axis=0, return_inverse=True)
        stopped = [self._stops((arm, candidate)) for arm, candidate in each.tolist()]
        reasons = [stopped[index] for index in number.ravel().tolist()]
        if self._clumsy:
            postures = (self._clumsy.get(self._posture(row)) for row in rows.tolist())
            reasons = [clumsy or reason for clumsy, reason in zip(postures, reasons, strict=True)]
        self._sought.log.count_at(reasons, self._bases[rows])
        return np.array([reason is not None for reason in reasons], bool)

    def _stops(self, key: tuple[int, int]) -> Reason | None:
        """Return why no base pose of a candidate that failed will do, as the hand itself is in something; else None.

        To look at this takes as long as to validate some base poses: it is for a candidate that failed twice.
        """
        if self._hits[key] > 1 and self._hand_key(*key) not in self._stopped:
            scene, check = self._sought.validator.scene, self._hands[key[0]].check
            solution, base, reason = self._failures[key]
            is_stopped = Trial(solution, base, scene, check).hand_is_stopped()
            self._stopped[self._hand_key(*key)] = reason if is_stopped else None
        return self._stopped.get(self._hand_key(*key)) if self._stopped else None

    def _hand_key(self, number: int, candidate: int) -> tuple[object, ...]:
        """Return what tells one grasp candidate of an arm from others, in all searches for a location."""
        if (number, candidate) not in self._hand_keys:
            arm, candidates, _ = self._hands[number]
            poses = candidates.poses([candidate]).tobytes()
            self._hand_keys[number, candidate] = (arm.name, candidates.fingers, poses)
        return self._hand_keys[number, candidate]

    def _posture(self, row: int) -> tuple[float, ...]:
        """Return what an arm's posture depends on: with the same, a robot that touches itself does so anywhere."""
        number, candidate = self._key(row)
        mine = self._hands[number].candidates
        of_hand = int(mine.grasps[candidate]), int(mine.rolls[candidate]), float(mine.points[candidate, 2])
        return number, *of_hand, int(self._found.rows[row]), float(self._found.torsos[row])

    def _key(self, row: int) -> tuple[int, int]:
        """Return the numbers of arm and grasp candidate."""
        return int(self._found.arms[row]), int(self._found.candidates[row])

    def _place(self, row: int) -> BasePose:
        x, y, yaw = self._bases[row].tolist()
        return x, y, yaw

    def _heading(self, row: int) -> float:
        """Return from where the hand comes [rad]."""
        number, candidate = self._key(row)
        return float(self._hands[number].candidates.headings[candidate])


def as_told(bases: Array) -> Array:
    """Return bases (n, 3) as solutions state them."""
    return np.column_stack([bases[:, :2], np.arctan2(np.sin(bases[:, 2]), np.cos(bases[:, 2]))]).round(PLACES)


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
