"""Base poses from which a hand can do what is required: free hands, inverted maps, then validation.

The present base pose comes first, then searches with growing budgets.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.belief.scene_floor import NEAR_ITS_END
from executive.locations.base_candidates import BaseCandidates, Conjunct, Inversion, Misses, moved_to_room
from executive.locations.base_poses import BasePoses
from executive.locations.candidate_search import CandidateSearch, SearchSpec, as_reported
from executive.locations.demands import BaseDemand
from executive.locations.floor_search import FloorSearch
from executive.locations.grasp_candidates import CLASSES, Hand
from executive.locations.hand_predicates import Stage
from executive.locations.hand_solutions import HandHits, unblocked
from executive.locations.questions import ALL, BUDGETS, EASY, Findings, FreeHands, Question
from executive.locations.rejections import COLLISION, NO_ROOM, NOT_VISIBLE, OUT_OF_REACH, Rejections, unmet
from executive.locations.validation import BaseValidator
from planlang.failure_wording import NO_WAY
from planlang.geometry import Array
from planlang.geometry.areas import Facing
from planlang.protocols import Solution
from planlang.relations.demands import ReachKind

Band = tuple[tuple[float, float], float, float]
"""Centre, and least and greatest distance of base poses from it [m]."""
APART = 0.05
"""Least distance between solutions [m], compared at four decimals, since map rows are exactly this far apart."""


def search_bases(
    validator: BaseValidator,
    demand: BaseDemand,
    question: Question,
    found: list[BasePose],
    most: int | None = None,
) -> Generator[Solution]:
    """Yield base poses, each farther than :data:`APART` from those in ``found``, to which they are added.

    ``most`` limits the number of :data:`BUDGETS` used.
    """
    wanted, arms, scene = validator.wanted(demand), validator.arms(demand), validator.scene
    log, known = question.log, question.known

    def is_found(base: BasePose) -> bool:
        """Check whether a base pose nearby was found before."""
        return any(round(math.dist(base[:2], other[:2]), 4) <= APART for other in found)

    def searches() -> Iterator[Iterable[Solution]]:
        x, y, yaw = scene.base()
        here = validator.at((x, y, math.remainder(yaw, 2 * math.pi)), 1.0, demand, arms, question)
        yield () if here is None else (here,)
        if scene.robot.base.fixed:
            return
        if demand.remembered and known.blind is not None:
            yield (known.blind,)
        elif demand.remembered and not known.untried:
            return  # all other conditions were tested before
        if not wanted:
            yield FloorSearch(validator, demand, question).places()
            return
        before, repeat, exhausted, search = (log.counts, log.blocking), False, None, None
        delivers = any(reach.kind in (ReachKind.PLACE, ReachKind.OFFER) for reach in wanted)
        for budget in BUDGETS[:most]:
            if exhausted == (budget.stage, budget.least, budget.rows):
                continue  # would only keep more of the same base poses
            if not delivers and not log.counts[COLLISION]:  # more headings help against collisions only
                budget = replace(budget, stage=min(budget.stage, Stage.ALL))
            log.counts, log.blocking = map(Counter, before)  # everything is examined again
            search = ReachSearch(
                SearchSpec(validator, wanted, arms, demand, budget, question, is_found if repeat else None)
            )
            yield search.places()
            if log.hopeless:
                break
            exhausted = None if search.inverted else (budget.stage, budget.least, budget.rows)
            repeat = bool(found)  # the next search finds these again, and need not validate them
        if search is not None and not log.explained:
            search.poses.name_crowding()

    for solution in chain.from_iterable(searches()):
        if not is_found(solution.base):
            found.append(solution.base)
            known.inversions.clear()  # large, and rarely needed again
            yield solution


def first_base(validator: BaseValidator, demand: BaseDemand, common: Findings) -> Solution | None:
    """Search quickly for a base pose of demands; None if there is none."""
    tried = Question(known=Findings(common.allowance, walled=common.walled, untried=True))
    with closing(search_bases(validator, demand, tried, [], most=EASY)) as found:
        return next(found, None)


class ReachSearch:
    """Search for base poses from which all required reaches are possible."""

    def __init__(self, spec: SearchSpec) -> None:
        self.spec, self.scene, self.log = spec, spec.validator.scene, spec.question.log
        self.known = spec.question.known
        self.poses = BasePoses(self.scene, spec.question)
        """Also collects candidates without room anywhere, whose obstacles are named if nothing is found."""
        self.inverted = False
        """True once maps have given a base pose."""

    def places(self) -> Iterator[Solution]:
        """Yield base poses from which the first reach is possible by the maps, validated block by block."""
        scene, validator, budget, log = self.scene, self.spec.validator, self.spec.budget, self.log
        free = self._free_hands()
        hands, reach, near = free.hands, free.reach, free.near
        if not hands:
            return
        middle = np.mean([hand.candidates.points.mean(axis=0) for hand in hands], axis=0)
        aside = [np.linalg.norm(hand.candidates.points[:, :2] - middle[:2], axis=1).max() for hand in hands]
        within = float(max(aside)) + reach
        bands = [(reach.body, validator.band(reach, self.spec.arms)) for reach in self.spec.wanted[1:]]
        log.hopeless = self._is_hopeless(middle[:2], within, bands)
        if self.known.walled and not scene.collisions.reached().comes_near(middle[:2], within + NEAR_ITS_END):
            log.add(NO_WAY, sum(len(hand.candidates) for hand in hands))
            return
        candidates = self._inverted(hands, middle[:2], within, bands)
        if len(candidates):
            self.inverted = True
            succeeded, stance = False, scene.collisions.stance_check(near)
            unseen = self._unseen() if budget.fine else None
            for solution in CandidateSearch(self.spec, candidates, hands, middle, stance, unseen).solutions():
                succeeded = True
                yield solution
            if budget.then is not None and not succeeded and self.spec.is_taken is None:
                crowded = candidates.chosen(~self.poses.rooms(as_reported(candidates.bases)))
                floor, yaw = scene.collisions.floor(), scene.bodies.block(self.spec.wanted[0].body).yaw
                moved = moved_to_room(crowded, floor, middle[:2], yaw, budget.most)
                then = replace(self.spec, budget=budget.then, question=self.spec.question.uncounted())
                if len(moved):
                    yield from CandidateSearch(then, moved, hands, middle, stance, unseen).solutions()

    def _inverted(
        self, hands: Sequence[Hand], middle: Array, within: float, bands: Sequence[tuple[str, Band]]
    ) -> BaseCandidates:
        """Find base poses by the maps within a distance of a place (2,), and count rejected ones.

        Maps are inverted once for all searches that differ only in the number of base poses or in what has to be
        visible.
        """
        scene, budget, log = self.scene, self.spec.budget, self.log
        known, key = self.known.inversions, (budget.stage, budget.least, budget.rows, self.known.walled)
        if key not in known:
            x, y = middle.tolist()
            room = scene.collisions.floor().field((x, y), scene.bodies.block(self.spec.wanted[0].body).yaw, within)
            conjuncts: list[Conjunct] = [(f"not in reach of {body}", partial(_within, *band)) for body, band in bands]
            conjuncts += [(unmet(term), term.score) for term in self.spec.demand.areas]
            if self.known.walled:
                conjuncts.append((NO_WAY, lambda bases: scene.collisions.have_way(bases).astype(float)))
            known[key] = Inversion(room, conjuncts, show=log.show if log.keeps else None)
            known[key].invert(
                hands, self.spec.validator.inverse, scene.collisions.lifted, least=budget.least, rows=budget.rows
            )
        inversion = known[key]
        # if all base poses of a candidate are kept, visibility is tested later, on solved ones only
        chooses = budget.fine and budget.each < ALL
        candidates, unseen = inversion.best(budget.each, budget.most, self._unseen() if chooses else None)
        log.weigh(candidates.bases, candidates.scores)
        refused = {NO_ROOM: inversion.without_room, **inversion.refused, NOT_VISIBLE: unseen}
        for reason, number in refused.items():
            log.add(reason, number)
        if not len(candidates) and not any(refused.values()):
            log.add(OUT_OF_REACH.text, sum(len(hand.candidates) for hand in hands))
            for hand in hands:
                log.show_hands(OUT_OF_REACH.text, hand.candidates.points)
        self.poses.crowded = inversion.crowded()
        if log.explained:
            self.poses.name_crowding()
        return candidates

    def _free_hands(self) -> FreeHands:
        """Find the grasp candidates of the first reach with a collision-free hand; count the others."""
        known, stage = self.known.hands, self.spec.budget.stage
        if stage not in known:
            known[stage] = self._find_hands()
        self.log.include(known[stage].counted)
        return known[stage]

    def _find_hands(self) -> FreeHands:
        scene, first, stage = self.scene, self.spec.wanted[0], self.spec.budget.stage
        counted = Rejections(remembers=self.log.keeps)
        arms = self.spec.validator.arms_for(first, self.spec.arms)
        possible = [(arm, self.spec.validator.candidates(first, arm, counted, stage)) for arm in arms]
        tables = [(arm, table) for arm, of_arm in possible for table in of_arm]
        if not tables:
            return FreeHands([], 0.0, (np.zeros(3), 0.0), counted)
        reach = max(
            self.spec.validator.inverse(arm, CLASSES[g]).reach
            for arm, table in tables
            for g in set(table.grasps.tolist())
        )
        varied = stage is Stage.CLOSEST
        variants = (one for arm, table in tables for one in (table.variants(arm.openings) if varied else [table]))
        points = np.concatenate([one.points for one in variants])
        # all that a robot may touch when it reaches one of them
        near = points[0], float(np.linalg.norm(points - points[0], axis=1).max()) + reach
        hits = HandHits()
        each = (unblocked(arm, of_arm, scene, counted, near, varied=varied, hits=hits) for arm, of_arm in possible)
        hands = [hand for some in each for hand in some]
        for hand in hands:
            counted.show_hands("", hand.candidates.points)
        return FreeHands(hands, reach, near, counted)

    def _is_hopeless(self, middle: Array, radius: float, bands: Sequence[tuple[str, Band]]) -> bool:
        """Check whether a conjunct about the base holds nowhere within a radius [m] of a place (2,)."""
        areas = (term for term in self.spec.demand.areas if not isinstance(term, Facing))
        apart = any(math.dist(middle, centre) > radius + most for _, (centre, _, most) in bands)
        return apart or not all(term.nearly(middle[None], radius)[0] for term in areas)

    def _unseen(self) -> Misses | None:
        """Create a test for bases from which the robot itself hides what has to be visible."""
        names, visibility = self.spec.validator.to_see(self.spec.demand), self.scene.visibility
        each = [unseen for name in names if (unseen := visibility.unseen(name)) is not None]
        return (lambda bases: np.any([unseen(bases) for unseen in each], axis=0)) if each else None


def _within(centre: tuple[float, float], least: float, most: float, bases: Array) -> Array:
    """Weigh bases (m, 3): 1 between two distances [m] from a centre, else 0."""
    distances = np.linalg.norm(bases[:, :2] - centre, axis=1)
    return np.where((distances >= least) & (distances <= most), 1.0, 0.0)
