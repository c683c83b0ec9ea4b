"""Resolves locations: places for the base, ways of a hand, poses of objects; lazily, best first, judged exactly.

A base that has to reach something is looked for by inverting reachability maps (``reaching``), any other on a grid
around what it is about (``standing``). When a first, natural choice of hand poses leads to nothing, more and more of
them are looked at (``effort``) before the resolution fails.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from executive.belief.free_floor import BasePose
from executive.belief.planning_scene import PlanningScene
from executive.locations.answers import Answers
from executive.locations.areas import SIDES
from executive.locations.effort import EFFORTS, Extent
from executive.locations.hand_terms import hand_holds
from executive.locations.hand_ways import ways_of
from executive.locations.inverse_map import InverseMaps
from executive.locations.judging import BaseJudge
from executive.locations.meaningless import meaningless
from executive.locations.reach import Reach, ReachSolution, from_base, is_among, stopped_by
from executive.locations.reaching import ReachingSearch
from executive.locations.rejections import COLLISION, Rejections
from executive.locations.relations import BaseDemand, base_demand, hand_demand, thing_demand
from executive.locations.resting import thing_holds, thing_poses
from executive.locations.solving import unblocked
from executive.locations.standing import standing_places
from executive.robots.arms import ArmModel
from planlang.designators import Device, Location, Object
from planlang.failures import DesignatorFailure, MissingCapability
from planlang.geometry import Array, Pose
from planlang.protocols import Solution

APART = 0.05
"""Solutions are farther apart than this [m]; to four decimals, as maps have places just so far apart."""
MOST_VIEWERS = 256
"""Locations of which is remembered from where they were looked for."""


class Resolver:
    """Turns locations into places for the base, ways of the hand and poses of objects."""

    def __init__(self, scene: PlanningScene) -> None:
        self.scene = scene
        self.maps = InverseMaps(scene.robot.torso)
        self._judge = BaseJudge(scene, self.maps)
        self._answers: Answers[Solution] = Answers()
        self._viewers: dict[Location, tuple[float, float]] = {}
        self._here: dict[Location, tuple[object, bool]] = {}

    # Places for the base

    def bases(self, location: Location, log: Rejections | None = None) -> Iterator[Solution]:
        """Places that satisfy a location, lazily, best first; raises LocationUnresolvable when there are no more.

        Raises MissingCapability if the robot has no arm, or no camera, for what is asked. Answers are kept until the
        belief changes or the robot moves. ``log`` is told all that is looked at, anew.
        """
        self._look(location)
        if log is not None:
            return self._bases(location, log)
        state = (self.scene.revision(), self.scene.posture())
        return self._answers.of(location, state, lambda: self._bases(location, Rejections()))

    def satisfies(self, location: Location, base: BasePose) -> Solution | None:
        """The solution at one given base, or None."""
        demand = base_demand(location, self.scene, self._viewer(location))
        return self._judge.at(base, 1.0, demand, self._judge.arms(demand), Rejections())

    def _bases(self, location: Location, log: Rejections) -> Iterator[Solution]:
        scene, judge = self.scene, self._judge
        demand = base_demand(location, scene, self._viewer(location))
        wanted = judge.wanted(demand)
        arms = judge.arms(demand)
        self._check_parts(location, demand)
        for reach in wanted:
            judge.check_hands(reach, location)
        found: list[BasePose] = []
        x, y, yaw = scene.base()
        here = (x, y, math.remainder(yaw, 2 * math.pi))
        if (solution := judge.at(here, 1.0, demand, arms, log)) is not None:
            found.append(here)
            yield solution

        def is_taken(base: BasePose) -> bool:
            """Whether a place near to that was found."""
            return any(round(math.dist(base[:2], other[:2]), 4) <= APART for other in found)

        before, again = log.copy(), False
        for effort in EFFORTS if wanted else EFFORTS[:1]:
            if not log.counts[COLLISION]:  # nothing that a few degrees would help with
                effort = replace(effort, extent=min(effort.extent, Extent.ALL))
            log.begin_again(before)
            places = (
                ReachingSearch(judge, wanted, demand, arms, effort, log, is_taken if again else None).places()
                if wanted
                else standing_places(judge, demand, log)
            )
            for solution in places:
                if is_taken(solution.base):
                    continue
                found.append(solution.base)
                yield solution
            again = bool(found)  # what was found is found again: it need not be judged once more
        raise log.failure(location, after=len(found))

    def _check_parts(self, location: Location, demand: BaseDemand) -> None:
        """Raises MissingCapability if the robot has no part that could do what is asked, wherever it stands."""
        scene, wanted = self.scene, self._judge.wanted(demand)
        said, part = "", "ArmComponent"
        if demand.seen and not scene.visibility.sighted():
            said, part = "the robot has no camera", "Camera"
        elif (wanted or demand.unreached) and not scene.arms.all:
            said = "the robot has no arm that could reach there"
        elif any(reach.arms == () for reach in wanted):
            said = "the robot has no arm as it is asked for"
        if said:
            raise MissingCapability(said, designator=str(location), missing=(part,))

    def reached_from(self, base: BasePose) -> Mapping[tuple[str, BasePose], Mapping[Reach, ReachSolution]]:
        """How arms can reach from a place what was asked for when it was found, if that is the last that was found."""
        return self._judge.reached_from(base)

    def remember(self, reached: Mapping[tuple[str, BasePose], Iterable[ReachSolution]]) -> None:
        """The inverse of :meth:`reached_from`."""
        self._judge.remember(reached)

    def viewers(self) -> list[tuple[Location, tuple[float, float]]]:
        """From where locations that name a side were looked for last, in that order."""
        return [(location, place) for location, place in self._viewers.items() if _names_a_side(location)]

    def remember_viewers(self, viewers: Iterable[tuple[Location, tuple[float, float]]]) -> None:
        """The inverse of :meth:`viewers`; nothing else is remembered then."""
        self._viewers = dict(viewers)

    # Ways of a hand

    def is_grasp(self, location: Location) -> bool:
        """Whether a location is where a hand takes hold of something; False for a posture and what means nothing."""
        try:
            return hand_demand(location, self.scene, self._viewer(location)).kind == "grasp"
        except DesignatorFailure:
            return False

    def hands(self, location: Location, arm: ArmModel, seed: Array) -> Iterator[ReachSolution]:
        """Ways of a hand to a location from where the base stands; raises LocationUnresolvable when there are no more.

        Near ``seed`` (d,), the arm's joint values, where several are as good; a way by which the place was found first.
        """
        scene = self.scene
        reach = replace(hand_demand(location, scene, self._viewer(location)), arms=None)
        self._judge.check_hands(replace(reach, arms=(arm.name,)), location)
        base = scene.base()
        known = {replace(other, arms=None): way for other, way in self._judge.reached(arm.name, base).items()}.get(
            reach
        )
        log = Rejections()
        stated = None if known is None else ways_of(reach, arm, scene, Rejections(), Extent.CLOSEST)
        if (
            known is not None
            and stated is not None
            and is_among(known, stated)
            and stopped_by(known, base, scene) is None
        ):
            yield known  # still a way: what it is about has not moved since
        begun = seed if known is None else known.joints[min(1, len(known.joints) - 1)]
        for extent in Extent if reach.kind == "grasp" else (Extent.NATURAL, Extent.ALL):
            counted = Rejections() if extent else log
            ways = ways_of(reach, arm, scene, counted, extent)
            found = False
            if ways is not None:
                ways = unblocked(ways, scene.collisions.arm_check(arm, ways.touches, opened=ways.opened), counted)
                for way in from_base(reach, base, arm, ways, scene, self.maps, counted, seed=begun, generous=True):
                    found = True
                    yield way
            if found:
                break
        raise log.failure(location, after=int(found))

    # Poses of objects

    def things(self, location: Location, what: Object, log: Rejections | None = None) -> Iterator[Pose]:
        """Poses of an object's box centre at a location, best first; raises LocationUnresolvable at the end."""
        scene, log = self.scene, log or Rejections()
        name = scene.bodies.bind(what)
        size = scene.bodies.size(name)
        self._look(location)
        demand = thing_demand(location, name, scene, self._viewer(location))
        if demand.on is None and demand.inside is None and not any(inside for _, inside in demand.people):
            needed = (("on", "in_"), " or ", ("in_reach_of",), " a person")
            raise meaningless(location, location, f" does not say where {name} rests: it needs ", *needed)
        found = 0
        for pose in thing_poses(name, size, demand, scene, log):
            if thing_holds(name, pose, size, demand, scene):
                found += 1
                yield pose
        raise log.failure(location, after=found)

    # What holds now

    def holds(self, location: Location, what: Object | None = None) -> bool:
        """Whether the base, the hand of a device, or an object is at a location, judged as candidates are."""
        scene = self.scene
        if what is None:
            state = (scene.revision(), scene.posture(), self._viewer(location))
            if self._here.get(location, (None, False))[0] != state:
                while len(self._here) >= MOST_VIEWERS:
                    del self._here[next(iter(self._here))]
                self._here[location] = state, self.satisfies(location, scene.base()) is not None
            return self._here[location][1]
        viewer = self._viewer(location)
        if isinstance(what, Device):
            return any(hand_holds(location, arm, scene, viewer) for arm in scene.arms.of(what))
        name = scene.bodies.bind(what)
        size = scene.bodies.size(name)
        demand = thing_demand(location, name, scene, viewer)
        return thing_holds(name, scene.bodies.pose(name), size, demand, scene)

    def _look(self, location: Location) -> None:
        """From now on it is the present place from which a location's left and right are seen, at all that is found."""
        x, y, _ = self.scene.base()
        for inner in (location, *(r.reference for r in location.relations if isinstance(r.reference, Location))):
            self._viewers.pop(inner, None)
            self._viewers[inner] = x, y
        while len(self._viewers) > MOST_VIEWERS:
            del self._viewers[next(iter(self._viewers))]

    def _viewer(self, location: Location) -> tuple[float, float]:
        """From where a location was looked for last; places there, and at them, are judged as seen from there."""
        x, y, _ = self.scene.base()
        return self._viewers.get(location, (x, y))


def _names_a_side(location: Location) -> bool:
    """Whether it may matter from where a location is seen."""
    inner = (relation.reference for relation in location.relations if isinstance(relation.reference, Location))
    return any(relation.name in SIDES for relation in location.relations) or any(map(_names_a_side, inner))
