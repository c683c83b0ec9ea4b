"""Import of plans as modules; their calls of the plan language are checked against its signatures."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import traceback
from collections.abc import Callable, Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeGuard

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.outputs import LONGEST, header
from planlang.shell import quoted


def import_plan(path: Path) -> ModuleType:
    """Import a plan's file. Raises BadInput, with lines, if that fails, or calls do not fit the plan language."""
    loader = _PlanLoader(f"planlang_run_{path.stem}", str(path))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as problem:
        message = f"the plan cannot be imported: {type(problem).__name__}: {problem}"
        span = Span(str(path), line_in(problem, path) or 1)
        own = isinstance(problem, ImportError) and (problem.name or "").partition(".")[0] == "planlang"
        advice = _advice(path) if own or isinstance(problem, TypeError) else None
        raise BadInput([error("X001", message, span, advice)]) from problem
    misfits = list(_misfits(module, path))
    if misfits:
        raise BadInput(misfits)
    return module


class _PlanLoader(SourceFileLoader):
    """Loads a plan from a file of any suffix, without writing bytecode beside it."""

    def set_data(self, path: Any, data: Any, *, _mode: int = 0o666) -> None:
        """Write no bytecode."""


def line_in(problem: BaseException, path: Path) -> int | None:
    """Line of a file that an exception passed last, or that a SyntaxError names."""
    lines = [frame.lineno for frame in traceback.extract_tb(problem.__traceback__) if frame.filename == str(path)]
    return lines[-1] if lines else getattr(problem, "lineno", None)


def _misfits(module: ModuleType, path: Path) -> Iterator[Diagnostic]:
    """Yield an error for each call of the plan language with arguments that do not fit the function."""
    tree = ast.parse(inspect.getsource(module))
    rebound = {node.arg if isinstance(node, ast.arg) else node.id for node in ast.walk(tree) if _binds(node)}
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name("partial"), args=[ast.Name(id=name), *given]):
                is_whole = False
            case ast.Call(func=ast.Name(id=name), args=given):
                is_whole = True
            case _:
                continue
        function = vars(module).get(name)
        named = [keyword.arg for keyword in node.keywords]
        is_open = None in named or any(isinstance(one, ast.Starred) for one in given)
        if is_open or name in rebound or not _is_of_the_language(function):
            continue
        try:
            signature = inspect.signature(function)
        except ValueError:
            continue  # exceptions without an own __init__ accept any arguments
        try:
            (signature.bind if is_whole else signature.bind_partial)(*given, **dict.fromkeys(filter(None, named)))
        except TypeError as problem:
            message = f"{name} has other parameters in this version of planlang: {problem}"
            yield error("X001", message, Span(str(path), node.lineno, node.col_offset + 1), _advice(path))


def _binds(node: ast.AST) -> TypeGuard[ast.arg | ast.Name]:
    """Check whether a node binds a name, which may then hide one of the plan language."""
    return isinstance(node, ast.arg) or (isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store))


def _is_of_the_language(function: object) -> TypeGuard[Callable[..., Any]]:
    return isinstance(function, FunctionType | type) and function.__module__.partition(".")[0] == "planlang"


def _advice(path: Path) -> str | None:
    """How to update a plan that an earlier version compiled; None for a plan written by hand."""
    with path.open(encoding="utf-8", errors="replace") as file:
        origin = header(file.read(LONGEST))
    if origin is None:
        return None
    command = f"planlang compile {quoted(Path(origin.recipe))} -o {quoted(path)}"
    return f"an earlier version compiled this plan: compile it again, {command}"
