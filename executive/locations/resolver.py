"""Resolves locations to base poses, hand solutions and poses of things: lazily, best first, validated exactly.

A location is bound to the planning scene (``demands``). Base poses come from reachability maps if something has to be
reached (``search``), else from the floor (``floor_search``), and are validated (``validation``). When the first,
natural hand poses lead to nothing, more and more are considered (``BUDGETS``) before it fails.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import partial
from itertools import islice

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.belief.scene_part import Kept
from executive.locations.changes import CLOSE, with_supports
from executive.locations.demands import (
    BaseDemand,
    base_demand,
    bodies_meant,
    goals_of,
    hand_demand,
    meaningless,
    names_a_side,
    thing_demand,
    use_at,
)
from executive.locations.explanations import explain_bases, explain_hands
from executive.locations.hand_predicates import Stage, hand_holds
from executive.locations.hand_solutions import HandSolution, from_base, with_torso_still
from executive.locations.inverse_maps import InverseMaps
from executive.locations.later_bringing import lacking_later
from executive.locations.leaf_ways import leaves_used
from executive.locations.looks import Looks
from executive.locations.placement import IN_THE_WAY, Placement
from executive.locations.questions import (
    ALL,
    EASY_CHECKS,
    EASY_SOLVED,
    MOST_CHECKS,
    MOST_SOLVED,
    Allowance,
    Findings,
    Question,
)
from executive.locations.rejections import NOT_VISIBLE, Rejections, unmet
from executive.locations.replayable import Replayable
from executive.locations.search import first_base, search_bases
from executive.locations.search_count import SearchCount
from executive.locations.shut_ways import behind_doors, to_close
from executive.locations.supposed import at_rest, with_in_hand
from executive.locations.validation import BaseValidator
from executive.robots.arms import ArmModel
from planlang.designators import Device, Location, Object, action
from planlang.failure_wording import NO_WAY
from planlang.failures import DesignatorFailure, LocationUnresolvable, MissingCapability
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Clear, Facing, Region
from planlang.kept import Latest
from planlang.language.performances import by_class
from planlang.language.performing import actions_around
from planlang.language.remaining import remaining_actions
from planlang.progress import Report, unreported
from planlang.protocols import Solution
from planlang.relations.demands import Reach, ReachKind
from planlang.state import WorldState

MOST_SUPPOSED = 16
"""Number of hypotheses whose answers are remembered."""
MOST_QUESTIONS = 32
"""Number of locations whose answers are remembered."""
MOST_VIEWERS = 256
"""Number of locations whose viewpoint is remembered."""


class Resolver:
    """Turns locations into base poses, hand solutions and poses of objects."""

    def __init__(self, scene: PlanningScene, report: Report = unreported) -> None:
        """``report`` gets the progress of searches, and of reachability maps that have to be built."""
        self.scene, self._report = scene, report
        self.maps = InverseMaps(scene.robot.name, report)
        self.count = SearchCount()
        self._validator = BaseValidator(scene, self.maps)
        self._answers: Kept[Latest[Hashable, Replayable[Solution]]] = Kept(1)
        self._supposed: Kept[Resolver] = Kept(MOST_SUPPOSED)
        self._viewers: Latest[Location, tuple[float, float]] = Latest(MOST_VIEWERS)
        self._here: Kept[dict[Hashable, bool]] = Kept(1)
        self.watchers: list[Callable[[Location, Rejections], object]] = []
        """Called with the log of each search for base poses when it begins; the log then keeps the places examined."""

    def supposing(self, scene: PlanningScene) -> Resolver:
        """Return the resolver of a scene that is supposed; equal ones share it, with all answers found so far."""
        viewers = {location: place for location, place in self._viewers.items() if names_a_side(location)}

        def make() -> Resolver:
            other = copy(self)
            other.scene, other._validator, other._answers = scene, BaseValidator(scene, self.maps), Kept(1)
            other._viewers, other._here, other.watchers = Latest(MOST_VIEWERS, viewers), Kept(1), []
            return other

        memory = scene.belief.memory
        return self._supposed.of((scene.content(), memory.bound, memory.meanings, viewers), make)

    def when(self, state: WorldState) -> Resolver:
        """Return the resolver that answers what locations would resolve to in another state."""
        return self.supposing(self.scene.supposing(state))

    # Base poses

    def bases(self, location: Location, log: Rejections | None = None) -> Iterator[Solution]:
        """Yield base poses that satisfy a location, lazily, best first; raises LocationUnresolvable at the end.

        Raises MissingCapability without a suitable arm or camera, and BudgetExceeded for one search too many. Results
        are cached until the belief changes or the robot moves. ``log`` forces a new search and receives its rejections.
        """
        self._look(location)
        if log is not None:
            return self._reported(location, self._bases(location, Question(log)))
        # enclosing and later actions restrict the grips, and say what designators by class mean
        question = location, tuple(actions_around()), self._meant(location), tuple(remaining_actions())
        answers = self._answers.of(self.scene.content(), lambda: Latest(MOST_QUESTIONS))

        def search() -> Iterator[Solution]:
            return self._reported(location, self._bases(location, self._question(location)))

        if question not in answers:
            self.count.begin(location)
        return iter(answers.of(question, lambda: Replayable(search)))

    def _reported(self, location: Location, found: Iterator[Solution]) -> Iterator[Solution]:
        """Report a search for base poses while it works on the next one."""
        things = ", ".join(dict.fromkeys(map(str, location.things()))) or str(location)
        while True:
            self._report(f"searching for a place to stand for {things}", math.nan)
            try:
                solution = next(found, None)
            finally:
                self._report("", 1.0)
            if solution is None:
                return
            yield solution

    def look_at_unseen(self, location: Location) -> Solution | None:
        """Find a look at an unreachable thing known only from the map, since it may stand elsewhere; None without.

        The thing cannot be reached from there, but the look may lead to such a pose.
        """
        demand = base_demand(location, self.scene, self._viewer(location))
        return Looks(self._validator).instead(self._validator.wanted(demand))

    def satisfies(self, location: Location, base: BasePose) -> Solution | None:
        """Validate one given base pose; None if it does not satisfy the location."""
        demand, validator = base_demand(location, self.scene, self._viewer(location)), self._validator
        handled = (name for name in validator.to_see(demand) if name not in demand.seen)
        known = tuple(name for name in handled if self.scene.belief.remembers(name))
        return validator.at(base, 1.0, replace(demand, remembered=known), validator.arms(demand), Question())

    def _bases(self, location: Location, question: Question) -> Iterator[Solution]:
        """Derive demands, try the present base pose, then search with growing budgets."""
        scene, validator = self.scene, self._validator
        demand = base_demand(location, scene, self._viewer(location))
        self._check_parts(location, demand)
        for reach in validator.wanted(demand):
            validator.check_hands(self._with_uses(reach), location)
        found: list[BasePose] = []
        for goal in (goal for reach in demand.reaches for goal in self._goals(reach)):
            self._look(goal)
        with_uses = replace(demand, reaches=tuple(map(self._with_uses, demand.reaches)))
        first = None if with_uses == demand else self._question(location)
        if first is not None:
            yield from self._found(with_uses, first, found)
        if first is not None and not any(one.then for one in with_uses.reaches) and not first.log.counts[IN_THE_WAY]:
            question.log.include(first.log)  # nothing is in the way of a later step: the other search would be the same
            question = replace(question, known=first.known)
        else:
            yield from self._found(demand, question, found)
        if not found:
            validator.check_doors(validator.wanted(demand), location, question.log)
            self._check_way(location, demand, question.log)
        findings = Findings(Allowance(EASY_CHECKS, EASY_SOLVED), walled=question.known.walled)
        if not found and (excluding := self._excluding(demand, findings, question.log)) is not None:
            # what is said of the thing to reach would lead astray: it can be reached
            words = excluding.words.replace("not not ", "")
            question.log.figures = {unmet(excluding): f"without {words!r} there would be a place"}
            raise question.log.failure(location, self.scene.bodies)
        is_feasible = None if found else partial(self._is_feasible, location, findings, shares=True)
        meant = bodies_meant(location, actions_around(), scene)
        own = Findings(Allowance(EASY_CHECKS, EASY_SOLVED), walled=question.known.walled)
        once_moved = None if found else partial(self._is_feasible, location, own)
        # what the hand would reach may be looked at from elsewhere
        emptied = Findings(Allowance(EASY_CHECKS, EASY_SOLVED), walled=question.known.walled)
        once_emptied = None if found else partial(self._is_feasible, location, emptied, blind=True)
        arms, wanted = validator.arms(demand), validator.wanted(demand)
        later = None if found else partial(self._lacking_later, location, findings)
        explain_bases(wanted, arms, scene, self.maps, question, is_feasible, once_moved, once_emptied, meant, later)
        raise question.log.failure(location, self.scene.bodies, after=len(found))

    def _check_way(self, location: Location, demand: BaseDemand, log: Rejections) -> None:
        """Raise a failure if the base cannot drive there because of a door between rooms, as it is."""
        if not log.counts[NO_WAY]:
            return
        is_possible = partial(self.is_possible, location)
        names = (*(reach.body for reach in demand.reaches), *(one.name for one in location.things()), str(location))
        behind = behind_doors(self.scene, is_possible, names[0], str(location))
        if behind is not None:
            raise behind
        if (leaf := to_close(self.scene, is_possible)) is not None:
            log.first = action(CLOSE, object_acted_on=self.scene.bodies.designator(leaf))
            log.figures = {NO_WAY: f"with {leaf} closed, the base could drive there"}
            raise log.failure(location, self.scene.bodies)

    def _question(self, location: Location) -> Question:
        log = Rejections(remembers=bool(self.watchers))
        for watcher in self.watchers:
            watcher(location, log)
        return Question(log)

    def _is_feasible(
        self,
        location: Location,
        common: Findings,
        scene: PlanningScene,
        *,
        blind: bool = False,
        shares: bool = False,
    ) -> bool | None:
        """Check quickly whether a location has a base pose in a scene that is supposed; ``blind``: without sight.

        ``common`` has what all these searches share: exact checks that are left, and whether the floor is walled.
        With ``shares`` this search gets no more than a part of them. None if its checks ended before it was known.
        """
        left = common.allowance
        if left.is_spent:
            return None
        demand = base_demand(location, scene, self._viewer(location))
        validator = self.supposing(scene)._validator
        granted = left.part() if shares else left
        own = Findings(replace(granted), walled=common.walled)
        found = first_base(validator, (validator.blind(demand) if blind else None) or demand, own)
        left.checks -= granted.checks - own.allowance.checks
        left.solved -= granted.solved - own.allowance.solved
        if found is not None:
            return True
        return None if own.allowance.is_spent else False

    def _lacking_later(self, location: Location, common: Findings, scene: PlanningScene) -> str:
        """Say what of the remaining task has no way in a scene that is supposed, once a location there is reached.

        Where the thing that is grasped there is brought, and the other things that later steps bring somewhere.
        """
        base, reached = self._first_reached(location, common, scene)
        grasp = next((one for one in reached if one.reach.kind is ReachKind.GRASP), None)
        if grasp is None:
            return ""
        steps = [*actions_around(), *remaining_actions()]
        there = at_rest(scene, scene.belief.state, base)
        then = scene.supposing(with_in_hand(scene, there, grasp))
        return lacking_later(steps, grasp.reach.body, then, scene, partial(self._is_feasible_from, common))

    def first_reached(self, location: Location, scene: PlanningScene) -> tuple[BasePose, list[HandSolution]]:
        """Find quickly a base pose for a location in a scene that is supposed, and how hands reach from there.

        No hand if there is none.
        """
        return self._first_reached(location, Findings(Allowance(EASY_CHECKS, EASY_SOLVED), walled=True), scene)

    def _first_reached(
        self, location: Location, common: Findings, scene: PlanningScene
    ) -> tuple[BasePose, list[HandSolution]]:
        resolver, demand = self.supposing(scene), base_demand(location, scene, self._viewer(location))
        found = first_base(resolver._validator, demand, common)
        if found is None:
            return scene.base(), []
        return found.base, [one for each in resolver.reached_from(found.base).values() for one in each.values()]

    def _is_feasible_from(self, common: Findings, location: Location, scene: PlanningScene) -> bool | None:
        """Check as :meth:`_is_feasible` does; None also for a location that its own step will report as wrong."""
        try:
            return self._is_feasible(location, common, scene)
        except DesignatorFailure:
            return None

    def waits_for(self, location: Location) -> tuple[str, ...]:
        """Name what drives by itself and keeps the base from a location where it stands now; empty for other reasons.

        More than one if all of them have to leave.
        """
        movers = self.movers_beside(location)
        for gone in (*((name,) for name in movers), *([movers] if len(movers) > 1 else [])):
            scene = self.scene.supposing(self.scene.belief.state.placed(dict.fromkeys(gone)))
            if self.is_possible(location, scene):
                return gone
        return ()

    def movers_beside(self, location: Location) -> tuple[str, ...]:
        """Name what drives by itself, but for what a location is about: without that it would mean nothing."""
        needed = with_supports(bodies_meant(location, actions_around(), self.scene), self.scene.bodies)
        return tuple(name for name in self.scene.movers() if name not in needed)

    def is_possible(self, location: Location, scene: PlanningScene | None = None) -> bool:
        """Check quickly whether a location has a base pose, by default in the scene as it is believed."""
        findings = Findings(Allowance(EASY_CHECKS, EASY_SOLVED), walled=True)
        return self._is_feasible(location, findings, scene or self.scene) is True

    def _excluding(self, demand: BaseDemand, common: Findings, log: Rejections) -> Region | Facing | Clear | None:
        """Find the conjunct about the floor without which there would be a base pose; None if there is none."""
        areas = [area for area in demand.areas if log.counts[unmet(area)]]
        for area in areas if demand.reaches or demand.seen or len(demand.areas) > 1 else ():
            others = replace(demand, areas=tuple(one for one in demand.areas if one != area))
            if not common.allowance.is_spent and first_base(self._validator, others, common) is not None:
                return area
        return None

    def _goals(self, reach: Reach) -> Sequence[Location]:
        """List where the thing that is grasped is put or handed over by enclosing actions, or else by the next that is.

        A step that only fetches it may be followed by one that puts it where not every grip, or hand, gets.
        """
        if reach.kind is not ReachKind.GRASP:
            return ()
        around = goals_of(reach.body, actions_around(), self.scene)
        return around or goals_of(reach.body, remaining_actions(), self.scene)[:1]

    def _clear(self) -> tuple[str, ...]:
        """List the doors and drawers that later steps use while a hand holds something, which it may put down.

        So do steps in progress that do not state where: what is put down meanwhile is in no way of their work.
        """
        if not self.scene.belief.held:
            return ()
        around = (one for one in actions_around() if one.get("to_location") is None)
        return leaves_used((*around, *remaining_actions()), self.scene)

    def _with_uses(self, reach: Reach) -> Reach:
        """Add to a grasp later uses of the thing, and to where one is put the leaves that later steps use."""
        if reach.kind is ReachKind.PLACE:
            return replace(reach, clear=self._clear())
        uses = [use_at(goal, reach.body, self.scene, self._viewer(goal)) for goal in self._goals(reach)]
        return reach if not uses else replace(reach, then=tuple(use for use in uses if use is not None))

    def _found(self, demand: BaseDemand, question: Question, found: list[BasePose]) -> Iterator[Solution]:
        """Yield base poses, with looks to take beforehand, and add them to those already ``found``.

        If sight alone is lacking, base poses without sight of the handled things come with a look from elsewhere.
        """
        before, looks, validator = len(found), Looks(self._validator), self._validator
        for solution in looks.before(search_bases(validator, demand, question, found), validator.wanted(demand)):
            question.known.allowance = Allowance(ALL, ALL)  # only an answer that there is none has to come soon
            yield solution
        blind = validator.blind(demand)
        if len(found) == before and question.log.counts[NOT_VISIBLE] and blind is not None:
            unseen = [name for name in blind.remembered if not self.scene.belief.remembers(name)]
            views = {name: looks.view(name) for name in unseen}
            if None not in views.values():
                question.known.allowance.grant(MOST_CHECKS // 4, MOST_SOLVED // 4)
                for solution in search_bases(validator, blind, question.uncounted(), found):
                    yield looks.first(views, solution)
        question.known.inversions.clear()  # the traceback of a failure would keep them alive

    def _check_parts(self, location: Location, demand: BaseDemand) -> None:
        """Raise MissingCapability if the robot has no part for what is required, wherever it stands."""
        scene, wanted = self.scene, self._validator.wanted(demand)
        problem, part = "", "ArmComponent"
        if demand.seen and not scene.visibility.sighted():
            problem, part = "the robot has no camera", "Camera"
        elif (wanted or demand.unreached) and not scene.arms.all:
            problem = "the robot has no arm that could reach there"
        elif any(reach.arms == () for reach in wanted):
            named = [one for one in (location, *location.references()) if isinstance(one, Location)]
            lacking = (scene.robot.without(one.device) for one in named if one.device is not None)
            problem = next(filter(None, lacking), f"{scene.robot.name} has no such arm")
        if problem:
            raise MissingCapability(problem, designator=str(location), missing=(part,))

    def reached_from(self, base: BasePose) -> Mapping[tuple[str, BasePose], Mapping[Reach, HandSolution]]:
        """Hand solutions with which the last base pose found was validated."""
        return self._validator.reached_from(base)

    # Hand solutions

    def is_grasp(self, location: Location) -> bool:
        """Check whether a hand grasps something there; False for a posture or a meaningless location."""
        try:
            return hand_demand(location, self.scene, self._viewer(location)).kind is ReachKind.GRASP
        except DesignatorFailure:
            return False

    def hands(self, location: Location, arm: ArmModel, seed: Array) -> Iterator[HandSolution]:
        """Yield hand solutions for a location from the present base pose; raises LocationUnresolvable at the end.

        Among equally good ones those near ``seed`` (d,), the arm's joint values, come first; before them the one with
        which the base pose was found.
        """
        scene = self.scene
        reach = replace(hand_demand(location, scene, self._viewer(location)), arms=None)
        self._validator.check_hands(replace(reach, arms=(arm.name,)), location)
        base = scene.base()
        with_uses, known = self._with_uses(reach), self._validator.known
        # if the base pose was found with a grip that suits no later use, that grip is the known one
        if with_uses != reach and (known(reach, arm, base) is None or known(with_uses, arm, base)):
            with suppress(LocationUnresolvable):
                yield from self._hands(with_uses, arm, seed, location)
        yield from self._hands(reach, arm, seed, location)

    def _hands(self, reach: Reach, arm: ArmModel, seed: Array, location: Location) -> Iterator[HandSolution]:
        base, log = self.scene.base(), Rejections()
        known = self._validator.known(reach, arm, base)
        if known is not None and self._validator.still_reaches(known, reach, base):
            still = with_torso_still(known, seed, base)
            if still is not None and self._validator.still_reaches(still, reach, base):
                yield still
            yield known  # nothing relevant has moved since
        first_seed = seed if known is None else known.joints[min(1, len(known.joints) - 1)]
        # few of the good places for a thing may be in reach, and those may have no path for the arm
        first = Stage.ALL if reach.kind is ReachKind.PLACE else Stage.NATURAL
        last = Stage.CLOSEST if reach.kind in (ReachKind.GRASP, ReachKind.OFFER, ReachKind.PLACE) else Stage.ALL
        for stage in tuple(Stage)[first : last + 1]:
            counted = log if stage is first else Rejections()
            found = False
            tables = self._validator.candidates(reach, arm, counted, stage)
            for candidate in from_base(
                reach, base, arm, tables, self.scene, self.maps, counted, seed=first_seed, beyond=arm.seeds
            ):
                found = True
                yield candidate
            if found:
                break
        else:
            explain_hands(reach, arm, self.scene, self.maps, log)
        raise log.failure(location, self.scene.bodies, after=int(found))

    # Poses of objects

    def things(self, location: Location, what: Object, log: Rejections | None = None) -> Iterator[Pose]:
        """Yield poses of an object's box centre at a location, best first; raises LocationUnresolvable at the end."""
        scene, log = self.scene, log or Rejections()
        name = scene.bodies.bind(what)
        self._look(location)
        demand = thing_demand(location, name, scene, self._viewer(location))
        if demand.on is None and demand.inside is None and not any(inside for _, inside in demand.people):
            needed = (("on", "in_"), " or ", ("in_reach_of",), " a person")
            raise meaningless(location, location, f" does not state where {name} rests: it needs ", *needed)
        number, placement = 0, Placement(name, demand, scene)
        for pose in placement.poses(log):
            if placement.holds(pose):
                number += 1
                yield pose
        raise log.failure(location, self.scene.bodies, after=number)

    def best_things(self, location: Location, what: Object, most: int) -> Iterator[Pose]:
        """Yield at most ``most`` of :meth:`things`; raises LocationUnresolvable if there are none."""
        is_found = False
        try:
            for pose in islice(self.things(location, what), most):
                is_found = True
                yield pose
        except LocationUnresolvable:
            if not is_found:
                raise

    # Present state

    def holds(self, location: Location, what: Object | None = None) -> bool:
        """Check whether the base, the hand of a device, or an object is at a location, validated as in a search."""
        scene = self.scene
        if what is None:
            key, known = (location, self._viewer(location), self._meant(location)), self._here.of(scene.content(), dict)
            if key not in known:
                known[key] = self.satisfies(location, scene.base()) is not None
            return known[key]
        viewer = self._viewer(location)
        if isinstance(what, Device):
            return any(hand_holds(location, arm, scene, viewer) for arm in scene.arms.of(what))
        name = scene.bodies.bind(what)
        demand = thing_demand(location, name, scene, viewer)
        return Placement(name, demand, scene).holds(scene.bodies.pose(name))

    def _meant(self, location: Location) -> tuple[str | None, ...]:
        """List the bodies that designators by class in a location mean, which differ between performances of a step."""
        return tuple(self.scene.bodies.known(what) for what in by_class(location.things()))

    def _look(self, location: Location) -> None:
        """Fix the viewpoint of a location's left and right at the present base pose."""
        x, y, _ = self.scene.base()
        for inner in (location, *(one for one in location.references() if isinstance(one, Location))):
            self._viewers.renew(inner, (x, y))

    def _viewer(self, location: Location) -> tuple[float, float]:
        """Viewpoint of a location's left and right: where the base was when it was last searched for."""
        x, y, _ = self.scene.base()
        return self._viewers.get(location, (x, y))
