"""Resolves locations: places for the base, ways of a hand, poses of objects; lazily, best first, judged exactly.

A base that has to reach something is looked for by inverting reachability maps (``reaching``), any other on a grid
around what it is about (``standing``). When a first, natural choice of hand poses leads to nothing, all of them are
looked at once before the resolution fails.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from executive.locations.answers import Answers
from executive.locations.effort import EFFORTS
from executive.locations.hand_ways import ways_of
from executive.locations.inverse_map import InverseMaps
from executive.locations.judging import BaseJudge
from executive.locations.reach import Reach, ReachSolution, from_base, touched_by
from executive.locations.reaching import ReachingSearch
from executive.locations.rejections import Rejections
from executive.locations.relations import base_demand, hand_demand, thing_demand
from executive.locations.resting import thing_holds, thing_poses
from executive.locations.solving import unblocked
from executive.locations.standing import standing_places
from executive.locations.surroundings import ArmModel, Base, Surroundings
from executive.locations.ways import Ways
from planlang.designators import Device, Location, Object
from planlang.failures import LocationUnresolvable
from planlang.protocols import Array, Pose, Solution

APART = 0.05
"""Solutions are at least this far apart [m]."""


class Resolver:
    """Turns locations into places for the base, ways of the hand and poses of objects."""

    def __init__(self, around: Surroundings) -> None:
        self.around = around
        self._inverse = InverseMaps(around)
        self._judge = BaseJudge(around, self._inverse)
        self._answers: Answers[Solution] = Answers()

    # Places for the base

    def bases(self, location: Location, log: Rejections | None = None) -> Iterator[Solution]:
        """Places that satisfy a location, lazily, best first; raises LocationUnresolvable when there are no more.

        Answers are kept until the belief changes or the robot moves. ``log`` is told all that is looked at, anew.
        """
        if log is not None:
            return self._bases(location, log)
        state = (self.around.revision(), self.around.posture())
        return self._answers.of(location, state, lambda: self._bases(location, Rejections()))

    def satisfies(self, location: Location, base: Base) -> Solution | None:
        """The solution at one given base, or None."""
        demand = base_demand(location, self.around)
        return self._judge.at(base, 1.0, demand, self._judge.arms(demand), Rejections())

    def _bases(self, location: Location, log: Rejections) -> Iterator[Solution]:
        around, judge = self.around, self._judge
        demand = base_demand(location, around)
        wanted = judge.wanted(demand)
        arms = judge.arms(demand)
        if (wanted or demand.unreached) and not around.arms:
            raise LocationUnresolvable("the robot has no arm that could reach there", designator=str(location))
        if wanted and not arms:
            raise LocationUnresolvable("the robot has no arm as it is asked for", designator=str(location))
        found: list[Base] = []
        x, y, yaw = around.base()
        here = (x, y, math.remainder(yaw, 2 * math.pi))
        if (solution := judge.at(here, 1.0, demand, arms, log)) is not None:
            found.append(here)
            yield solution
        before = log.copy()
        for effort in EFFORTS if wanted else EFFORTS[:1]:
            log.begin_again(before)
            places = (
                ReachingSearch(judge, wanted, demand, arms, effort, log).places()
                if wanted
                else standing_places(judge, demand, log)
            )
            for solution in places:
                if any(math.dist(solution.base[:2], other[:2]) <= APART for other in found):
                    continue
                found.append(solution.base)
                yield solution
            if found:
                break
        raise log.failure(location)

    def reached_from(self, base: Base) -> Mapping[tuple[str, Base], Mapping[Reach, ReachSolution]]:
        """How arms can reach from a place what was asked for when it was found, if that is the last that was found."""
        return self._judge.reached_from(base)

    def remember(self, reached: Mapping[tuple[str, Base], Iterable[ReachSolution]]) -> None:
        """The inverse of :meth:`reached_from`."""
        self._judge.remember(reached)

    # Ways of a hand

    def hands(self, location: Location, arm: ArmModel, seed: Array) -> Iterator[ReachSolution]:
        """Ways of a hand to a location from where the base stands; raises LocationUnresolvable when there are no more.

        Near ``seed`` (d,), the arm's joint values, where several are as good; a way by which the place was found first.
        """
        around = self.around
        reach = replace(hand_demand(location, around), arms=None)
        base = around.base()
        known = {replace(other, arms=None): way for other, way in self._judge.reached(arm.name, base).items()}.get(
            reach
        )
        log = Rejections()
        stated = None if known is None else ways_of(reach, arm, around, Rejections(), fine=True)
        if (
            known is not None
            and stated is not None
            and _among(known, stated)
            and touched_by(known, base, around) is None
        ):
            yield known  # still a way: what it is about has not moved since
        begun = seed if known is None else known.joints[min(1, len(known.joints) - 1)]
        for fine in (False, True):
            counted = Rejections() if fine else log
            ways = ways_of(reach, arm, around, counted, fine=fine)
            found = False
            if ways is not None:
                ways = unblocked(ways, arm, around.solids(), counted)
                for way in from_base(reach, base, arm, ways, around, self._inverse, counted, seed=begun, generous=True):
                    found = True
                    yield way
            if found:
                break
        raise log.failure(location)

    # Poses of objects

    def things(self, location: Location, what: Object, log: Rejections | None = None) -> Iterator[Pose]:
        """Poses of an object's box centre at a location, best first; raises LocationUnresolvable at the end."""
        around, log = self.around, log or Rejections()
        name = around.bind(what)
        size = around.size(name)
        x, y, _ = around.base()
        demand = thing_demand(location, around, max(size[:2]) / 2, (x, y))
        if demand.on is None and demand.inside is None and not any(inside for _, inside in demand.people):
            raise LocationUnresolvable(
                f"{location} does not say where {name} rests: it needs on, in_ or in_reach_of a person",
                designator=str(location),
            )
        for pose in thing_poses(name, size, demand, around, log):
            if thing_holds(name, pose, size, demand, around):
                yield pose
        raise log.failure(location)

    # What holds now

    def holds(self, location: Location, what: Object | None = None) -> bool:
        """Whether the base, the hand of a device, or an object is at a location, judged as candidates are."""
        around = self.around
        if what is None:
            return self.satisfies(location, around.base()) is not None
        if isinstance(what, Device):
            reach = hand_demand(location, around)
            return any(self._is_at(reach, arm) for arm in around.arms_of(what))
        name = around.bind(what)
        size = around.size(name)
        x, y, _ = around.base()
        demand = thing_demand(location, around, max(size[:2]) / 2, (x, y))
        return thing_holds(name, around.pose(name), size, demand, around)

    def _is_at(self, reach: Reach, arm: ArmModel) -> bool:
        """Whether a hand is within 2 cm and 0.2 rad of a key pose or the first pose of a way."""
        around = self.around
        tip = around.tip(arm)
        ways = ways_of(reach, arm, around, Rejections(), fine=True)
        if ways is None:
            return False
        poses = ways.poses(np.arange(len(ways)))[:, [0, ways.key]].reshape(-1, 4, 4)
        away = np.linalg.norm(poses[:, :3, 3] - tip[:3, 3], axis=1)
        cosine = (np.einsum("nij,ij->n", poses[:, :3, :3], tip[:3, :3]) - 1) / 2
        return bool(((away < 0.02) & (cosine > math.cos(0.2))).any())


def _among(known: ReachSolution, ways: Ways) -> bool:
    """Whether a way's poses are those of one of some ways."""
    poses = ways.poses(np.arange(len(ways)))
    if poses.shape[1:] != known.plan.poses.shape:
        return False
    return bool((np.abs(poses - known.plan.poses).max(axis=(1, 2, 3)) < 1e-6).any())
