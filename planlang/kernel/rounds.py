"""Rounds of tasks, decisions of constructs between them, and steps of the world when all is at rest."""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING

from planlang.kernel.errors import DeadlockError, NoProgress, StepLimit
from planlang.kernel.listing import blocked, listing
from planlang.kernel.turn import take

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.task import Task

MAX_RESUMPTIONS = 100_000
"""Turns and decisions in one world step after which the run is considered to make no progress."""


def loop(scheduler: Scheduler, root: Task) -> None:
    """Drive the run until its top-level task is dead."""
    while True:
        rest(scheduler, root)
        if scheduler.spoilt is not None:
            raise scheduler.spoilt
        if root.dead:
            return
        if scheduler.interrupts != scheduler.heeded:
            _heed_interrupts(scheduler, root)
        else:
            _advance(scheduler, root)


def rest(scheduler: Scheduler, root: Task) -> None:
    """Rounds, decisions and deadlines until nothing more can happen in this step."""
    while True:
        _round(scheduler, root)
        if _decide(scheduler):
            continue
        if scheduler.calls.in_flight and scheduler.calls.collect():
            _heed_interrupts(scheduler, root)
        elif scheduler.draining or not scheduler.timers.expire():
            return


def _round(scheduler: Scheduler, root: Task) -> None:
    queue, pool, choice = scheduler.queue, scheduler.pool, scheduler.choice
    while queue or pool:
        if scheduler.interrupts != scheduler.heeded:
            _heed_interrupts(scheduler, root)
        if scheduler.resumptions > MAX_RESUMPTIONS and not scheduler.draining:
            title = (
                f"no progress: tasks had more than {MAX_RESUMPTIONS} turns within world step {scheduler.now}; a loop "
                "has to wait for what takes time, such as sleep(0.1), or for what is not true yet; still running"
            )
            raise NoProgress(listing(title, [*queue, *pool]))
        if choice is None:
            task = queue.popleft()
        else:
            task = pool.pop(choice.choose(pool) if len(pool) > 1 else 0)
        task.in_queue = False
        if task.holds or task.dead:
            continue
        scheduler.resumptions += task.begun  # a beginning is no resumption: wide constructs are no loops
        take(scheduler, task)
        if scheduler.fatal is not None:
            fatal, scheduler.fatal = scheduler.fatal, None
            raise fatal


def _decide(scheduler: Scheduler) -> bool:
    """Let the most deeply nested scopes with newly dead branches decide; False if there are none."""
    dirty = scheduler.dirty
    if not dirty:
        return False
    depth = dirty[0][0]
    while dirty and dirty[0][0] == depth:
        scope = heapq.heappop(dirty)[2]
        scope.dirty = False
        scheduler.resumptions += 1
        scope.settle()
    return True


def _advance(scheduler: Scheduler, root: Task) -> None:
    """Let the world go on by one step, or jump to the next due one."""
    timers, live = scheduler.timers, scheduler.live
    ahead = None if scheduler.journal is None else scheduler.journal.ahead
    if ahead is not None:
        ahead.check(timers.now)
    elif live is not None and _attend(scheduler):
        return
    due = timers.next_due()
    outside = live is not None and (live.sources or scheduler.calls.in_flight)
    if due is None and not scheduler.vital_waits and not outside:
        raise DeadlockError(listing("nothing can go on", blocked(root)))
    # without a world only tasks change what is read: one look after they have run is enough
    looked_at = scheduler.vital_waits or (scheduler.world_waits and scheduler.resumptions)
    if ahead is not None and due is not None:
        target = max(due, timers.now + 1)
    elif live is not None:
        target = timers.now + (1 if scheduler.world_waits else scheduler.rate)
        if due is not None:
            target = max(min(due, target), timers.now + 1)
        if scheduler.max_steps is not None and target > scheduler.max_steps > timers.now:
            target = scheduler.max_steps
    elif due is None or looked_at or not scheduler.host.jumps:
        target = timers.now + 1
    else:
        target = max(due, timers.now + 1)
    if scheduler.max_steps is not None and target > scheduler.max_steps:
        raise StepLimit(listing(f"more than {scheduler.max_steps} world steps", blocked(root)))
    scheduler.idle = True
    try:
        passed = scheduler.host.advance(target - timers.now) if ahead is None else None
    except Exception as error:
        error.add_note(f"raised by {type(scheduler.host).__name__} after {timers.now} world steps")
        raise
    scheduler.idle = False
    if passed is not None:
        target = timers.now + passed
        if not passed:
            return
    timers.now = target
    scheduler.resumptions = 0
    if scheduler.world_waits:
        fluents = tuple(scheduler.world_waits)
        changed = [fluent for fluent in fluents if fluent.sample(target)]
        for fluent in changed:
            fluent.notify()
    timers.ring()


def _attend(scheduler: Scheduler) -> bool:
    """Call what came into the inbox; False if there was nothing."""
    items = scheduler.inbox.take()
    for item in items:
        item()
    return bool(items)


def _heed_interrupts(scheduler: Scheduler, root: Task) -> None:
    """The first Ctrl-C evaporates the plan, its cleanups run; the second one drains it."""
    if scheduler.interrupts != scheduler.heeded and not scheduler.draining:
        scheduler.heeded = scheduler.interrupts
        if scheduler.interrupts > 1:
            raise KeyboardInterrupt
        if scheduler.trace is not None:
            scheduler.trace.write(scheduler.now, "interrupted")
        scheduler.evaporate(root)
