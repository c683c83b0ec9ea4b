"""What remains to be done: the actions that a plan's text has behind the step that runs, with their present values.

The frames of the running task, and of the tasks that wait for it, tell where the plan is; its text tells what comes
after, and the frames what its names mean. Nothing is executed but descriptions, and nothing is kept meanwhile.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from functools import cache, partial
from types import CodeType, FrameType
from typing import Any

from planlang.designators import Action
from planlang.kernel.tracebacks import frames_around
from planlang.language.plan_text import Step
from planlang.language.plans import Plan
from planlang.language.source import PlanSource

SOURCE = "__plan_source__"
"""Name under which the module of a plan has its text."""


def remaining_actions() -> Iterator[Action]:
    """Yield the actions that remain behind the running step, in the order of the text, innermost plan function first.

    A composite action is followed by those of the plan that performs it. Left out is what the text does not describe,
    such as an action that only a loop or a function makes. Outside a plan that has a text there are none.
    """
    inner: Mapping[str, Any] = {}
    for frame in frames_around():
        source, code = frame.f_globals.get(SOURCE), frame.f_code
        if not isinstance(source, PlanSource) or (function := _plan_around(frame)) is None:
            continue
        line, column = _end_of_instruction(frame)
        behind = source.behind(Step(function, line, column, "", False))
        is_branch = code.co_name != function
        if is_branch:  # what is behind the branch is behind the step of its plan function, which comes later
            last = max(number for *_, number in code.co_lines() if number is not None)
            behind = tuple(step for step in behind if step.function == function and step.line <= last)
        yield from _described(behind, {function: {**frame.f_locals, **inner}}, frame.f_globals)
        inner = {**inner, **frame.f_locals} if is_branch else {}


def _described(
    steps: tuple[Step, ...], values: dict[str, Mapping[str, Any]], names: Mapping[str, Any]
) -> Iterator[Action]:
    """Yield the actions of steps; ``values`` are those of the names of each plan function that was entered so far."""
    for step in steps:
        own = values.get(step.function)
        what = None if own is None or step.described is None else _value(step.described, step.names, own, names)
        if isinstance(what, Action):
            yield what
        called = what.func if isinstance(what, partial) else what
        if isinstance(called, Plan):
            given = (what.args, what.keywords) if isinstance(what, partial) else ((), {})
            try:
                bound = inspect.signature(called.function).bind_partial(*given[0], **given[1])
            except TypeError:  # reported where it is called
                continue
            bound.apply_defaults()
            values.setdefault(called.name, bound.arguments)


class _Names(dict[str, Any]):
    """Values of names, with those of names that are still to be assigned, by what will be."""

    def __init__(self, texts: Mapping[str, str], own: Mapping[str, Any], names: Mapping[str, Any]) -> None:
        super().__init__({"partial": partial, **names, **own, "__builtins__": {}})
        self._texts = dict(texts)

    def __missing__(self, name: str) -> Any:
        text = self._texts.pop(name, None)  # popped, so that one that needs itself ends
        if text is None:
            raise KeyError(name)
        self[name] = value = eval(_code(text), {"__builtins__": {}}, self)
        return value


def _value(text: str, texts: Mapping[str, str], own: Mapping[str, Any], names: Mapping[str, Any]) -> object:
    """Evaluate a description; None if it needs what is not known yet, or describes nothing that can be."""
    try:
        return eval(_code(text), {"__builtins__": {}}, _Names(texts, own, names))
    except Exception:  # whatever is wrong with it is reported by the step itself
        return None


@cache
def _code(text: str) -> CodeType:
    return compile(text, "<description>", "eval")


def _plan_around(frame: FrameType) -> str | None:
    """Find the plan function of its file to which a frame belongs, itself or a branch of it; None without one."""
    plans = (one for one in frame.f_globals.values() if isinstance(one, Plan))
    return next((one.name for one in plans if _contains(getattr(one.function, "__code__", None), frame.f_code)), None)


def _contains(outer: object, code: CodeType) -> bool:
    return outer is code or (isinstance(outer, CodeType) and any(_contains(one, code) for one in outer.co_consts))


def _end_of_instruction(frame: FrameType) -> tuple[int, int]:
    """Line and column, from 1, of the end of what a frame is doing."""
    positions = list(frame.f_code.co_positions())[frame.f_lasti // 2]
    line, column = positions[1], positions[3]
    return (frame.f_lineno, 0) if line is None or column is None else (line, column)
