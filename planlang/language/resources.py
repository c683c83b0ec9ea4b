"""Resources: exclusive use of parts of the robot, granted first come, first served.

A part of a plan that holds a resource may lend it to requests inside itself, which take turns. So a scope can hold the
base while the steps in it move it one at a time. A part that holds resources ``in_turns`` lets another part that waits
for them go first where it may be interrupted: when a thing is in one hand, say, and the other hand is free.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextvars import ContextVar, Token
from enum import Enum
from types import TracebackType

from planlang.designators import Condition
from planlang.failures import HandsFull, HandsLacking, PlanFailure
from planlang.kernel import Scheduler, Task
from planlang.kernel.cancel import deliver
from planlang.kernel.core import here, park
from planlang.kernel.primitives import record
from planlang.kernel.signals import Wait
from planlang.language.executive import current
from planlang.misuse import Usage


class Giving(Enum):
    """To whom a part of a plan gives its turn."""

    AHEAD = "ahead"
    """To one that has not begun."""
    BACK = "back"
    """To one that gave its turn ahead before."""


class _Lock:
    """Free iff ``holder`` is None."""

    __slots__ = ("holder",)

    def __init__(self) -> None:
        self.holder: Lease | None = None


class Lease(Wait):
    """A request for resources, which are granted all at once."""

    def __init__(
        self,
        arbiter: Arbiter,
        scheduler: Scheduler,
        task: Task,
        names: tuple[str, ...],
        outer: Lease | None,
        *,
        in_turns: bool = False,
    ) -> None:
        self.in_turns = in_turns
        self.names = tuple(dict.fromkeys(names))
        self.outer = outer
        self.inner: dict[str, _Lock] = {name: _Lock() for name in self.names}
        self.locks = [arbiter.lock(name, outer) for name in self.names]
        self.granted = False
        self.gave: Giving | None = None
        """To whom it has given its turn last."""
        self.touched: set[str] = set()
        """Resources of this lease that were lent to requests inside it."""
        self._arbiter = arbiter
        self.scheduler = scheduler
        self.task = task

    def enclosing(self) -> Iterator[Lease]:
        """Yield the enclosing leases, innermost first."""
        outer = self.outer
        while outer is not None:
            yield outer
            outer = outer.outer

    def recheck(self) -> None:
        """Grant what has become possible, as the task of this lease is no longer held."""
        self._arbiter.grant()

    def __str__(self) -> str:
        has = ("" if lock.holder is None else f" (held by {lock.holder.task.path})" for lock in self.locks)
        return " and ".join(f"{name}{held}" for name, held in zip(self.names, has, strict=True))


class Arbiter:
    """Grants resources first come, first served; a request never waits for a later one."""

    def __init__(self) -> None:
        self._locks: dict[str, _Lock] = {}
        self._waiting: dict[Lease, None] = {}

    def lock(self, name: str, outer: Lease | None) -> _Lock:
        """Find the lock of a resource for a request inside ``outer``."""
        while outer is not None:
            if name in outer.inner:
                return outer.inner[name]
            outer = outer.outer
        return self._locks.setdefault(name, _Lock())

    async def acquire(self, lease: Lease, *, first: bool = False) -> None:
        """Wait until all of the lease's resources are granted; ``first``: before all that wait already."""
        if lease.task.doomed:
            await deliver(lease.task)
        self._waiting = {lease: None, **self._waiting} if first else {**self._waiting, lease: None}
        self.grant()
        try:
            await park(lease)
        except BaseException:
            if lease.granted:
                self.release(lease)
            else:
                del self._waiting[lease]
                self.grant()
            raise

    def grant(self) -> None:
        """Grant free resources to waiting requests, in order; requests of held tasks are passed over.

        A request does not wait for an earlier one that waits for a lease around this request, as that lease ends only
        after this request.
        """
        earlier: dict[_Lock, list[set[Lease]]] = {}  # leases that each earlier request still waits for
        for lease in tuple(self._waiting):
            if lease.task.holds:
                continue
            enclosing = set(lease.enclosing())
            ahead = [needs for lock in lease.locks for needs in earlier.get(lock, ()) if enclosing.isdisjoint(needs)]
            needs = {lock.holder for lock in lease.locks if lock.holder is not None}
            if not needs and not ahead:
                self._give(lease)
            else:
                for lock in lease.locks:
                    earlier.setdefault(lock, []).append(needs.union(*ahead))

    def _give(self, lease: Lease) -> None:
        del self._waiting[lease]
        lease.granted = True
        for name, lock in zip(lease.names, lease.locks, strict=True):
            lock.holder = lease
            _touch(lease, name)
        lease.scheduler.wake(lease.task)

    def release(self, lease: Lease) -> None:
        """Release the resources of a lease and grant them to waiting requests."""
        self._free(lease)
        self.grant()

    def _free(self, lease: Lease) -> None:
        lease.granted = False
        for lock in lease.locks:
            lock.holder = None

    def next_after(self, lease: Lease, to: Giving) -> Lease | None:
        """Find the first request that has all that it needs if a lease gives its turn; None if there is none."""
        gave = Giving.AHEAD if to is Giving.BACK else None
        fitting = (one for one in self._waiting if one.gave is gave and not one.task.holds)
        own = set(lease.locks)
        return next(
            (
                one
                for one in fitting
                if not own.isdisjoint(one.locks) and all(lock.holder in (None, lease) for lock in one.locks)
            ),
            None,
        )

    async def give_turn(self, lease: Lease, other: Lease, to: Giving) -> None:
        """Let another request have what a lease holds, and be the first to have it again."""
        self._free(lease)
        self._give(other)
        lease.gave = to
        await self.acquire(lease, first=True)


_lease: ContextVar[Lease | None] = ContextVar("lease", default=None)


_USING = Usage("async with using", {"name": '"left_arm"'}, {"in_turns": "True"})
HAND_FREE = Condition("hand_free", ())
"""The condition of the executive that a hand is empty and able to grasp."""


class using:  # noqa: N801 - used like a function: async with using("left_arm", "base")
    """``async with using("left_arm", "base") as lease:`` holds resources until the block ends in any way.

    They are granted all at once, first come, first served, so that blocks that name all their resources cannot deadlock
    with each other. Nested blocks that request resources in opposite order can: DeadlockError lists who waits for which
    resource, and who holds it. With ``in_turns`` another block that waits for them may go first wherever this one
    awaits :func:`give_turn`.
    """

    def __init__(self, *names: str, in_turns: bool = False) -> None:
        for name in names:
            _USING.text("name", name)
        self.names = names
        self.in_turns = in_turns

    async def __aenter__(self) -> Lease:
        scheduler, task = here()
        arbiter = scheduler.service(Arbiter)
        self._lease = lease = Lease(arbiter, scheduler, task, self.names, _lease.get(), in_turns=self.in_turns)
        self._arbiter = arbiter
        await arbiter.acquire(lease)
        self._token: Token[Lease | None] = _lease.set(lease)
        record("acquired", resources=lease.names)
        return lease

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        _lease.reset(self._token)
        if self._lease.granted:  # a block that is evaporated while another one has its turn has nothing to release
            record("released", resources=self._lease.names)
            self._arbiter.release(self._lease)


def holding() -> Lease | None:
    """Innermost lease of the running task."""
    return _lease.get()


async def give_turn() -> bool:
    """Let another block that waits for what the block around this holds ``in_turns`` go first; False if there is none.

    That is one that has not begun, once for each block, and only while a hand is free. Then this block is the next.
    """
    return await _gave_turn(Giving.AHEAD)


async def _gave_turn(to: Giving) -> bool:
    lease, (scheduler, task) = holding(), here()
    if lease is None or lease.task is not task or (to is Giving.AHEAD and (lease.gave or not lease.in_turns)):
        return False
    arbiter, executive = scheduler.service(Arbiter), current.get()
    other = arbiter.next_after(lease, to)
    if other is None or (to is Giving.AHEAD and executive is not None and not executive.holds(HAND_FREE)):
        return False
    record("released", resources=lease.names)
    await arbiter.give_turn(lease, other, to)
    record("acquired", resources=lease.names)
    return True


def goes_first() -> bool:
    """Check whether the block around this goes before one that gave it its turn, with a thing in its hand.

    Where a step fails for want of that hand (:func:`lacks_hands`), ``perform`` gives the turn back.
    """
    lease, (scheduler, task) = holding(), here()
    if lease is None or lease.task is not task:
        return False
    return scheduler.service(Arbiter).next_after(lease, Giving.BACK) is not None


def lacks_hands(failure: PlanFailure) -> bool:
    """Check whether a failure says that hands are lacking."""
    return any(isinstance(link, (HandsFull, HandsLacking)) for link in failure.chain())


async def hand_freed(failure: PlanFailure, *, anyway: bool = False) -> bool:
    """Let a block go on that gave its turn, with a thing in its hand, if a failure says that hands are lacking.

    ``anyway``: whatever the failure says. True once that block has ended, or gives the turn back.
    """
    return (anyway or lacks_hands(failure)) and await _gave_turn(Giving.BACK)


def _touch(lease: Lease, name: str) -> None:
    for outer in lease.enclosing():
        if name in outer.inner:
            outer.touched.add(name)
