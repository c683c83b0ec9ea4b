"""at_location: a scope in which the base holds a pose from which the steps inside can work."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from planlang.designators import Device, Location, Object, a_location
from planlang.failures import (
    GripperGoalNotReached,
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
from planlang.kernel.primitives import node, record
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.language.budgets import take_attempt
from planlang.language.executive import executive_for
from planlang.language.performing import HeldPose, held_pose, perform
from planlang.language.recovery import Recovery, check_further, matches, recovering
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
"""Places that a scope tries unless the plan says otherwise."""
APART = 0.05
"""Base poses nearer than this to one that failed count as the same [m]: what is out of reach stays so."""
AGAIN = 3
"""Times that a motion of a construct is made again that did not get where it was planned to: as recipes' motions."""
NOT_ARRIVED = (ManipulationGoalNotReached, GripperGoalNotReached, NavigationGoalNotReached)
"""Failures of motions that may go well when they are made again."""
REPLACED = 10
"""Times that the base is put back when something else has moved it: more often than chance disturbs a robot."""


async def at_location(
    location: Location,
    body: Callable[[], Awaitable[V]],
    *recoveries: Recovery,
    attempts: int = ATTEMPTS,
    reaching: Iterable[Object | Location] = (),
    device: Device | None = None,
    by: str | None = None,
) -> V:
    """Go to a base pose of ``location`` from which everything in ``reaching`` can be reached, and run the body there.

    ``device`` is what reaches; without it the executive decides. If it is another than that of ``location``, it holds
    for each location in ``reaching``; for an object that raises ValueError, as two arms of one location do. ``by`` is
    the class of the base motion, which a module for it performs; without it, the executive's.

    What a pose has before it, such as a look from elsewhere at what cannot be seen from there, is done first.

    When the body fails in a way that another base pose can cure, the next is tried, at most ``attempts`` in all.
    Poses within 5 cm of one that failed at the same revision of the belief are skipped. The base is held: side by
    side, scopes take turns; a nested scope may move it, and it is moved back. When something else moves it, the body
    is evaporated and runs again at the same pose, at most 10 times. Once an action that must not be repeated has begun
    (``perform(..., once=True)``), the body does not run again: its failure is raised. ``recoveries`` are tried around
    all this, as ``with_failure_handling`` does, with the base free: a recovery may drive.

    Raises ObjectUnreachable, or ObjectUndeliverable when something is held, from the last failure, or from
    LocationUnresolvable when no pose was found at all, or from MissingCapability when the robot lacks what it takes.
    """
    _AT_LOCATION.branch("body", body)
    _AT_LOCATION.instance("location", location, Location, "a location")
    attempts = _AT_LOCATION.whole("attempts", attempts, 1, "places")
    _AT_LOCATION.iterable("reaching", reaching, "objects and locations")
    reaching = tuple(reaching)
    for one in reaching:
        if not isinstance(one, (Object, Location)):
            raise _AT_LOCATION.wrong("reaching", [one], "objects and locations")
    if device is not None:
        _AT_LOCATION.instance("device", device, Device, "a device")
    if by is not None:
        _AT_LOCATION.text("by", by)
    check_further(_AT_LOCATION, recoveries)
    executive = executive_for("at_location")
    if reaching:
        location = location & _in_reach(reaching, device, location.device)
    inside = partial(_inside, executive, location, by, body, attempts)
    run = partial(node, "at_location", "at_location", inside, location=location, attempts=attempts)
    return await recovering(run, recoveries)


async def _inside(executive: Executive, location: Location, by: str | None, body: Branch, attempts: int) -> Any:
    """Hold the base, and try one pose after another; then go back to the pose of the scope around."""
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


def _in_reach(wanted: tuple[Object | Location, ...], device: Device | None, other: Device | None) -> Location:
    """Return where a device reaches all that is wanted, to be joined with a location that names ``other``."""
    if None in (device, other) or device == other or not all(isinstance(one, Location) for one in wanted):
        return a_location(in_reach_of=wanted, using=device)
    each = [replace(one, device=one.device or device) for one in wanted if isinstance(one, Location)]
    return a_location(in_reach_of=each)


class _Visit:
    """One entry of at_location: the cursor of solutions and what was tried."""

    def __init__(self, executive: Executive, location: Location, lease: Lease, by: str | None) -> None:
        self.executive = executive
        self.location = location
        self.lease = lease
        self.by = by
        self.pose = HeldPose(self._return)
        self.moved = self._has_looked = False
        self._failed: list[Solution] = []
        self._cursor: Iterator[Solution] | None = None
        self._revision: int | None = None
        self._solution: Solution | None = None

    def leave(self, outer: HeldPose | None) -> None:
        """Mark the scope around as displaced if the base is elsewhere, and as the last if this one is."""
        if outer is not None:
            outer.displaced = outer.displaced or self.moved
            outer.is_last = outer.is_last or self.pose.is_last

    async def run(self, body: Branch, attempts: int) -> Any:
        """Try one base pose after another."""
        last: PlanFailure | None = None
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
                if self.pose.is_last or not matches(failure, CURABLE):
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
        """Return the next base pose, after a look at what cannot be seen from it; that may lead to another one."""
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
        """Do, once, what may show that there is a base pose; that it was not possible says nothing about poses."""
        if self._has_looked:
            return
        self._has_looked = self.moved = True
        with suppress(NavigationFailure, LookingFailure):
            for action in solution.before:
                await perform(action)

    def _next(self) -> Solution:
        """Return the next base pose that has not failed; the search starts anew when the belief has changed."""
        revision = self.executive.revision()
        if self._cursor is None or revision != self._revision:
            self._cursor, self._revision = iter(self.executive.solutions(self.location)), revision
        for solution in self._cursor:
            if not any(_near(solution, failed) for failed in self._failed):
                return solution
        raise LocationUnresolvable(designator=str(self.location))

    def _escalated(self, cause: PlanFailure) -> PlanFailure:
        held = tuple(self.executive.held())
        if held:
            return ObjectUndeliverable(what=", ".join(held))
        return ObjectUnreachable(what=_reference(self.location))

    async def _visit(self, solution: Solution, body: Branch) -> Any:
        self._solution = solution
        for _ in range(REPLACED + 1):
            await self._go(solution)
            watched = _Watched(self, body)
            result = await watched.execute()
            if not watched.lost:
                return result
            record("displaced", base=solution.base)
            if self.pose.is_last:
                message = "the base was moved away by something else, and what was done here must not be repeated"
                raise NavigationGoalNotReached(message, target=solution.base)
        raise NavigationGoalNotReached(
            f"the base was moved away {REPLACED} times by something else", target=solution.base
        )

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
        """Return True if something else than what runs inside has moved the base."""
        solution = self._solution
        return solution is not None and "base" not in self.lease.touched and not self.executive.is_at(solution)


class _Watched(Scope):
    """The body and, beside it, a watch over the base pose; the body counts when both end together."""

    transparent = True
    lost = False
    ended: Task | None = None
    """The body, or the watch if that could not go on."""

    def __init__(self, visit: _Visit, body: Branch) -> None:
        super().__init__("branch")
        self.visit = visit
        self.body = body

    def begin(self) -> None:
        self.start(self.body, name_of(self.body), 0)
        self.start(self._watch, "watch", 1)

    async def _watch(self) -> None:
        gone = WorldFluent(read=self.visit.lost, name=f"the base leaving {self.visit.location}")
        gone.vital = False
        await wait_for(gone)

    def decide(self, dead: list[Task]) -> None:
        first = dead[0]
        if first.index == 1 and first.outcome is Status.SUCCEEDED:
            self.lost = True
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
    """Bring the robot into a posture from which it can drive elsewhere, as far as that goes.

    A motion that does not arrive is made again. Where an arm has no way, or the base none to make room for it, what
    comes next is planned with the arm as it is: there may be room once the base has moved.
    """
    for motion in executive.before_retry():
        with suppress(ManipulationFailure, NavigationFailure):
            await perform(motion, recoveries=[Recovery(NOT_ARRIVED, attempts=AGAIN)])


def _near(solution: Solution, failed: Solution) -> bool:
    if solution.revision != failed.revision:
        return False
    dx, dy = solution.base[0] - failed.base[0], solution.base[1] - failed.base[1]
    return dx * dx + dy * dy <= APART * APART


def _reference(location: Location) -> str:
    """Return the name of the object that a location is about, through chains of locations."""
    reference: Object | Location = location
    while isinstance(reference, Location):
        if not reference.relations:
            return str(location)
        reference = reference.relations[0].reference
    return reference.name
