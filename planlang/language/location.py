"""at_location: a scope in which the base holds a pose from which the steps inside can work."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.designators import Condition, Device, Location, Object, a_location
from planlang.failures import (
    GripperGoalNotReached,
    HandsFull,
    LocationUnresolvable,
    LookingFailure,
    LookingGoalUnreachable,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationGoalNotReached,
    ManipulationPoseUnreachable,
    MissingCapability,
    NavigationFailure,
    NavigationGoalNotReached,
    ObjectUndeliverable,
    ObjectUnreachable,
    PlanFailure,
)
from planlang.kernel import Scope, Status, Task, WorldFluent, failure_of, wait_for
from planlang.kernel.core import here
from planlang.kernel.primitives import node, record
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.language.budgets import take_attempt
from planlang.language.executive import executive_for
from planlang.language.performances import performing
from planlang.language.performing import HeldPose, held_pose, perform
from planlang.language.preceding import before_next
from planlang.language.recovery import Recovery, check_recoveries, matches, recoveries_are_on, recovering
from planlang.language.resources import Lease, using
from planlang.misuse import Usage

if TYPE_CHECKING:
    from planlang.language.executive import Executive
    from planlang.protocols import Solution

V = TypeVar("V")

_AT_LOCATION = Usage(
    "await at_location",
    {"location": "a_location(in_reach_of=cup)", "body": "grasp"},
    {
        "attempts": "3",
        "reaching": "(cup,)",
        "device": "RIGHT_GRIPPER",
        "by": '"Translation-LocationChange"',
        "*recovery": "Recovery(ObjectNotFound)",
    },
)

CURABLE = (NavigationFailure, ManipulationPoseUnreachable, ManipulationGoalInCollision, LookingGoalUnreachable)
"""Failures that another base pose can cure."""
ATTEMPTS = 5
"""Default number of base poses that a scope tries."""
SAME_POSE = 0.05
"""Distance [m] within which two base poses count as the same, as a target out of reach of one is out of reach of both.
"""
AGAIN = 3
"""Attempts to repeat a motion that did not reach its goal, the same number as in plans compiled from recipes."""
AGAIN_WITHIN = 120.0
"""Plan time after which a motion is not repeated any more [s], as in these plans."""
NOT_ARRIVED = (ManipulationGoalNotReached, GripperGoalNotReached, NavigationGoalNotReached)
"""Failures of motions that may succeed when repeated."""
MAX_DISPLACEMENTS = 10
"""How often the base is moved back when something else has moved it: more often than accidents happen."""


async def at_location(
    location: Location,
    body: Callable[[], Awaitable[V]],
    *recoveries: Recovery,
    attempts: int = ATTEMPTS,
    reaching: Iterable[Object | Location] = (),
    device: Device | None = None,
    by: str | None = None,
) -> V:
    """Drive to a base pose of ``location`` from which everything in ``reaching`` can be reached, and run the body.

    ``device`` is the arm that reaches; by default the executive chooses it. If it differs from that of ``location``, it
    applies to each location in ``reaching``; objects there raise ValueError then, as a location cannot name two arms.
    ``by`` is the action class of the base motion, for a module of that class; by default the executive's.

    Actions that a pose requires first, such as a look from elsewhere at an object that is hidden from there, are
    performed before the drive.

    If the body fails in a way that another base pose can cure, the next pose is tried, up to ``attempts`` in all. Poses
    within 5 cm of one that failed at the same revision of the belief are skipped. The scope holds the base: concurrent
    scopes take turns, and a nested scope may move the base, which is moved back afterwards. If something else moves it,
    the body is evaporated and runs again at the same pose, at most 10 times. After an action that must not be repeated
    has begun (``perform(..., once=True)``), or once the body has let go of a thing outside a step with a goal, it does
    not run again, and its failure is raised: what follows a delivery must not repeat it. ``recoveries`` handle failures
    of all this, as in ``with_failure_handling``; the base is released then, so that they may drive.

    Raises ObjectUnreachable, or ObjectUndeliverable while an object is held and no other is to be grasped. Its cause is
    the last failure of the body, LocationUnresolvable if no pose was found at all, or MissingCapability if the robot
    lacks a capability.
    """
    _AT_LOCATION.branch("body", body)
    _AT_LOCATION.instance("location", location, Location, "a location")
    attempts = _AT_LOCATION.whole("attempts", attempts, 1, "base poses")
    _AT_LOCATION.iterable("reaching", reaching, "objects and locations")
    reaching = tuple(reaching)
    for target in reaching:
        if not isinstance(target, (Object, Location)):
            raise _AT_LOCATION.wrong("reaching", [target], "objects and locations")
    if device is not None:
        _AT_LOCATION.instance("device", device, Device, "a device")
    if by is not None:
        _AT_LOCATION.text("by", by)
    check_recoveries(_AT_LOCATION, recoveries)
    executive = executive_for("at_location")
    if reaching:
        location = location & _in_reach(reaching, device, location.device)
    inside = partial(_inside, executive, location, by, body, attempts)

    async def run() -> Any:
        for one in before_next("at_location"):
            await perform(one)
        return await node("at_location", "at_location", inside, location=location, attempts=attempts)

    with performing(location, "at_location", name_of(body)):
        return await recovering(run, recoveries)


async def _inside(executive: Executive, location: Location, by: str | None, body: Branch, attempts: int) -> Any:
    """Hold the base and try one pose after another; finally return to the pose of the enclosing scope."""
    outer = held_pose.get()
    async with using("base") as lease:
        visit = _Visit(executive, location, lease, by)
        token = held_pose.set(visit.pose)
        try:
            result = await visit.run(body, attempts)
        finally:
            held_pose.reset(token)
            visit.leave(outer)
    if outer is not None and outer.displaced:
        await outer.establish()
    return result


def _in_reach(targets: tuple[Object | Location, ...], device: Device | None, other: Device | None) -> Location:
    """Location from which a device reaches all targets, to be combined with a location for the device ``other``."""
    if None in (device, other) or device == other or not all(isinstance(target, Location) for target in targets):
        return a_location(in_reach_of=targets, using=device)
    places = [replace(target, device=target.device or device) for target in targets if isinstance(target, Location)]
    return a_location(in_reach_of=places)


class _Visit:
    """One execution of at_location, with the iterator of base poses and the poses that failed."""

    def __init__(self, executive: Executive, location: Location, lease: Lease, by: str | None) -> None:
        self.executive = executive
        self.location = location
        self.lease = lease
        self.by = by
        self.pose = HeldPose(self._return)
        self.moved = False
        self._first_done: set[str] = set()
        self._failed: list[Solution] = []
        self._solutions: Iterator[Solution] | None = None
        self._revision: int | None = None
        self._solution: Solution | None = None

    def leave(self, outer: HeldPose | None) -> None:
        """Tell the enclosing scope whether the base has moved, and whether its body may run again."""
        if outer is not None:
            outer.displaced = outer.displaced or self.moved
            outer.is_last = outer.is_last or self.pose.is_last
            outer.delivered += self.pose.delivered

    async def run(self, body: Branch, attempts: int) -> Any:
        """Run the body at one base pose after another."""
        last: PlanFailure | None = None
        attempts = attempts if recoveries_are_on() else 1
        for attempt in range(1, attempts + 1):
            try:
                if last is not None:
                    await make_room(self.executive)
                solution = await self._prepared()
            except (LocationUnresolvable, MissingCapability) as exhausted:
                record("no more poses", attempt=attempt, failure=exhausted)
                exhausted.__cause__ = last
                raise self._escalated(exhausted) from exhausted
            except PlanFailure as failure:
                if not matches(failure, CURABLE):
                    raise
                failure.__cause__ = failure.__cause__ or last
                raise self._escalated(failure) from failure
            record("solution", attempt=attempt, base=solution.base, revision=solution.revision, detail=solution.detail)
            try:
                return await self._visit(solution, body)
            except PlanFailure as failure:
                if self.pose.is_last or self.pose.delivered or not matches(failure, CURABLE):
                    raise
                last = failure
                self.pose.again(failure)
                self._failed.append(solution)
                record("pose failed", attempt=attempt, base=solution.base, failure=failure)
                if attempt < attempts:
                    await take_attempt("at_location")
        assert last is not None  # there is at least one attempt
        raise self._escalated(last) from last

    async def _prepared(self) -> Solution:
        """Find the next base pose and perform the actions that it requires, which may lead to a different pose."""
        while True:
            solution = self._next()
            if solution.provisional:
                await self._look(solution)
                continue
            for action in solution.before:
                self.moved = True
                await perform(action)
            if not solution.before or self.executive.revision() == self._revision:
                return solution

    async def _look(self, solution: Solution) -> None:
        """Perform, once of each class, actions that may lead to a base pose; ignore it if they fail."""
        kind = solution.before[-1].type
        if kind in self._first_done:
            return
        self._first_done.add(kind)
        self.moved = True
        with suppress(NavigationFailure, LookingFailure):
            for action in solution.before:
                await perform(action)

    def _next(self) -> Solution:
        """Find the next base pose that has not failed; a change of belief restarts the search."""
        revision = self.executive.revision()
        if self._solutions is None or revision != self._revision:
            self._solutions, self._revision = iter(self.executive.solutions(self.location)), revision
        for solution in self._solutions:
            if not any(_near(solution, failed) for failed in self._failed):
                return solution
        raise LocationUnresolvable(designator=str(self.location))

    def _escalated(self, cause: PlanFailure) -> PlanFailure:
        held = ", ".join(self.executive.held())
        if held and isinstance(cause, HandsFull):
            return ObjectUndeliverable(f"{_reference(self.location)} cannot be reached with full hands", what=held)
        # what is yet to be grasped is out of reach, whatever the other hand holds
        grasped = tuple(_grasped(self.location)) if held else ()
        wanted = next((one for one in grasped if not self.executive.holds(Condition("holding", (one,)))), None)
        if held and wanted is None:
            return ObjectUndeliverable(what=held)
        return ObjectUnreachable(what=_reference(self.location) if wanted is None else wanted.name)

    async def _visit(self, solution: Solution, body: Branch) -> Any:
        self._solution = solution
        for _ in range(MAX_DISPLACEMENTS + 1):
            await self._go(solution)
            here()[1].node.begin_attempt()
            attended = _BodyAtPose(self, body)
            result = await attended.execute()
            if not attended.displaced:
                return result
            record("displaced", base=solution.base)
            if self.pose.is_last:
                message = "something else moved the base away, and an action here must not be repeated"
                raise NavigationGoalNotReached(message, target=solution.base)
        message = f"something else moved the base away {MAX_DISPLACEMENTS} times"
        raise NavigationGoalNotReached(message, target=solution.base)

    async def _go(self, solution: Solution) -> None:
        self.moved = True
        motion = self.executive.move_to(solution)
        await perform(motion if self.by is None else replace(motion, type=self.by))
        self.pose.displaced = False
        self.lease.touched.discard("base")

    async def _return(self) -> None:
        if self._solution is not None and not self.executive.is_at(self._solution):
            await self._go(self._solution)
        self.lease.touched.discard("base")

    def lost(self) -> bool:
        """Check whether the base was moved by anything other than the body."""
        solution = self._solution
        return solution is not None and "base" not in self.lease.touched and not self.executive.is_at(solution)


class _BodyAtPose(Scope):
    """The body, with a concurrent watch of the base pose; the body takes precedence if both end together."""

    transparent = True
    displaced = False
    ended: Task | None = None
    """The body, or the watch if that failed."""

    def __init__(self, visit: _Visit, body: Branch) -> None:
        super().__init__("branch")
        self.visit = visit
        self.body = body

    def begin(self) -> None:
        self.start(self.body, name_of(self.body), 0)
        self.start(self._watch, "watch", 1)

    async def _watch(self) -> None:
        displacement = WorldFluent(read=self.visit.lost, name=f"the base leaving {self.visit.location}")
        displacement.vital = False
        await wait_for(displacement)

    def decide(self, dead: list[Task]) -> None:
        first = dead[0]
        if first.index == 1 and first.outcome is Status.SUCCEEDED:
            self.displaced = True
        else:
            self.ended = first
        self.close()

    def finish(self) -> Any:
        task = self.ended
        if task is None:
            return None
        if task.outcome is not Status.SUCCEEDED:
            raise self.attach(failure_of(task))
        return task.result


async def make_room(executive: Executive) -> None:
    """Bring the robot into a posture in which it can drive elsewhere, as far as possible.

    A motion that does not reach its goal is repeated. If there is no path for an arm, or for the base that makes room
    for it, the arm stays as it is, and the next drive is planned with it: there may be room after the base has moved.
    """
    for motion in executive.before_retry():
        with suppress(ManipulationFailure, NavigationFailure):
            await perform(motion, recoveries=[Recovery(NOT_ARRIVED, retries=AGAIN, within=AGAIN_WITHIN)])


def _near(solution: Solution, failed: Solution) -> bool:
    return solution.revision == failed.revision and math.dist(solution.base[:2], failed.base[:2]) <= SAME_POSE


def _grasped(location: Location) -> Iterator[Object]:
    """Yield the objects that a hand grasps at a location, or in reach of it."""
    for relation in location.relations:
        for reference in relation.references:
            if isinstance(reference, Location):
                yield from _grasped(reference)
            elif relation.name == "in_center_of" and not relation.negated:
                yield reference


def _reference(location: Location) -> str:
    """Name of the reference object of a location, through chains of locations."""
    reference: Object | Location = location
    while isinstance(reference, Location):
        if not reference.relations:
            return str(location)
        reference = reference.relations[0].references[0]
    return reference.name
