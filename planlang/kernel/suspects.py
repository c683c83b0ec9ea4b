"""Which line made a coroutine: the calls in the source of a plan that nothing awaits.

A coroutine does not know who made it, and having the interpreter note it costs each of them a search in its maker's
table of lines, the longer the function the more. So the source is searched when a coroutine was dropped: for calls of
its function, under the names that the file has for it, that stand in no ``await`` and do not contradict its arguments.
"""

from __future__ import annotations

import ast
import functools
import inspect
import linecache
import os
import re
import sys
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from types import BuiltinFunctionType, CoroutineType, FunctionType, ModuleType
from typing import Any

from planlang.kernel.handed import CONSTANTS, Got, Handed

_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_SCOPES = (*_FUNCTIONS, ast.Lambda, ast.ClassDef, ast.Module)
_DISPLAYS = (ast.List, ast.Tuple, ast.Set, ast.Dict, ast.Starred)
_PASSING = (ast.NamedExpr, ast.BoolOp, ast.IfExp, *_DISPLAYS)
_USES = (ast.FormattedValue, ast.Compare, ast.BinOp, ast.UnaryOp, ast.Subscript, ast.Attribute)
_TESTS = (ast.If, ast.While, ast.IfExp, ast.Assert)
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_WITH = (ast.With, ast.AsyncWith)
_HEADERS = (ast.For, ast.AsyncFor, *_WITH)
_LETS_THROUGH = frozenset({"using", "shield", "task_suspended", "on_suspension"})
"""What is used as ``with`` and keeps no error from going on."""
_HANDLED = frozenset({"close", "send", "throw"})
_NO_FUNCTIONS = frozenset({*CONSTANTS, type, tuple, list, dict, BuiltinFunctionType, ModuleType})


@dataclass(frozen=True, slots=True)
class Suspect:
    """A call that nothing awaits. ``certain``: no code could await it later, for nothing keeps or reads it."""

    file: str
    line: int
    function: int
    """First line of the function that it stands in; 0 outside of functions."""
    statement: tuple[int, int]
    """First and last line of its statement; of one with a body, of what comes before the body."""
    wrong: str
    right: str
    certain: bool
    goes_on: bool
    """Its statement goes on with what may fail; then the coroutine is dropped in this line."""
    stored: bool
    """Its statement keeps it, and what it has kept before is dropped in this line."""
    catches: bool
    """Its function may go on after an error that has kept the coroutine from being awaited."""
    near: bool
    """Its file is one of those that the running code comes from."""

    @property
    def where(self) -> str:
        """File and line."""
        return f"{os.path.basename(self.file)}:{self.line}"

    def covers(self, file: str, line: int | None) -> bool:
        """Whether a line is one of its statement's; None: of code that stands in no line."""
        return file == self.file and line is not None and self.statement[0] <= line <= self.statement[1]


def suspects(
    coroutine: CoroutineType[Any, Any, Any], files: Mapping[str, Mapping[str, Any]], near: Set[str]
) -> list[Suspect]:
    """Calls that may have made the coroutine, in files given with the global names of each.

    Names that are not global are believed to be the function's in ``near`` files; elsewhere those of methods are.
    """
    method = "." in coroutine.__qualname__.rpartition("<locals>.")[2]
    called = _call_of(_aliases(coroutine))
    got = Got(coroutine)
    found = []
    for file, space in files.items():
        source = _source(file, linecache.getlines(file, dict(space)))
        if source.text.isascii() and not called.search(source.text):  # other letters may be spelt in several ways
            continue
        for function in source.called:
            believed = file in near or (method and "." in function)
            if _makes(function, coroutine, space, believed):
                judged = source.judged(function, file in near)
                made = _resolved(function, space)[1]
                found += [suspect for handed, suspect in judged if not got.contradicts(handed, made)]
    return found


def _aliases(coroutine: CoroutineType[Any, Any, Any]) -> set[str]:
    """Names under which modules know the function of the coroutine, or something that is called as it is."""
    names = {coroutine.__name__}
    for module in tuple(sys.modules.values()):
        for name, value in tuple(getattr(module, "__dict__", {}).items()):
            if name not in names and type(value) not in _NO_FUNCTIONS and _is_maker(value, coroutine):
                names.add(name)
    return names


def _call_of(names: Set[str]) -> re.Pattern[str]:
    """What is found wherever something of these names is called, and seldom elsewhere."""
    return re.compile(rf"(?:{'|'.join(map(re.escape, sorted(names)))})\b(?:[\s)\\]|#.*)*\(")


def _makes(function: str, coroutine: CoroutineType[Any, Any, Any], space: Mapping[str, Any], believed: bool) -> bool:
    """Whether calling what is written so may give the coroutine."""
    known, made = _resolved(function, space)
    if not known:
        return believed and function.rpartition(".")[2] == coroutine.__name__
    return _is_maker(made, coroutine)


def _is_maker(made: object, coroutine: CoroutineType[Any, Any, Any]) -> bool:
    """Whether calling it may give the coroutine."""
    if isinstance(made, FunctionType):
        made = inspect.unwrap(made) if "__wrapped__" in vars(made) else made
        return getattr(made, "__code__", None) is coroutine.cr_code
    named = getattr(made, "__name__", None) == coroutine.__name__
    return named and not isinstance(made, (BuiltinFunctionType, type))


def _resolved(function: str, space: Mapping[str, Any]) -> tuple[bool, Any]:
    around, _, name = function.rpartition(".")
    if around:
        known, module = _resolved(around, space)
        if not (known and isinstance(module, ModuleType)):
            return False, None
        space = vars(module)
    elif function != name:
        return False, None
    return name in space, space.get(name)


class _Tree:
    """A parsed file: who stands in what."""

    def __init__(self, module: ast.Module) -> None:
        self.calls: dict[str, list[ast.Call]] = {}
        """The calls of a function, by how it is written."""
        self.around: dict[ast.AST, ast.AST] = {}
        for node in ast.walk(module):
            if isinstance(node, ast.Call):
                self.calls.setdefault(_name(node.func), []).append(node)
            for child in ast.iter_child_nodes(node):
                self.around[child] = node

    def judged(self, call: ast.Call, file: str, lines: list[str], near: bool) -> Suspect | None:
        """What may become of the coroutine that the call gives; None if it is awaited or its own methods are called."""
        name: str | None = None
        node: ast.AST = call
        outer = self.around[call]
        while isinstance(outer, _PASSING) and not (isinstance(outer, ast.IfExp) and node is outer.test):
            name = outer.target.id if isinstance(outer, ast.NamedExpr) else name
            node, outer = outer, self.around[outer]
        if isinstance(outer, ast.Await) or (isinstance(outer, ast.Attribute) and outer.attr in _HANDLED):
            return None
        certain = isinstance(outer, (ast.Expr, *_USES)) or (isinstance(outer, _TESTS) and node is outer.test)
        target = outer.targets[0] if isinstance(outer, ast.Assign) else getattr(outer, "target", None)
        if node is call and isinstance(outer, (ast.Assign, ast.AnnAssign)) and isinstance(target, ast.Name):
            certain, name = True, target.id
        certain = certain and (name is None or not self._read(name, call))
        wrong, right = self._shown(call, lines)
        statement = next(node for node in self._outward(call) if isinstance(node, ast.stmt))
        function = next((outer for outer in self._outward(call) if isinstance(outer, (*_FUNCTIONS, ast.Lambda))), None)
        decorators = getattr(function, "decorator_list", [])
        first = 0 if function is None else min([function.lineno, *(one.lineno for one in decorators)])
        return Suspect(
            file=file,
            line=call.lineno,
            function=first,
            statement=_span(statement, call),
            wrong=wrong,
            right=right,
            certain=certain,
            goes_on=self._goes_on(statement, call, certain),
            stored=isinstance(statement, (ast.Assign, ast.AnnAssign)),
            near=near,
            catches=function is not None and any(map(_catches, ast.walk(function))),
        )

    def _outward(self, node: ast.AST) -> Iterator[ast.AST]:
        while node in self.around:
            node = self.around[node]
            yield node

    def _read(self, name: str, call: ast.Call) -> bool:
        """Whether anything in the function around the call reads the name, or others may."""
        scope = next(outer for outer in self._outward(call) if isinstance(outer, _SCOPES))
        if not isinstance(scope, _FUNCTIONS):
            return True
        return any(
            (isinstance(node, ast.Name) and node.id == name and not isinstance(node.ctx, ast.Store))
            or (isinstance(node, (ast.Global, ast.Nonlocal)) and name in node.names)
            for node in ast.walk(scope)
        )

    def _goes_on(self, statement: ast.stmt, call: ast.Call, certain: bool) -> bool:
        """Whether the statement awaits something after the call, or calls something if the coroutine is kept for it."""
        if isinstance(getattr(statement, "body", None), list):
            return isinstance(statement, _HEADERS)
        around = set(self._outward(call))
        end = (call.end_lineno, call.end_col_offset)
        for node in ast.walk(statement):
            if node in around or not isinstance(node, ast.Await if certain else (ast.Await, ast.Call)):
                continue
            turned = any(isinstance(outer, _COMPREHENSIONS) and outer in around for outer in self._outward(node))
            if isinstance(node, ast.Await) if turned else (node.lineno, node.col_offset) >= end:
                return True
        return False

    def _shown(self, call: ast.Call, lines: list[str]) -> tuple[str, str]:
        """The line as it is, and with the ``await``."""
        line = lines[call.lineno - 1].rstrip()
        begin = len(line.encode()[: call.col_offset].decode(errors="replace"))
        name = ast.unparse(call.func)
        around = list(self._outward(call))
        inner = next((outer for outer in around if isinstance(outer, (*_SCOPES, ast.GeneratorExp))), None)
        generic = f"await {name}(...)"
        if isinstance(inner, ast.Lambda):
            return line.strip(), f"{generic}, or await what the lambda gives"
        if isinstance(inner, ast.FunctionDef) and any(outer in inner.body for outer in around):
            return line.strip(), f"{generic}    in async def {inner.name}, and await {inner.name}(...)"
        if isinstance(inner, ast.GeneratorExp):
            return line.strip(), f"{generic}    in a loop or in brackets: [await ... for ... in ...]"
        end = call.end_col_offset if call.end_lineno == call.lineno else None
        if isinstance(around[0], (ast.Attribute, ast.Subscript)) and around[0].value is call and end is not None:
            last = len(line.encode()[:end].decode(errors="replace"))
            return line.strip(), f"{line[:begin]}(await {line[begin:last]}){line[last:]}".strip()
        return line.strip(), f"{line[:begin]}await {line[begin:]}".strip()


def _span(statement: ast.stmt, call: ast.Call) -> tuple[int, int]:
    """First and last line of a statement; of one with a body, of the call."""
    node = call if isinstance(getattr(statement, "body", None), list) else statement
    return node.lineno, node.end_lineno or node.lineno


def _catches(node: ast.AST) -> bool:
    """Whether errors may end here."""
    if isinstance(node, _WITH):
        opened = [item.context_expr for item in node.items]
        return any(
            not isinstance(one, ast.Call) or _name(one.func).rpartition(".")[2] not in _LETS_THROUGH for one in opened
        )
    return isinstance(node, (ast.Try, ast.TryStar)) and bool(node.handlers)


def _name(function: ast.expr) -> str:
    """How a function is written; of one that is computed only what is known of it."""
    if isinstance(function, ast.Attribute):
        return f"{_name(function.value)}.{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


class _Source:
    """A file: what is called in it, and what may become of that. Its tree is not kept, others have to go through it."""

    def __init__(self, file: str, lines: list[str]) -> None:
        self.file = file
        self.lines = lines
        self.text = "".join(lines)
        self._judged: dict[tuple[str, bool], list[tuple[Handed, Suspect]]] = {}

    @functools.cached_property
    def called(self) -> tuple[str, ...]:
        """What is called, as it is written."""
        return tuple(_parsed(self.text).calls)

    def judged(self, function: str, near: bool) -> list[tuple[Handed, Suspect]]:
        """The calls of it that nothing awaits, with what they hand over."""
        if (function, near) not in self._judged:
            tree = _parsed(self.text)
            found = [(call, tree.judged(call, self.file, self.lines, near)) for call in tree.calls[function]]
            self._judged[function, near] = [(Handed.by(call), one) for call, one in found if one is not None]
        return self._judged[function, near]


_sources: dict[str, _Source] = {}


def _source(file: str, lines: list[str]) -> _Source:
    """A file, anew when it is read anew."""
    known = _sources.get(file)
    if known is None or known.lines is not lines:
        known = _sources[file] = _Source(file, lines)
    return known


@functools.lru_cache(maxsize=8)
def _parsed(text: str) -> _Tree:
    """The tree of a text."""
    try:
        return _Tree(ast.parse(text))
    except (SyntaxError, ValueError, RecursionError):  # what runs is no longer what the file says
        return _Tree(ast.Module([], []))
