"""Performing actions: finding the process module, taking turns, and stopping the robot on suspension."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from functools import partial
from typing import TYPE_CHECKING, Any

from planlang.designators import Action, local_name
from planlang.failures import ActionUnresolvable, PlanFailure
from planlang.kernel import Fluent, PlanStructureError
from planlang.kernel.calling import called
from planlang.kernel.journal import taken_over
from planlang.kernel.park import here as at
from planlang.kernel.primitives import inside, record
from planlang.language.budgets import spend
from planlang.language.context import current, executive_for
from planlang.language.place import place
from planlang.language.resources import using
from planlang.language.restarting import Restarting
from planlang.misuse import Usage

if TYPE_CHECKING:
    from planlang.language.executive import Executive, ProcessModule


_PERFORM = Usage("await perform", {"action": 'action("Reaching")'}, {"name": '"reach"'})
_PERFORM_OR = Usage("await perform_or", {"action": 'action("Reaching")', "branch": "reach"})


def check_action(usage: Usage, action: Action, name: str | None) -> None:
    """Refuse what is no action, and what is no name for a request."""
    usage.instance("action", action, Action, "an action")
    if name is not None:
        usage.text("name", name)


def module_for(executive: Executive, action: Action) -> ProcessModule | None:
    """The module registered for the nearest ancestor of the action's class; of several the first registered."""
    for ancestor in executive.ancestors(action.type):
        for module in executive.modules:
            if ancestor in module.actions:
                return module
    return None


async def perform(action: Action, name: str | None = None) -> Any:
    """Have a process module perform an action; returns what the module returns.

    A module works on one request at a time, first come, first served, and holds the action's resources meanwhile.
    Evaporation cancels the request; suspension cancels it, and it is made again after waking up. Raises what the
    module raises, ActionUnresolvable if there is none; a failure that the module does not declare is a programming
    error.
    """
    check_action(_PERFORM, action, name)
    path_element = name or action.name or local_name(action.type)
    if (before := taken_over("perform", path_element)) is not None:
        scheduler, _ = at()
        began = scheduler.now
        try:
            return await before
        finally:
            spend(path_element, scheduler.now - began)
    executive = executive_for("perform")
    module = module_for(executive, action)
    if module is None:
        with inside("perform", path_element, action=action):
            raise ActionUnresolvable(designator=str(action))
    resources = tuple(module.resources(action))
    here = place.get()
    if here is not None and here.displaced and "base" not in resources:
        announce()
        await here.establish()
    releases = here is not None and executive.releases(action)
    if here is not None and releases and (refused := here.refusal(action, executive)) is not None:
        with inside("perform", path_element, action=action):
            raise refused
    result = await _Perform(path_element, action, module, resources).execute()
    if here is not None and releases:
        here.released(action)
    return result


async def perform_or(action: Action, branch: Callable[[], Awaitable[Any]]) -> Any:
    """Have a module perform the action if one is registered for its class or an ancestor; else run the branch."""
    _PERFORM_OR.branch("branch", branch)
    _PERFORM_OR.instance("action", action, Action, "an action")
    executive = current.get()
    if executive is not None and module_for(executive, action) is not None:
        return await perform(action)
    return await called(branch)


class _Perform(Restarting):
    def __init__(self, name: str, action: Action, module: ProcessModule, resources: tuple[str, ...]) -> None:
        super().__init__("perform", name, partial(_request, module, action, resources), module.name)
        self.action = action

    async def execute(self) -> Any:
        began = self.scheduler.now
        try:
            return await super().execute()
        finally:
            spend(self.base_name, self.scheduler.now - began)

    def details(self) -> dict[str, object]:
        return {"action": self.action}


asked: ContextVar[Fluent[bool] | None] = ContextVar("asked", default=None)
"""Set to true when a request takes its place in the queue of its module, or something has to be done before."""


def announce() -> None:
    """Say that the request of the running task is on its way."""
    fluent = asked.get()
    if fluent is not None:
        fluent.set(True)


async def _request(module: ProcessModule, action: Action, resources: tuple[str, ...]) -> Any:
    announce()
    async with using(f"module {module.name}", *resources):
        record("request", module=module.name, action=action)
        try:
            return await module.execute(action)
        except Exception as failure:
            if not isinstance(failure, PlanFailure):
                failure.add_note(f"raised by process module {module.name}, performing {action}")
                raise
            if not isinstance(failure, tuple(module.failures)):
                raise PlanStructureError(
                    f"process module {module.name} raised {type(failure).__name__}, which it does not declare; "
                    f"declared: {', '.join(kind.__name__ for kind in module.failures) or 'none'}"
                ) from failure
            raise
