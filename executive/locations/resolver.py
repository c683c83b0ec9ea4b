"""Resolves locations by sampling places around what they are about, best first, validated exactly."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice

import numpy as np

from executive.locations.reach import CHUNK, Reach, ReachSolution, reach_solutions
from executive.locations.rejections import Rejections, first_body
from executive.locations.relations import Demand, base_demand, hand_demand, is_held
from executive.locations.surroundings import ArmModel, Base, Surroundings
from planlang.designators import Location
from planlang.failures import LocationUnresolvable
from planlang.protocols import Array, Solution

BEARINGS = 24
SECTORS = 12
HEADINGS = (0.0, 0.35, -0.35, 0.8, -0.8)
"""Heading of the base relative to the line to the target [rad]."""
MOST_CANDIDATES = 240
"""Places that are looked at exactly, with the natural hand poses."""
MOST_GENEROUS = 80
"""Places that are then looked at with all hand poses, before a resolution gives up."""
CROWDED, MOST_CROWDED = 0.9, 48
"""When more than this share of places has no room, obstacles of so many of them are named at the end."""
RADII = np.array([0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0])
"""Distances from the target at which places are looked for, in lengths of the arm."""
SIGHT_DISTANCES = (0.8, 1.1, 1.4, 1.8, 2.3)
MARGIN = 0.01
"""Free distance around the silhouette that a place to stand must have [m]."""
ANOTHER_PLACE = 0.4
"""Whatever was not seen from one place is looked for from places at least this far away [m]."""
APART = 0.05
"""Consecutive solutions are at least this far apart [m]."""


class Resolver:
    """Turns locations into places for the base and poses of the hand."""

    def __init__(self, around: Surroundings) -> None:
        self.around = around
        self._reached: dict[tuple[str, Base], dict[Reach, ReachSolution]] = {}

    def bases(self, location: Location) -> Iterator[Solution]:
        """Places that satisfy a location, lazily, best first; raises LocationUnresolvable when there are no more."""
        around = self.around
        demand = base_demand(location, around)
        arms = self._arms(location)
        if not arms and demand.reaches:
            raise LocationUnresolvable("the robot has no arm that could reach there", designator=str(location))
        found: list[Base] = []
        rejections = Rejections()
        for generous in (False, True):
            counted = Rejections() if generous else rejections
            most = MOST_GENEROUS if generous else MOST_CANDIDATES
            for base in islice(self._candidates(demand, arms, counted), most):
                if any(math.dist(base[:2], other[:2]) <= APART for other in found):
                    continue
                solution = self._validate(base, demand, arms, counted, generous=generous)
                if solution is not None:
                    found.append(base)
                    yield solution
            if found:
                break
        else:
            self._name_crowding(rejections)
        raise rejections.failure(location)

    def _name_crowding(self, rejections: Rejections) -> None:
        """Count which bodies take the room of the most promising places."""
        for base in rejections.crowded:
            if contacts := self.around.contacts(base):
                rejections.blocking[first_body(contacts)] += 1

    def satisfies(self, location: Location, base: Base) -> Solution | None:
        """The solution at one given base, or None."""
        return self._validate(base, base_demand(location, self.around), self._arms(location), Rejections())

    def hands(self, location: Location, arm: ArmModel, seed: Array) -> Iterator[ReachSolution]:
        """Hand poses for a location from where the base stands; raises LocationUnresolvable when there are no more."""
        demand = hand_demand(location, self.around)
        if len(demand) != 1:
            raise LocationUnresolvable("a hand location needs one reference", designator=str(location))
        base = self.around.base()
        known = self._reached.get((arm.name, _rounded(base)), {}).get(demand[0])
        for start in (_seed(known, seed), None):
            rejections, found = Rejections(), False
            for solution in reach_solutions(
                demand[0], base, arm, self.around, rejections, most_plans=4 * CHUNK, seed=start
            ):
                found = True
                yield solution
            if found:
                break
        raise rejections.failure(location)

    def reached_from(self, base: Base) -> Mapping[tuple[str, Base], Mapping[Reach, ReachSolution]]:
        """How arms can reach from a place what was asked for when it was found, if that is the last that was found."""
        return {key: ways for key, ways in self._reached.items() if key[1] == _rounded(base)}

    def remember(self, reached: Mapping[tuple[str, Base], Iterable[ReachSolution]]) -> None:
        """The inverse of :meth:`reached_from`."""
        self._reached = {key: {way.reach: way for way in ways} for key, ways in reached.items()}

    def _arms(self, location: Location) -> Sequence[ArmModel]:
        """The arms that a location may mean: its device's; else those that hold something; else all."""
        if location.device is not None:
            return self.around.arms_of(location.device)
        holding = [arm for arm in self.around.arms if self.around.held(arm.name) is not None]
        return holding or self.around.arms

    def _candidates(self, demand: Demand, arms: Sequence[ArmModel], rejections: Rejections) -> Iterator[Base]:
        """Places worth a look, where they are now first if it may do, then best first and well spread."""
        x, y, yaw = self.around.base()
        here = (x, y, math.remainder(yaw, 2 * math.pi))
        yield here
        sampled = [self._ring(anchors, arm) for arm in arms or (None,) for anchors in self._anchors(demand)]
        if not sampled:
            return
        bases = np.concatenate([ring for ring, _ in sampled])
        score = np.concatenate([score for _, score in sampled])
        clearance = self.around.clearance(bases)
        crowded = np.flatnonzero(clearance < MARGIN)
        rejections.add("no room for the base", len(crowded))
        if len(crowded) > CROWDED * len(bases):
            promising = crowded[np.argsort(-score[crowded], kind="stable")][:MOST_CROWDED]
            rejections.crowded = [(float(x), float(y), float(yaw)) for x, y, yaw in bases[promising]]
        travel = np.hypot(bases[:, 0] - here[0], bases[:, 1] - here[1])
        score = score * (0.4 + np.clip(clearance, 0.0, 0.3)) * np.exp(-travel / 8.0)
        free = np.flatnonzero(clearance >= MARGIN)
        # rounded: which of equally good places comes first does not depend on where the map has its origin
        order = free[np.argsort(-score[free].round(9), kind="stable")]
        sector = np.floor((bases[order, 2] + 4 * math.pi) / (2 * math.pi / SECTORS)).astype(int) % SECTORS
        rank = np.zeros(len(order), int)
        for value in np.unique(sector):
            members = np.flatnonzero(sector == value)
            rank[members] = np.arange(len(members))
        for index in order[np.argsort(rank, kind="stable")]:
            x, y, yaw = (round(float(value), 4) for value in bases[index])
            yield (x, y, yaw)

    def _anchors(self, demand: Demand) -> Iterator[tuple[Array, str]]:
        """Points (n, 2) of the map around which places are looked for, with why."""
        for reach in demand.reaches:
            block = self.around.block(reach.body)
            if reach.kind == "offer":
                yield self.around.zone(reach.body).points()[:9, :2], "reach"
            elif reach.kind == "above":
                grid = block.grid(0.15, 0.08)
                edge = np.abs(block.to_local(grid)) >= np.array([block.half_x, block.half_y]) - 0.25
                yield grid[edge.any(1)], "reach"
            else:
                yield block.centre[None, :2], "reach"
            return
        for name in demand.seen:
            yield self.around.block(name).centre[None, :2], "see"
            return
        for name in demand.in_front_of:
            block = self.around.block(name)
            yield block.to_map(np.array([[block.half_x, 0.0]])), "front"

    def _ring(self, anchors: tuple[Array, str], arm: ArmModel | None) -> tuple[Array, Array]:
        """Bases (n, 3) around the anchors and how promising each is (n,)."""
        points, why = anchors
        if why == "reach" and arm is not None:
            radii = arm.reach * RADII
            best, width = 0.8 * arm.reach, 0.35 * arm.reach
            side = float(arm.shoulder_low[1])
        else:
            radii, best, width, side = np.array(SIGHT_DISTANCES), 1.2, 0.6, 0.0
        bearings = np.arange(BEARINGS) * 2 * math.pi / BEARINGS
        index, radius, bearing, turn = (
            grid.ravel() for grid in np.meshgrid(np.arange(len(points)), radii, bearings, HEADINGS, indexing="ij")
        )
        x = points[index, 0] - radius * np.cos(bearing)
        y = points[index, 1] - radius * np.sin(bearing)
        lateral = radius * np.sin(-turn)
        score = np.exp(-(((radius - best) / width) ** 2)) * np.exp(-(((lateral - side) / 0.35) ** 2))
        yaw = np.arctan2(np.sin(bearing + turn), np.cos(bearing + turn))
        return np.column_stack([x, y, yaw]), score

    def _validate(
        self,
        base: Base,
        demand: Demand,
        arms: Sequence[ArmModel],
        rejections: Rejections,
        *,
        generous: bool = True,
    ) -> Solution | None:
        """The solution at ``base``, or None with the reason counted."""
        around = self.around
        if contacts := around.contacts(base):
            rejections.collision(first_body(contacts))
            return None
        if not all(_in_front(around, name, base) for name in demand.in_front_of):
            rejections.add("not in front")
            return None
        for name in demand.seen:
            if any(math.dist(base[:2], other[:2]) < ANOTHER_PLACE for other in around.looked_in_vain(name)):
                rejections.add("looked from there in vain")
                return None
        handled = [r.body for r in demand.reaches if r.kind in ("grasp", "offer")] if around.sighted() else []
        looked_at = (*demand.seen, *handled)
        if not all(around.sees(base, name) for name in looked_at):
            rejections.add("not visible")
            return None
        wanted = [reach for reach in demand.reaches if reach.kind != "retreat" and not is_held(reach.body, around)]
        if not wanted:
            return Solution(base, around.revision(), {})
        for arm in arms:
            reached: dict[Reach, ReachSolution] = {}
            for reach in wanted:
                plans = (4 if generous else 1) * CHUNK
                found = reach_solutions(reach, base, arm, around, rejections, most_plans=plans)
                solution = next(found, None)
                if solution is None:
                    break
                reached[reach] = solution
            else:
                self._reached = {(arm.name, _rounded(base)): reached}
                detail = {"arm": arm.name, "reaches": [solution.plan.label for solution in reached.values()]}
                return Solution(base, around.revision(), detail)
        return None


def _in_front(around: Surroundings, name: str, base: Base) -> bool:
    block = around.block(name)
    local = block.to_local(np.array([[base[0], base[1]]]))[0]
    away = local[0] - block.half_x
    return bool(0.4 <= away <= 1.5 and abs(local[1]) <= away + 1e-3)  # places come to a tenth of a millimetre


def _rounded(base: Base) -> Base:
    """The same for a place and for where the base stands after it went there."""
    x, y, yaw = base
    return round(x, 4), round(y, 4), round(math.remainder(yaw, 2 * math.pi), 4)


def _seed(known: ReachSolution | None, seed: Array) -> Array:
    return seed if known is None else known.joints[min(1, len(known.joints) - 1)]
