"""Plan functions: marked, named in the tree of a run, and the home of their tags."""

from __future__ import annotations

import dis
import functools
import inspect
import itertools
from collections.abc import Awaitable, Callable, Coroutine
from functools import partial
from types import FunctionType, MethodType
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, overload

from planlang.kernel.core import Task, here
from planlang.kernel.primitives import called, node, record
from planlang.kernel.tree import name_of
from planlang.language.tags import Frame, frame
from planlang.misuse import Usage, WrongType, contrast

P = ParamSpec("P")
Q = ParamSpec("Q")
R = TypeVar("R")
_PLAN = Usage("plan", {"function": "serve"}, {"iri": '"http://example.org/recipe#Serve"'})


class Plan(Generic[P, R]):
    """A plan function; calling it gives a coroutine, as with any ``async def``. Made by :func:`plan`."""

    def __init__(self, function: Callable[P, Awaitable[R]], iri: str | None) -> None:
        _PLAN.branch("function", function)
        if (
            isinstance(function, FunctionType)
            and not inspect.iscoroutinefunction(function)
            and _gives_nothing(function)
        ):
            name = name_of(function)
            message = f"a plan is a function written with async def, which {name} is not"
            raise WrongType(contrast(message, f"@plan def {name}(): ...", f"@plan async def {name}(): ..."))
        if iri is not None:
            _PLAN.text("iri", iri)
        functools.update_wrapper(self, function)
        self.function = function
        self.iri = iri
        self.name: str = getattr(function, "__name__", "plan")

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> Coroutine[Any, Any, R]:
        """Return the plan as a coroutine; to run it side by side with others pass the plan itself, not a call."""
        coroutine = self._execute(args, kwargs)
        coroutine.__qualname__ = coroutine.__name__ = self.name  # type: ignore[attr-defined]  # which every coroutine of Python has
        return coroutine

    async def _execute(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> R:
        task = here()[1]
        details: dict[str, object] = {}
        if self.iri is not None:
            details["iri"] = self.iri
        if args:
            details["arguments"] = args
        if kwargs:
            details["parameters"] = kwargs
        own = Frame(frame.get())
        token = frame.set(own)
        try:
            if isinstance(task.node, Task) and task.node.unused and task.node.base_name == self.name:
                record("plan", **details)  # the branch is this plan: one node in the tree
                return await called(self.function, *args, **kwargs)  # type: ignore[no-any-return]
            body = partial(called, self.function, *args, **kwargs)
            return await node("plan", self.name, body, **details)  # type: ignore[no-any-return]
        finally:
            own.leave()
            frame.reset(token)

    @overload
    def __get__(self, instance: None, owner: object) -> Plan[P, R]: ...
    @overload
    def __get__(
        self: Plan[Concatenate[Any, Q], R], instance: object, owner: object
    ) -> Callable[Q, Coroutine[Any, Any, R]]: ...
    def __get__(self, instance: object, owner: object) -> Any:
        """Return the plan, bound to the object whose method it is, if any."""
        return self if instance is None else MethodType(self, instance)

    def __repr__(self) -> str:
        return f"<plan {self.name}>"


def _gives_nothing(function: object) -> bool:
    """Return True for a function that always returns None; one that a decorator has made may return an awaitable."""
    return isinstance(function, FunctionType) and not any(
        one.opname == "RETURN_VALUE" and before.opname != "LOAD_CONST"
        for before, one in itertools.pairwise(dis.get_instructions(function))
    )


@overload
def plan(iri: str | None = None, /) -> Callable[[Callable[P, Awaitable[R]]], Plan[P, R]]: ...
@overload
def plan(function: Callable[P, Awaitable[R]], /) -> Plan[P, R]: ...
def plan(what: Any = None, /) -> Any:
    """Mark a plan function: ``@plan("http://...#ServeADrink")`` or ``@plan``."""
    if callable(what) or not (what is None or isinstance(what, str)):
        return Plan(what, None)
    if what is not None:
        _PLAN.text("iri", what)
    return functools.partial(_marked, what)


def _marked(iri: str | None, function: Callable[P, Awaitable[R]]) -> Plan[P, R]:
    return Plan(function, iri)
