"""Loading of a user's files as modules; in plans, calls of the plan language are checked against its signatures."""

from __future__ import annotations

import inspect
import linecache
from collections.abc import Callable, Iterator
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from types import FunctionType, ModuleType

from planlang.diagnostics import BadInput, Diagnostic, Span, error, line_in
from planlang.language.remaining import SOURCE
from planlang.language.source import PlanSource
from planlang.words import Text, calling


def load_plan(source: PlanSource, name: str | None = None) -> ModuleType:
    """Execute a plan as a new module; nothing is written beside its file.

    Raises BadInput (X001), with lines, if that fails, or if calls do not fit the functions of the plan language, even
    where they are not reached.
    """
    file = source.file
    module = new_module(name or f"planlang_run_{source.path.stem}", file)
    vars(module)[SOURCE] = source
    if source.is_in_memory:  # tracebacks look here for lines; without a time, nobody asks whether the file has changed
        linecache.cache[file] = len(source.text), None, source.text.splitlines(keepends=True), file

    def advice(problem: BaseException) -> Text | None:
        own = isinstance(problem, ImportError) and (problem.name or "").partition(".")[0] == "planlang"
        return _advice(source) if own or isinstance(problem, TypeError) else None

    execute(module, source.content, "X001", "the plan", advice)
    misfits = list(_misfits(source, module))
    if misfits:
        raise BadInput(misfits)
    return module


def new_module(name: str, file: str) -> ModuleType:
    """Make the module of a user's file, which is still to be executed."""
    module = module_from_spec(ModuleSpec(name, None, origin=file))
    module.__file__ = file
    return module


def execute(
    module: ModuleType, content: bytes, code: str, what: str, advice: Callable[[BaseException], str | None]
) -> None:
    """Execute the content of a user's file in its module.

    If that fails, raises BadInput with a code, the line, and advice about the exception; ``what`` names the file.
    """
    file = str(module.__file__)
    try:
        exec(compile(content, file, "exec", dont_inherit=True), vars(module))
    except (Exception, SystemExit) as problem:
        message = f"{what} cannot be imported: {type(problem).__name__}: {problem}"
        raise BadInput([error(code, message, Span(file, line_in(problem, file) or 1), advice(problem))]) from problem


def _misfits(source: PlanSource, module: ModuleType) -> Iterator[Diagnostic]:
    """Yield an error for each call of the plan language with arguments that do not fit the function."""
    for call in source.calls:
        function = vars(module).get(call.written or "")
        if call.given is None or not isinstance(function, FunctionType | type):
            continue
        if function.__module__.partition(".")[0] != "planlang":
            continue
        try:
            signature = inspect.signature(function)
        except ValueError:
            continue  # exceptions without an own __init__ accept any arguments
        bind = signature.bind_partial if call.is_partial else signature.bind
        try:
            bind(*[None] * call.given, **{str(keyword.name): None for keyword in call.keywords})
        except TypeError as problem:
            message = f"{call.written} has other parameters in this version of planlang: {problem}"
            yield error("X001", message, Span(source.file, call.line, call.column), _advice(source))


def _advice(source: PlanSource) -> Text | None:
    """How to update a plan that an earlier version compiled; None for a plan written by hand."""
    if source.header is None:
        return None
    again = calling("compile", Path(source.header.recipe), output=source.path)
    return Text("an earlier version compiled this plan: compile it again, ", again)
