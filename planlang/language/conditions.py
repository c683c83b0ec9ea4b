"""Goals, fluents of conditions, reactions and policies: achieve, holds, whenever, with_policies."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any, TypeVar

from planlang.designators import Condition, Location, Object, located
from planlang.failures import GoalNotAchieved, PolicyViolated
from planlang.kernel import (
    All,
    Evaporated,
    Fluent,
    PlanStructureError,
    Signal,
    Status,
    Task,
    checkpoint,
    failure_of,
    shield,
    wait_for,
)
from planlang.kernel.core import here, park
from planlang.kernel.fluent import SIGNAL, tracked
from planlang.kernel.primitives import called, node, pause, record
from planlang.kernel.signals import BaseFluent, Wait
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch
from planlang.language.executive import executive_for
from planlang.language.recovery import Recovery, Return, check_recoveries, recovering
from planlang.misuse import Usage, WrongType, contrast, written
from planlang.plan_failure import PlanFailure, attach_cleanup
from planlang.records import dataclass

V = TypeVar("V")

_ACHIEVE = Usage(
    "await achieve",
    {"goal": "holding(cup)", "body": "grasp"},
    {"within": "0.5", "*recovery": "Recovery(GraspMissed)"},
)
_HOLDS = Usage("holds", {"what": "a_location(near=table)"}, {"of": "cup"})
Goal = Condition | Callable[[], bool] | Signal[Any]


async def achieve(goal: Goal, body: Callable[[], Awaitable[V]], *recoveries: Recovery, within: float = 0.0) -> V | None:
    """Run the body unless the goal holds already; return the body's result, or None if it was skipped.

    The goal must hold at the latest ``within`` [s] of plan time after the body; otherwise GoalNotAchieved is raised. A
    condition is evaluated in the executive's belief state, a fluent by reading its present value. ``recoveries`` handle
    failures of all this, as in ``with_failure_handling``.
    """
    _ACHIEVE.branch("body", body)
    _ACHIEVE.seconds("within", within)
    check_recoveries(_ACHIEVE, recoveries)
    return await recovering(achieving(_ACHIEVE, "goal", goal, body, within), recoveries)


def achieving(
    usage: Usage, parameter: str, goal: Goal, body: Callable[[], Awaitable[V]], within: float = 0.0
) -> Callable[[], Awaitable[V | None]]:
    """Make a branch that achieves a goal, the argument ``parameter`` of the construct described by ``usage``."""
    if not isinstance(goal, (Condition, Signal)):
        usage.plain(parameter, goal, "a condition, a fluent or a function that returns whether the goal holds")
    text, holds = _reader(usage, parameter, goal)
    return partial(node, "achieve", "achieve", partial(_achieve, text, holds, body, within), goal=text)


async def _achieve(text: str, holds: Callable[[], bool], body: Callable[[], Awaitable[V]], within: float) -> V | None:
    if holds():
        record("skipped", goal=text)
        await checkpoint()
        return None
    result: V = await called(body)
    if not holds() and not (within and await wait_for(Fluent(read=holds, name=text), within)):
        raise GoalNotAchieved(goal=text)
    return result


def holds(what: Condition | Location, of: Object | None = None) -> Fluent[bool]:
    """Make a fluent that is true while a condition holds in the executive's belief state.

    For a location, the condition is that ``of`` is there: an object, or the hand of the device; by default the base of
    the robot. It is evaluated by the tests that validate candidates when the location is resolved.
    """
    executive = executive_for("holds")
    _HOLDS.instance("what", what, (Condition, Location), "a condition or a location")
    if of is not None:
        _HOLDS.instance("of", of, Object, "an object")
    condition = located(what, of) if isinstance(what, Location) else what
    return Fluent(read=lambda: executive.holds(condition), name=str(condition))


def _reader(usage: Usage, parameter: str, goal: Goal) -> tuple[str, Callable[[], bool]]:
    if isinstance(goal, Condition):
        executive = executive_for(usage.name)
        return str(goal), lambda: executive.holds(goal)
    if isinstance(goal, Signal):
        return str(goal), lambda: bool(goal.read())
    name, recorded = name_of(goal), here()[0].recorded

    def answer() -> bool:
        answer = goal()
        usage.at_once(parameter, goal, answer)
        return bool(answer)

    return name, answer if recorded is None else lambda: bool(recorded.answer(f"{name} holds", answer))


_WHENEVER = Usage("await whenever", {"signal": "bell_rings", "body": "answer"})


async def whenever(signal: Signal[Any], body: Callable[[], Awaitable[Any]]) -> Any:
    """Run the body each time the fluent is true, at most once per world step, until the body returns ``Return(v)``."""
    _WHENEVER.branch("body", body)
    _WHENEVER.instance("signal", signal, Signal, SIGNAL)
    return await node("whenever", "whenever", partial(_whenever, signal, body), signal=str(signal))


async def _whenever(signal: Signal[Any], body: Callable[[], Awaitable[Any]]) -> Any:
    while True:
        await wait_for(signal)
        result = await called(body)
        if isinstance(result, Return):
            return result.value
        await pause(1)


# -- policies

_POLICY = Usage(
    "Policy",
    {"name": '"keep away"'},
    {"check": "distance < 0.1", "init": "look", "recover": "retract", "clean_up": "stop"},
)
_WITH_POLICIES = Usage("await with_policies", {"policies": '[Policy("keep away", distance < 0.1)]', "body": "reach"})


@dataclass(frozen=True)
class Policy:
    """A condition that must stay false during a body, with branches for set-up, recovery and clean-up.

    The policy is violated as soon as ``check`` is true: a fluent, or a function that reads fluents and is called again
    whenever one of them changes, but not otherwise. Without ``check`` the policy cannot be violated. ``init`` runs
    before the body, ``recover`` after a violation of this policy, ``clean_up`` at the end in any case; the last two are
    shielded from evaporation for at most 10 s each.
    """

    name: str
    check: Signal[Any] | Callable[[], object] | None = None
    init: Branch | None = None
    recover: Branch | None = None
    clean_up: Branch | None = None

    def __post_init__(self) -> None:
        parts = {"init": self.init, "recover": self.recover, "clean_up": self.clean_up}
        _POLICY.branches(**{part: branch for part, branch in parts.items() if branch is not None})
        _POLICY.text("name", self.name)
        if not (self.check is None or isinstance(self.check, Signal) or callable(self.check)):
            code = written(self.check)
            message = f"the check of policy {self.name!r} is {code}, a plain value that never changes"
            wrong, right = (f"Policy({self.name!r}, distance{value} < 0.1)" for value in (".value", ""))
            raise WrongType(contrast(message, wrong, f"{right}, or lambda: distance.value < 0.1"))
        if self.check is not None and not isinstance(self.check, Signal):
            _POLICY.plain("check", self.check, "a fluent, or a function that reads fluents")


async def with_policies(policies: Sequence[Policy], body: Callable[[], Awaitable[V]]) -> V:
    """Run a body under policies and return its result; raise PolicyViolated if a policy is violated.

    First the inits run, in order. If one fails, the clean_ups of the policies before it run, and its failure is raised.
    If a check is true then, the body does not start. A violation takes precedence over an end of the body at the same
    decision; of several violations the textually first counts, and the others are its siblings. After a violation the
    body is evaporated with its cleanup, ``recover`` of that policy runs, then the clean_ups in reverse order, and
    PolicyViolated is raised. Failures of ``recover`` and the clean_ups are attached to it as ``cleanup_failures``; if
    the body succeeded, the first of them is raised. Evaporation from outside waits for ``recover`` and the clean_ups;
    one of them that takes longer than 10 s of plan time is a programming error.
    """
    _WITH_POLICIES.branch("body", body)
    _WITH_POLICIES.iterable("policies", policies, "a list of policies")
    policies = tuple(policies)
    for policy in policies:
        if not isinstance(policy, Policy):
            raise _WITH_POLICIES.wrong("policies", [policy], "a list of policies")
    names = [policy.name for policy in policies]
    for name in names:
        if names.count(name) > 1:
            raise PlanStructureError(
                f"two policies named {name!r} around one body\n"
                f'  wrong: with_policies([Policy("{name}", ...), Policy("{name}", ...)], body)\n'
                f'  right: with_policies([Policy("{name}", ...), Policy("{name} 2", ...)], body)'
            )
    result: V = await node("with_policies", "with_policies", partial(_guarded, policies, body), policies=names)
    return result


async def _guarded(policies: Sequence[Policy], body: Branch) -> Any:
    initialized: list[Policy] = []
    result: Any = None
    error: BaseException | None = None
    try:
        for policy in policies:
            await _part("init", policy.init, policy)
            initialized.append(policy)
        result = await _run(policies, body)
    except (Exception, Evaporated, KeyboardInterrupt, SystemExit) as raised:
        error = raised
    await _clean_up(initialized, error)
    return result


async def _part(kind: str, branch: Branch | None, policy: Policy) -> None:
    if branch is not None:
        await node(kind, f"{kind} {policy.name}", partial(_without_result, branch))


async def _without_result(branch: Branch) -> None:
    await called(branch)


async def _run(policies: Sequence[Policy], body: Branch) -> Any:
    scope = _Guarded(policies, body)
    result = await scope.execute()
    if not scope.violated:
        return result
    first, *others = scope.violated
    violation = PolicyViolated(policy=first.name)
    violation.siblings = tuple((other.name, PolicyViolated(policy=other.name)) for other in others)
    if scope.failed_body is not None:
        violation.siblings += ((scope.failed_body.name, failure_of(scope.failed_body)),)
    scope.attach(violation)
    record("policy violated", policy=first.name)
    try:
        with shield():
            await _part("recover", first.recover, first)
    except PlanFailure as failure:
        attach_cleanup(violation, (failure,))
    raise violation


async def _clean_up(initialized: list[Policy], error: BaseException | None) -> None:
    """Run all clean_ups, whatever happens, then raise the error, if any; programming errors take precedence."""
    failures: list[PlanFailure] = []
    for policy in reversed(initialized):
        try:
            with shield():
                await _part("clean_up", policy.clean_up, policy)
        except PlanFailure as failure:
            failures.append(failure)
        except Evaporated as evaporated:
            error = error or evaporated
        except Exception as crash:
            if error is None or isinstance(error, (PlanFailure, Evaporated)):
                crash.__cause__ = error
                error = crash
    if failures and (error is None or isinstance(error, Evaporated)):
        error = failures.pop(0)  # which an evaporated task only records
    if error is not None:
        attach_cleanup(error, failures)
        raise error


class _Guarded(All):
    """The body, with a watch of each check that is active before the body starts."""

    transparent = True

    def __init__(self, policies: Sequence[Policy], body: Branch) -> None:
        super().__init__("branch")
        self.policies = policies
        self.body = body
        self.watches: list[_Watch] = []
        self.violated: list[Policy] = []
        self.failed_body: Task | None = None
        """The body, if it failed at the same decision at which a policy was violated."""
        self.result: Any = None

    def begin(self) -> None:
        for index, policy in enumerate(self.policies):
            if policy.check is not None:
                watch = _Watch(self, policy.check, policy.name)
                self.watches.append(watch)
                watch.index = index
                if watch.look():
                    self.violated.append(policy)
        if self.violated:
            return
        for watch in self.watches:
            watch.task = self.start(watch.wait, watch.name, watch.index + 1)
        self.start(self.body, name_of(self.body), 0)

    def decide(self, dead: list[Task]) -> None:
        watching = [task for task in dead if task.index]
        self.violated = [self.policies[task.index - 1] for task in watching if task.outcome is Status.SUCCEEDED]
        body = dead[0] if not dead[0].index else None
        if self.violated:
            self.failed_body = body if body is not None and body.outcome is Status.FAILED else None
            self.close()
            return
        super().decide(dead)
        if not self.over and body is not None:
            self.result = body.result
            self.close()

    async def execute(self) -> Any:
        try:
            return await super().execute()
        finally:
            for watch in self.watches:
                watch.follow({})

    def finish(self) -> Any:
        self.raise_failure()
        return self.result


class _Watch(Wait):
    """Watch of a check, which is evaluated whenever one of its inputs changes, until it is true once.

    Invariant: it watches exactly the fluents in ``inputs``.
    """

    index = 0

    def __init__(self, scope: _Guarded, condition: Signal[Any] | Callable[[], object], name: str) -> None:
        self.scheduler = scope.scheduler
        self.task: Task | None = None
        self.name = name
        self.condition = condition
        self.inputs: dict[BaseFluent[Any], None] = {}
        self.true = False
        self.error: Exception | None = None
        if isinstance(condition, Signal):
            condition.arm()

    def look(self) -> bool:
        """Evaluate the check now, and watch the fluents that it reads; raises what the check raises."""
        reads: dict[BaseFluent[Any], None] = {}
        before, tracked.reads = tracked.reads, reads
        try:
            if isinstance(self.condition, Signal):
                is_violated = bool(self.condition.value)
                reads.update(self.condition.sources())
            else:
                answer = self.condition()
                _POLICY.at_once("check", self.condition, answer)
                is_violated = bool(answer)
        finally:
            tracked.reads = before
            self.follow(reads)
        if not reads:
            raise PlanStructureError(
                f"the check of policy {self.name!r} reads no fluent, so that it would never be evaluated again\n"
                f"  wrong: Policy({self.name!r}, lambda: world.distance() < 0.1)\n"
                f"  right: distance = Fluent(read=world.distance); Policy({self.name!r}, distance < 0.1)"
            )
        return is_violated

    def follow(self, inputs: dict[BaseFluent[Any], None]) -> None:
        """Watch exactly these fluents."""
        before, self.inputs = self.inputs, inputs
        for source in inputs:
            if source not in before:
                source.watch(self)
        for source in before:
            if source not in inputs:
                source.unwatch(self)

    def recheck(self) -> None:
        """Evaluate the check again after a change of an input."""
        task = self.task
        if self.true or self.error is not None or task is None or task.holds or task.dead:
            return
        try:
            self.true = self.look()
        except Exception as error:
            self.error = error
        if (self.true or self.error is not None) and task.wait is self:
            self.scheduler.wake(task)

    async def wait(self) -> None:
        """Wait until the check is true."""
        self.recheck()
        if not self.true and self.error is None:
            await park(self)
        if self.error is not None:
            raise self.error

    def __str__(self) -> str:
        return f"a violation of policy {self.name!r}"
