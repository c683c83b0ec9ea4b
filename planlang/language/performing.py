"""Performing actions: selection of the process module, queues for modules and resources, asynchronous requests."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from planlang.action_classes import levels_above, stated_levels
from planlang.designators import Action, local_name
from planlang.failures import ActionUnresolvable, BudgetExceeded, ObjectUndeliverable, PlanFailure
from planlang.kernel import All, Fluent, PlanStructureError, Status, Task, checkpoint, wait_for
from planlang.kernel.core import here, running
from planlang.kernel.primitives import called, in_node, record
from planlang.kernel.signals import Expression
from planlang.kernel.tree import Node, name_of
from planlang.language.branches import Branch, evaporating
from planlang.language.budgets import charge
from planlang.language.conditions import Goal, achieving
from planlang.language.executive import current, executive_for
from planlang.language.performances import performing
from planlang.language.plans import Handle, Plan, Restarting, join
from planlang.language.preceding import before_next
from planlang.language.process_module import performs
from planlang.language.recovery import Recovery, recoveries_of, recovering
from planlang.language.resources import hand_freed, using
from planlang.language.set_aside import left_behind
from planlang.misuse import Usage, WrongType, contrast, did_you_mean, written

if TYPE_CHECKING:
    from planlang.designators import Action
    from planlang.language.executive import Executive
    from planlang.language.process_module import ProcessModule

V = TypeVar("V")


class HeldPose:
    """The base pose of the nearest enclosing ``at_location``; :meth:`establish` drives back to it.

    Invariant: ``displaced`` iff a nested scope has moved the base and left it elsewhere.

    ``failure`` is the reason why the body runs again, None on its first run. ``is_last`` is set when an action begins
    that must not be repeated: the body does not run again then. Nor does it once a thing was ``delivered``: let go of
    by a step whose goal, if it has one, another run would not find reached.
    """

    __slots__ = ("_go", "_released_earlier", "_released_now", "delivered", "displaced", "failure", "is_last")

    def __init__(self, go: Callable[[], Awaitable[None]]) -> None:
        self._go = go
        self._released_earlier: set[Action] = set()
        self._released_now: set[Action] = set()
        self.delivered: tuple[str, ...] = ()
        self.displaced = False
        self.failure: PlanFailure | None = None
        self.is_last = False

    def again(self, failure: PlanFailure) -> None:
        """Start another run of the body, because of a failure."""
        self._released_earlier |= self._released_now
        self._released_now.clear()
        self.failure = failure

    def refusal(self, action: Action, executive: Executive) -> ObjectUndeliverable | None:
        """Failure of an action that would open the hand a second time while its object is still to be delivered."""
        held = tuple(executive.held()) if action in self._released_earlier else ()
        if not held:
            return None
        what = ", ".join(held)
        refused = ObjectUndeliverable(f"{what} is still held, and {action} would open the hand again", what=what)
        refused.__cause__ = self.failure
        return refused

    def released(self, action: Action, what: object) -> None:
        """Register an action of this run of the body that has opened a hand, and the name of what was in it, if any."""
        self._released_now.add(action)
        if isinstance(what, str):
            self.delivered += (what,)

    async def establish(self) -> None:
        """Drive back to this pose."""
        await self._go()
        self.displaced = False


held_pose: ContextVar[HeldPose | None] = ContextVar("held pose", default=None)
last_resources: ContextVar[list[str] | None] = ContextVar("resources of the last action", default=None)
"""What the last action of a plan used that has ended well, without those that modules perform; empty before one has."""


_PERFORM = Usage(
    "await perform",
    {"action": 'action("Reaching")'},
    {
        "name": '"reach"',
        "once": "True",
        "otherwise": "reach",
        "until": "holding(cup)",
        "recoveries": "[Recovery(GraspMissed)]",
        "times": "3",
    },
)


def check_action(usage: Usage, action: Action, name: str | None) -> None:
    """Check the arguments of a request; raises WrongType or WrongValue."""
    usage.instance("action", action, Action, "an action")
    if name is not None:
        usage.text("name", name)


def module_for(executive: Executive, action: Action, otherwise: Branch | None = None) -> ProcessModule | None:
    """Find the module for the nearest ancestor of the action's class; of several, the one registered first.

    Modules whose ``performs`` rejects the action are skipped. None if ``otherwise`` is the plan of a nearer class.
    """
    own = frozenset(_recipes(otherwise))
    for level in levels_above(action.type, executive.ancestors):
        for ancestor in level:
            for module in executive.modules:
                if ancestor in module.actions and performs(module, action):
                    return module
        if not own.isdisjoint(level):
            return None
    return None


def _recipes(branch: object) -> Iterator[str]:
    """Yield the action classes whose plans a branch calls, as IRIs and local names."""
    if isinstance(branch, partial):
        for part in (branch.func, *branch.args):
            yield from _recipes(part)
    elif isinstance(branch, Plan) and branch.iri is not None:
        yield from (branch.iri, local_name(branch.iri))


async def perform(
    action: Action,
    name: str | None = None,
    *,
    once: bool = False,
    otherwise: Branch | None = None,
    until: Goal | None = None,
    recoveries: Iterable[Recovery] = (),
    times: int = 1,
) -> Any:
    """Have a process module perform an action; return the module's result.

    ``once`` marks an action whose effects are unknown, so that it must not be repeated: from its start on, an enclosing
    :func:`at_location` tries no other base pose and ends with the failure of its body.

    A module executes one request at a time, first come, first served, and holds the action's resources meanwhile.
    Evaporation cancels the request; suspension cancels it too, and it is repeated on wake-up. Raises the failure of the
    module, or ActionUnresolvable if there is no module; a failure that the module does not declare is a programming
    error.

    A module may perform further actions with this function. They use the resources of its own request, and only the
    recoveries that the module passes.

    ``otherwise`` is a branch that replaces the module if none is registered for the action's class or an ancestor. If
    it is the plan of one of these classes (``@plan(IRI)``), it also takes precedence over modules for farther ones.
    ``until`` is a goal as in ``achieve``: if it holds, nothing is performed and the result is None; if it does not hold
    afterwards, GoalNotAchieved is raised. ``recoveries`` handle failures of all this, as in ``with_failure_handling``.
    With ``times``, all this is done so often, each time with another thing of each class that the action names.
    """
    times = _PERFORM.whole("times", times, 1, "performances")
    if otherwise is not None:
        _PERFORM.branch("otherwise", otherwise)
    check_action(_PERFORM, action, name)
    path_element = name or action.name or local_name(action.type)
    step: Branch = partial(_performed, action, path_element, once, otherwise)
    if until is not None:
        step = achieving(_PERFORM, "until", until, partial(_repeatable, step))
    rules, result = tuple(recoveries_of(_PERFORM, recoveries)), None
    for _ in range(times):
        with performing(action, path_element, times=times):
            act = partial(recovering, step, rules)
            result = await (act() if once else _in_turn(act, has_goal=until is not None))
    return result


async def _repeatable(step: Branch) -> Any:
    """Perform a step that has a goal: once that is reached, another run of the body around it skips the step."""
    pose = held_pose.get()
    earlier = () if pose is None else pose.delivered
    result = await step()
    if pose is not None:
        pose.delivered = earlier
    return result


async def _in_turn(step: Branch, *, has_goal: bool) -> Any:
    """Perform a step; if it fails while a part of the plan waits that let it go first, that goes on; then repeat it.

    What has no goal is repeated only for want of a hand: it may have done something that must not be done twice.
    """
    try:
        return await step()
    except PlanFailure as failure:
        if evaporating() or not await hand_freed(failure, anyway=has_goal):
            raise
    return await step()


async def _performed(action: Action, path_element: str, once: bool, otherwise: Branch | None) -> Any:
    for one in before_next(path_element):
        await perform(one)
    executive = current.get() if otherwise is not None else executive_for("perform")
    if executive is not None and (lost := left_behind(action, executive)) is not None:
        return await _without_module(action, path_element, partial(_fail, lost))
    module = None if executive is None else module_for(executive, action, otherwise)
    if executive is None or module is None:
        if otherwise is not None:
            return await _without_module(action, path_element, partial(called, otherwise))
        failure = _unresolvable(action, executive_for("perform"))
        return await _without_module(action, path_element, partial(_fail, failure))
    resources = tuple(module.resources(action))
    pose = held_pose.get()
    if pose is not None and pose.displaced and "base" not in resources and not _inside_module.get():
        announce()  # the drive back is part of the request, so that an asynchronous one counts as queued
        await pose.establish()
    if pose is not None and once:
        pose.is_last = True
    releases = pose is not None and executive.releases(action)
    if pose is not None and releases and (refused := pose.refusal(action, executive)) is not None:
        # The hand is not opened a second time while it holds an object to be delivered: better fail than drop it.
        return await _without_module(action, path_element, partial(_fail, refused))
    result = await _Perform(path_element, action, module, resources).execute()
    if pose is not None and releases:
        pose.released(action, None if _inside_module.get() else result)
    if (last := last_resources.get()) is not None and not _inside_module.get():
        last[:] = resources
    return result


def _unresolvable(action: Action, executive: Executive) -> ActionUnresolvable:
    """Failure of an action without a module, with a suggestion if its class is misspelt, or what to register."""
    failure, cls = ActionUnresolvable(designator=str(action)), local_name(action.type)
    classes = {cls for module in executive.modules for cls in module.actions}
    advice = f"; in a test, script.performs({cls!r}) adds it; in a run, a process module that is added to it does"
    failure.message = f"{failure}{did_you_mean(cls, classes, alike=0.8) or advice}"
    return failure


class _WithoutModule(Node):
    """An action that is performed by a branch, or fails, for want of a module."""

    __slots__ = ("action",)
    action: Action


async def _without_module(action: Action, name: str, body: Branch) -> Any:
    """Run a body in place of a module."""
    own = _WithoutModule(here()[1].node, "perform", name)
    own.action = action
    return await in_node(own, body, **_described(action))


def _described(action: Action) -> dict[str, object]:
    """Details of an action for the trace, including the superclasses that the plan states."""
    stated = [cls for level in stated_levels(action.type) for cls in level][1:]
    return {"action": action, "classes": stated} if stated else {"action": action}


def actions_around() -> Iterator[Action]:
    """Yield the actions in progress around the running task, innermost first."""
    scheduler = running.scheduler
    task = None if scheduler is None else scheduler.current
    node = None if task is None else task.node
    while node is not None:
        if isinstance(node, (_WithoutModule, _Perform)):
            yield node.action
        node = node.parent


def is_inner(node: Node) -> bool:
    """Check whether a node belongs to the execution of an action by a process module."""
    ancestor = node.parent
    while ancestor is not None and not isinstance(ancestor, _Perform):
        ancestor = ancestor.parent
    return ancestor is not None


async def _fail(failure: PlanFailure) -> NoReturn:
    raise failure


class _Perform(Restarting):
    def __init__(self, name: str, action: Action, module: ProcessModule, resources: tuple[str, ...]) -> None:
        super().__init__("perform", partial(_request, module, action, resources), name, module.name)
        self.action = action

    async def execute(self) -> Any:
        began = self.scheduler.now
        try:
            return await super().execute()
        finally:
            charge("spent", self.base_name, self.scheduler.now - began)

    def details(self) -> dict[str, object]:
        return _described(self.action)


_inside_module: ContextVar[bool] = ContextVar("inside a process module", default=False)
"""True inside a process module, which is itself responsible for the base pose of the actions that it performs."""
request_queued: ContextVar[Fluent[bool] | None] = ContextVar("request queued", default=None)
"""Set to true when a request enters the queue of its module, or the drive before it begins."""


def announce() -> None:
    """Mark the request of the running task as queued."""
    fluent = request_queued.get()
    if fluent is not None:
        fluent.set(True)


async def _request(module: ProcessModule, action: Action, resources: tuple[str, ...]) -> Any:
    announce()
    async with using(f"module {module.name}", *resources):
        record("request", module=module.name, action=action)
        token = _inside_module.set(True)
        try:
            return await module.execute(action)
        except Exception as failure:
            if not isinstance(failure, PlanFailure):
                failure.add_note(f"raised by process module {module.name}, performing {action}")
                raise
            # what limits the whole run may end any action in it
            if not isinstance(failure, (*module.failures, BudgetExceeded)):
                raise PlanStructureError(
                    f"process module {module.name} raised {type(failure).__name__}, which it does not declare; "
                    f"declared: {', '.join(kind.__name__ for kind in module.failures) or 'none'}"
                ) from failure
            raise
        finally:
            _inside_module.reset(token)


_WITH_REQUESTS = Usage("await with_requests", {"body": "serve"})
_PERFORM_ASYNC = Usage("await perform_async", {"action": 'action("Reaching")'}, {"name": '"reach"'})
_MONITOR = Usage("await monitor", {"request": "await perform_async(action(...))"})


class Request(Handle):
    """An asynchronous request, and the handle of its task."""

    def __init__(self, action: Action, task: Task) -> None:
        if not isinstance(task, Task):
            message, code = "requests are created by perform_async()", f"Request({written(action)}, ...)"
            raise WrongType(contrast(message, code, _PERFORM_ASYNC.shown("action")))
        super().__init__(task.name, task)
        self.action = action
        self.task = task


async def with_requests(body: Callable[[], Awaitable[V]]) -> V:
    """Run a body that may make asynchronous requests with :func:`perform_async`; return the body's result.

    Requests finish or fail one by one, without effect on the body. After the body has succeeded, the pending requests
    are awaited; then the first failure of a request that was not monitored is raised, with later ones as its siblings.
    If the body fails or is evaporated, pending requests are cancelled. A programming error ends everything.
    """
    _WITH_REQUESTS.branch("body", body)
    scope = _Requests(body)
    token = _requests.set(scope)
    try:
        result: V = await scope.execute()
    finally:
        _requests.reset(token)
    return result


async def perform_async(action: Action, name: str | None = None) -> Request:
    """Request an action from a process module without waiting for it; :func:`monitor` returns its outcome.

    Suspension and evaporation of the caller affect the request as they affect :func:`perform`. The request does not
    share resources that the caller holds at the time: holding the arm while monitoring a request for the arm is a
    deadlock.
    """
    check_action(_PERFORM_ASYNC, action, name)
    executive_for("perform_async")
    scope = _requests.get()
    if scope is None or here()[1] is not scope.body_task:
        raise PlanStructureError(
            "perform_async() must be called in the body of with_requests(), and not in another branch inside it\n"
            f"  wrong: request = await perform_async({action})\n"
            "  right: async def body(): request = await perform_async(...); ...; await monitor(request)\n"
            "         await with_requests(body)"
        )
    await checkpoint()
    queued: Fluent[bool] = Fluent(False, "a place in the queue")
    request = scope.request(partial(_perform, action, name, queued), action)
    await wait_for(queued | Expression(lambda status: status.final, "the end of", request.status))
    return request


async def monitor(request: Request) -> Any:
    """Wait until an asynchronous request has ended; return its result or raise its failure, the same object.

    Other requests have no influence.
    """
    _MONITOR.instance("request", request, Request, "a request")
    return await join(request)


async def _perform(action: Action, name: str | None, queued: Fluent[bool]) -> Any:
    request_queued.set(queued)
    return await perform(action, name)


class _Requests(All):
    body_task: Task | None = None

    def __init__(self, body: Branch) -> None:
        super().__init__("with_requests")
        self.body = body
        self.requests: list[Request] = []

    def begin(self) -> None:
        self.body_task = self.start(self.body, name_of(self.body), 0)

    def request(self, branch: Branch, action: Action) -> Request:
        """Start a request."""
        if self.over:
            raise PlanStructureError(
                "perform_async() cannot be called in the cleanup of its with_requests()\n"
                f"  wrong: await perform_async({action})\n"
                f"  right: await perform({action})"
            )
        task = self.start(branch, "request", len(self.requests) + 1)
        request = Request(action, task)
        self.requests.append(request)
        return request

    def decide(self, dead: list[Task]) -> None:
        if not dead[0].index:
            super().decide(dead[:1])

    def finish(self) -> Any:
        self.raise_failure()
        requests = self.requests
        failed = [each.task for each in requests if each.task.outcome is Status.FAILED and not each.joined]
        if failed:
            self.fail(failed)
            self.raise_failure()
        assert self.body_task is not None
        return self.body_task.result


_requests: ContextVar[_Requests | None] = ContextVar("requests", default=None)
