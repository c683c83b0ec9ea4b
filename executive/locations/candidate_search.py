"""Search among candidate base poses, block by block, cheapest tests first.

Room for the base, a path to it, room for the arms, inverse kinematics with collision spheres, and lines of sight rule
out most candidates; the rest are validated in the planning scene, one by one, only as many as the caller consumes.
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
from executive.locations.demands import BaseDemand
from executive.locations.grasp_candidates import CLASSES, Hand
from executive.locations.hand_solutions import (
    OFF_LATTICE,
    ON_LATTICE,
    HandSolution,
    Trial,
    base_matrices,
    solve,
)
from executive.locations.questions import BETWEEN, Question, SearchBudget, as_keys, once
from executive.locations.reachability import CELL
from executive.locations.rejections import COLLISION, NO_HOLD, NO_ROOM, NOT_LOOKED_AT, NOT_VISIBLE, Reason
from executive.locations.validation import PLACES, BaseValidator, SelfOcclusion
from executive.motion import QuickCheck
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.protocols import Solution
from planlang.records import dataclass
from planlang.relations.demands import Reach

ALIKE = 0.06
"""Distance from a failed base pose, with the hand from the same side, within which others are validated last [m]."""
AT_ONCE = 2048
"""Largest number of base poses tested for room at once."""
TRAVEL = 8.0
"""Distance over which a base pose loses most of its score [m]."""


Solved = tuple[int, HandSolution, bool]
"""Row of a candidate, its solution, and whether what has to be visible is surely hidden from there."""


@dataclass(frozen=True, slots=True)
class SearchSpec:
    """Aim and budget of a search for base poses."""

    validator: BaseValidator
    wanted: Sequence[Reach]
    arms: Sequence[ArmModel]
    demand: BaseDemand
    budget: SearchBudget
    question: Question
    is_taken: Callable[[BasePose], bool] | None = None
    """Whether a base pose need not be examined any more."""


class CandidateSearch:
    """A search for solutions among candidates of base poses."""

    def __init__(
        self,
        spec: SearchSpec,
        candidates: BaseCandidates,
        hands: Sequence[Hand],
        middle: Array,
        stance: QuickCheck,
        misses: Misses | None = None,
    ) -> None:
        """Prepare; ``middle`` (3,) is the targets' centre, ``stance`` checks arms at rest, ``misses`` visibility."""
        self._spec, self._hands, self._misses, self._stance = spec, hands, misses, stance
        self._log, self._findings, budget = spec.question.log, spec.question.known, spec.budget
        self._blind = spec.validator.blind(spec.demand)
        """The same demand without sight of the handled things; None if there are none to omit."""
        x, y, _ = spec.validator.scene.base()
        order = candidates.order(
            lambda bases: np.exp(-np.hypot(bases[:, 0] - x, bases[:, 1] - y) / TRAVEL), budget.most
        )
        self._candidates = candidates.chosen(order)
        self._bases = as_reported(self._candidates.bases)
        self._poses = BasePoses(spec.validator.scene, spec.question)
        self._undecided = np.ones(len(self._candidates), bool)
        self._validated = self._tried_blind = 0
        self._occlusion = SelfOcclusion(middle[:2], strict=budget.fine)
        self._failed_poses = _FailedPoses()
        self._around = frozenset(spec.validator.scene.bodies.names())
        self._stopped = self._findings.stopped
        self._failures: dict[tuple[int, int], tuple[HandSolution, BasePose, Reason]] = {}
        """First solution whose hand collides, and with what, by arm and candidate."""
        self._hits: Counter[tuple[int, int]] = Counter()
        """Number of solutions whose hand collides, by arm and candidate."""
        self._hand_keys: dict[tuple[int, int], tuple[object, ...]] = {}
        self._self_colliding: dict[tuple[float, ...], Reason] = {}
        """Postures in self-collision, with the part that the robot touches."""

    def solutions(self) -> Iterator[Solution]:
        """Yield exactly validated base poses, until the allowed number of them has failed.

        The first base pose that lacks nothing but sight of the handled things is kept in the findings.
        """
        # Room is looked up in a table, inverse kinematics iterates, an exact check asks the physics engine: each costs
        # far more than the one before. So each test sees only what the cheaper ones have left, and what an exact
        # failure teaches (a hand that is stopped wherever the base stands, a posture in self-collision) rules out
        # others before they are checked.
        spec, log = self._spec, self._log
        for row, solution, missed in self._open():
            if self._validated >= spec.budget.exact or self._findings.allowance.checks <= 0:
                log.add(NOT_LOOKED_AT, int(self._undecided.sum()))
                self._findings.untried = True
                return
            self._undecided[row] = False
            if missed:
                self._keep_blind(row, solution)
                continue
            not_visible = log.counts[NOT_VISIBLE]
            result = self._completed(row, solution, spec.demand, spec.question)
            if isinstance(result, Solution):
                yield result
            else:
                self._validated += 1
                self._note_failure(row, solution, result)
            if log.counts[NOT_VISIBLE] > not_visible:
                self._keep_blind(row, solution)

    def _completed(
        self, row: int, solution: HandSolution, demand: BaseDemand, question: Question
    ) -> Solution | str | None:
        """Validate a candidate exactly (see :meth:`BaseValidator.complete`)."""
        return self._spec.validator.complete(
            self._place(row),
            float(self._candidates.scores[row]),
            solution,
            self._spec.wanted,
            demand,
            self._occlusion,
            question,
            self._hands[self._key(row)[0]].check,
        )

    def _wants_blind(self) -> bool:
        """Check whether a base pose that lacks only sight of the handled things is still wanted."""
        return self._blind is not None and self._findings.blind is None

    def _keep_blind(self, row: int, solution: HandSolution) -> None:
        """Keep a candidate that only lacks sight of the handled things."""
        spec, findings = self._spec, self._findings
        if self._blind is None or findings.blind is not None:
            return
        if self._tried_blind >= spec.budget.exact or findings.allowance.checks <= 0:
            findings.untried = True
            return
        self._tried_blind += 1
        result = self._completed(row, solution, self._blind, spec.question.uncounted())
        if isinstance(result, Solution):
            findings.blind = result
        else:
            self._note_failure(row, solution, result)

    def _note_failure(self, row: int, solution: HandSolution, answer: str | None) -> None:
        """Record an exact failure, and whether it applies to other bases as well."""
        self._findings.allowance.checks -= 1
        number, candidate = self._key(row)
        if isinstance(answer, str):
            self._remember(np.array([row]))
        self._failed_poses.add(number, self._bases[row], self._heading(row))
        if answer == NO_HOLD.text:  # the grip does not depend on the base
            self._stopped[self._hand_key(number, candidate)] = NO_HOLD
        elif answer in self._around:
            self._failures.setdefault((number, candidate), (solution, self._place(row), Reason(COLLISION, answer)))
            self._hits[number, candidate] += 1
        elif isinstance(answer, str) and self._spec.budget is not BETWEEN:  # only map rows identify a posture
            self._self_colliding[self._posture(row)] = Reason(COLLISION, answer)

    def _open(self) -> Iterator[Solved]:
        """Yield candidates that nothing known rules out, those similar to failed ones last."""
        postponed: list[Solved] = []
        for one in self._solved_candidates():
            if self._is_ruled_out(one):
                continue
            row, _, missed = one
            base = self._bases[row]
            # what stopped the arm there most likely stops it a few centimetres beside; if nothing else is left, they
            # are validated after all
            similar = self._failed_poses.near(self._key(row)[0], base, self._heading(row))
            if similar or (not missed and self._occlusion.covers(base)):
                postponed.append(one)
            else:
                yield one
        if self._spec.budget.fine:
            yield from (one for one in postponed if not self._is_ruled_out(one))

    def _is_ruled_out(self, one: Solved) -> bool:
        """Check whether a candidate that is solved is of no use after all, by what has become known since."""
        (row, _, missed), is_taken = one, self._spec.is_taken
        here = np.array([row])
        self._undecided[row] = not (
            (missed and not self._wants_blind())
            or (is_taken is not None and is_taken(self._place(row)))
            or self._are_hopeless(here)[0]
            or not self._poses.have_way(self._bases[here])[0]
        )
        return not self._undecided[row]

    def _solved_candidates(self) -> Iterator[Solved]:
        """Yield candidates that pass inverse kinematics with collision spheres."""
        undecided, known = self._undecided, self._findings
        for rows in self._roomy_blocks():
            if known.allowance.solved <= 0:
                self._log.add(NOT_LOOKED_AT, int(undecided[rows[0] :].sum()))
                undecided[rows[0] :], known.untried = False, True
                break
            rows = self._left(rows, ~self._are_hopeless(rows))
            rows = self._left(rows, self._poses.have_way(self._bases[rows]))  # what is known of paths has grown
            if not self._wants_blind():  # nothing that is hidden is of use
                rows = self._left(rows, ~self._are_hidden(rows))
            known.allowance.solved -= len(rows)
            solved, joints = self._solved(rows)
            left = self._left(rows, solved)
            self._remember(rows)
            rows = left
            missed = self._are_hidden(rows) if self._wants_blind() else np.zeros(len(rows), bool)
            for row, unseen in zip(rows.tolist(), missed.tolist(), strict=True):
                number, candidate = self._key(row)
                arm, candidates, _ = self._hands[number]
                solution = HandSolution(self._spec.wanted[0], arm, candidates.plan(candidate), joints[row])
                yield row, solution, unseen

    def _left(self, rows: NDArray[np.intp], good: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Select the good ones of some candidates; the others are decided."""
        self._undecided[rows] = good
        return rows[good]

    def _are_hidden(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Check from which candidates the robot surely does not see what has to be visible; count them."""
        if self._misses is None or not len(rows):
            return np.zeros(len(rows), bool)
        missed = self._misses(self._bases[rows])
        self._log.refuse(NOT_VISIBLE, self._bases[rows[missed]])
        return missed

    def _roomy_blocks(self) -> Iterator[NDArray[np.intp]]:
        """Yield candidates with room for base and arms, block by block, tested in growing batches."""
        # Where there is room, the first blocks have an answer, and small ones find it soonest; where there is little,
        # most candidates are looked at, and large ones do that at the least cost. Doubling is within a factor of two of
        # either.
        budget, log = self._spec.budget, self._log
        again = bool(self._spec.demand.remembered)  # repeats a search that required more to be visible
        waiting, first, size, block = np.zeros(0, np.intp), 0, budget.block, budget.block
        while first < len(self._candidates):
            rows = np.arange(first, min(first + size, len(self._candidates)))
            first, size = first + size, min(2 * size, AT_ONCE)
            roomy = self._poses.rooms(self._bases[rows])
            log.refuse(NO_ROOM, self._bases[rows[~roomy]])
            rows = self._left(rows, roomy)
            rows = self._left(rows, self._poses.have_way(self._bases[rows]))
            if again:
                rows = self._left(rows, np.array([key not in self._findings.met for key in self._keys(rows)], bool))
            left = self._left(rows, self._arms_have_room(rows))
            self._remember(rows)
            waiting = np.append(waiting, left)
            while len(waiting) >= block or (len(waiting) and first >= len(self._candidates)):
                yield waiting[:block]
                waiting, block = waiting[block:], min(2 * block, AT_ONCE)

    def _arms_have_room(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Check at which candidates no arm, in its present posture, collides by its spheres; count the others."""
        bodies = once(self._findings.stances, self._bases[rows], lambda new: self._stance.hit(base_matrices(new)))
        for body, number in Counter(bodies).items():
            if body is not None:
                self._log.crowded(body, number)
        self._log.show(NO_ROOM, self._bases[rows[[body is not None for body in bodies]]])
        return np.array([body is None for body in bodies], bool)

    def _solved(self, rows: NDArray[np.intp]) -> tuple[NDArray[np.bool_], dict[int, Array]]:
        """Solve candidates: which have joint values without sphere collisions, and these (k, d) by row."""
        table, ok = self._candidates, np.zeros(len(rows), bool)
        joints: dict[int, Array] = {}
        for number, (arm, candidates, check) in enumerate(self._hands):
            mine = np.flatnonzero(table.arms[rows] == number)
            if not len(mine):
                continue
            chosen = rows[mine]
            index, seeds = table.candidates[chosen], np.zeros((len(chosen), 1, len(arm.joints)))
            grasps = candidates.grasps[index]
            for grasp in np.unique(grasps).tolist():
                same_class = chosen[grasps == grasp]
                forward = self._spec.validator.inverse(arm, CLASSES[grasp]).forward
                seeds[grasps == grasp, 0] = forward.seeds(table.rows[same_class], table.torsos[same_class])
            slack = ON_LATTICE if arm.lift is not None and arm.lift.travel >= CELL else OFF_LATTICE
            solved, reasons = solve(candidates, index, self._bases[chosen], arm, seeds, check, slack=slack)
            self._log.count(reasons, self._bases[chosen])
            ok[mine] = [reason is None for reason in reasons]
            joints |= zip(chosen.tolist(), solved, strict=True)
        return ok, joints

    def _keys(self, rows: NDArray[np.intp]) -> list[bytes]:
        """Keys by which candidates are recognised in a repeated search."""
        table = self._candidates
        numbers = np.full(len(rows), float(self._spec.budget.stage)), table.arms[rows], table.candidates[rows]
        return as_keys(np.column_stack([*numbers, table.torsos[rows], self._bases[rows]]))

    def _remember(self, rows: NDArray[np.intp]) -> None:
        """Record those of some candidates that arms cannot perform."""
        if not self._spec.demand.remembered:
            self._findings.met.update(self._keys(rows[~self._undecided[rows]]))

    def _are_hopeless(self, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Check which candidates fail at any base pose, or with a posture; count them."""
        keys = np.column_stack([self._candidates.arms[rows], self._candidates.candidates[rows]])
        each, number = np.unique(keys, axis=0, return_inverse=True)
        stopped = [self._stops((arm, candidate)) for arm, candidate in each.tolist()]
        reasons = [stopped[index] for index in number.ravel().tolist()]
        if self._self_colliding:
            postures = (self._self_colliding.get(self._posture(row)) for row in rows.tolist())
            reasons = [clumsy or reason for clumsy, reason in zip(postures, reasons, strict=True)]
        self._log.count(reasons, self._bases[rows])
        return np.array([reason is not None for reason in reasons], bool)

    def _stops(self, key: tuple[int, int]) -> Reason | None:
        """Explain why a candidate that failed cannot work from any base, since the hand itself collides; else None.

        This test costs as much as validating several base poses, so it waits for the second failure.
        """
        if self._hits[key] > 1 and self._hand_key(*key) not in self._stopped:
            scene, check = self._spec.validator.scene, self._hands[key[0]].check
            solution, base, reason = self._failures[key]
            is_stopped = Trial(solution, base, scene, check).hand_is_stopped()
            self._stopped[self._hand_key(*key)] = reason if is_stopped else None
        return self._stopped.get(self._hand_key(*key)) if self._stopped else None

    def _hand_key(self, number: int, candidate: int) -> tuple[object, ...]:
        """Key of a grasp candidate of an arm that is the same in all searches for a location."""
        if (number, candidate) not in self._hand_keys:
            arm, candidates, _ = self._hands[number]
            poses = candidates.poses([candidate]).tobytes()
            self._hand_keys[number, candidate] = (arm.name, candidates.fingers, poses)
        return self._hand_keys[number, candidate]

    def _posture(self, row: int) -> tuple[float, ...]:
        """Key of an arm's posture: self-collisions depend on nothing else."""
        number, candidate = self._key(row)
        mine = self._hands[number].candidates
        of_hand = int(mine.grasps[candidate]), int(mine.rolls[candidate]), float(mine.points[candidate, 2])
        return number, *of_hand, int(self._candidates.rows[row]), float(self._candidates.torsos[row])

    def _key(self, row: int) -> tuple[int, int]:
        """Numbers of arm and grasp candidate."""
        return int(self._candidates.arms[row]), int(self._candidates.candidates[row])

    def _place(self, row: int) -> BasePose:
        x, y, yaw = self._bases[row].tolist()
        return x, y, yaw

    def _heading(self, row: int) -> float:
        """Heading of the hand's approach [rad]."""
        number, candidate = self._key(row)
        return float(self._hands[number].candidates.headings[candidate])


def as_reported(bases: Array) -> Array:
    """Normalise and round bases (n, 3) as solutions state them."""
    return np.column_stack([bases[:, :2], np.arctan2(np.sin(bases[:, 2]), np.cos(bases[:, 2]))]).round(PLACES)


class _FailedPoses:
    """Base poses that failed exactly; similar ones, with the hand from the same side, are validated later."""

    def __init__(self) -> None:
        self._places = np.zeros((0, 4))
        """Rows of arm number, x, y [m] and heading [rad]."""

    def add(self, arm: int, base: Array, heading: float) -> None:
        """Record a failure."""
        self._places = np.vstack([self._places, [arm, base[0], base[1], heading]])

    def near(self, arm: int, base: Array, heading: float) -> bool:
        """Check whether a similar base pose has failed."""
        other, x, y, before = self._places.T
        turned = np.abs(np.remainder(heading - before + math.pi, 2 * math.pi) - math.pi)
        similar = (other == arm) & (np.abs(x - base[0]) + np.abs(y - base[1]) < ALIKE) & (turned < 0.3)
        return bool(similar.any())
