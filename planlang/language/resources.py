"""Resources: exclusive use of parts of the robot, granted first come, first served.

A part of a plan that holds a resource may lend it to requests inside itself, which take turns. So a scope can hold the
base while the steps in it move it one at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextvars import ContextVar, Token
from types import TracebackType

from planlang.kernel import Scheduler, Task
from planlang.kernel.cancel import deliver
from planlang.kernel.core import here, park
from planlang.kernel.primitives import record
from planlang.kernel.signals import Wait
from planlang.misuse import Usage


class _Lock:
    """Free iff ``holder`` is None."""

    __slots__ = ("holder",)

    def __init__(self) -> None:
        self.holder: Lease | None = None


class Lease(Wait):
    """A request for resources, which are granted all at once."""

    def __init__(
        self, arbiter: Arbiter, scheduler: Scheduler, task: Task, names: tuple[str, ...], outer: Lease | None
    ) -> None:
        self.names = tuple(dict.fromkeys(names))
        self.outer = outer
        self.inner: dict[str, _Lock] = {name: _Lock() for name in self.names}
        self.locks = [arbiter.lock(name, outer) for name in self.names]
        self.granted = False
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

    async def acquire(self, lease: Lease) -> None:
        """Wait until all of the lease's resources are granted."""
        if lease.task.doomed:
            await deliver(lease.task)
        self._waiting[lease] = None
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
                del self._waiting[lease]
                lease.granted = True
                for name, lock in zip(lease.names, lease.locks, strict=True):
                    lock.holder = lease
                    _touch(lease, name)
                lease.scheduler.wake(lease.task)
            else:
                for lock in lease.locks:
                    earlier.setdefault(lock, []).append(needs.union(*ahead))

    def release(self, lease: Lease) -> None:
        """Release the resources of a lease and grant them to waiting requests."""
        for lock in lease.locks:
            lock.holder = None
        self.grant()


_lease: ContextVar[Lease | None] = ContextVar("lease", default=None)


_USING = Usage("async with using", {"name": '"left_arm"'})


class using:  # noqa: N801 - used like a function: async with using("left_arm", "base")
    """``async with using("left_arm", "base") as lease:`` holds resources until the block ends in any way.

    They are granted all at once, first come, first served, so that blocks that name all their resources cannot deadlock
    with each other. Nested blocks that request resources in opposite order can: DeadlockError lists who waits for which
    resource, and who holds it.
    """

    def __init__(self, *names: str) -> None:
        for name in names:
            _USING.text("name", name)
        self.names = names

    async def __aenter__(self) -> Lease:
        scheduler, task = here()
        arbiter = scheduler.service(Arbiter)
        self._lease = lease = Lease(arbiter, scheduler, task, self.names, _lease.get())
        self._arbiter = arbiter
        await arbiter.acquire(lease)
        self._token: Token[Lease | None] = _lease.set(lease)
        record("acquired", resources=lease.names)
        return lease

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        _lease.reset(self._token)
        record("released", resources=self._lease.names)
        self._arbiter.release(self._lease)


def holding() -> Lease | None:
    """Innermost lease of the running task."""
    return _lease.get()


def _touch(lease: Lease, name: str) -> None:
    for outer in lease.enclosing():
        if name in outer.inner:
            outer.touched.add(name)
