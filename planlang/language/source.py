"""The text of a plan, and all that planlang reads in it: the only reader of plans as Python. Nothing is executed.

Constructs go by their names in planlang, whatever the plan calls them: after ``import planlang as p`` and
``from planlang import action as act``, ``p.action(...)`` and ``act(...)`` are actions.
"""

from __future__ import annotations

import ast
import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

from planlang.action_classes import nearest_unstated
from planlang.designators import action_class, local_name
from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.language.branches import Branch
from planlang.language.plan_text import (
    DESCRIPTIONS,
    Alternative,
    CallText,
    FunctionText,
    Keyword,
    Needs,
    Performs,
    Step,
)
from planlang.language.plans import Plan
from planlang.outputs import LARGEST_PLAN, PlanHeader, header

NAMES = ast.Name | ast.Attribute | ast.expr_context
OPERATIONS = ast.BinOp | ast.operator | ast.UnaryOp | ast.unaryop
DESCRIBING = NAMES | OPERATIONS | ast.Call | ast.keyword | ast.Constant | ast.Tuple | ast.List
"""Nodes of expressions that describe something."""
Scope = Mapping[str, ast.AST]
"""Definitions in the source, by name."""


class PlanSource:
    """Text of a plan with the name of its file; all else is read once, when it is first asked for.

    ``content`` are the bytes of the file; without them the text is in memory only, as that of a compiled plan. To read
    a text that is no Python raises BadInput (C002). Nodes of the syntax tree stay in this file.
    """

    def __init__(self, text: str, file: str, content: bytes | None = None) -> None:
        self.text, self.file = text, file
        self.is_in_memory = content is None
        self.content = text.encode() if content is None else content

    @classmethod
    def read(cls, path: Path) -> PlanSource:
        """Read a file, as UTF-8; when it is executed, Python goes by its own rules. Raises BadInput (C001)."""
        content = read_file(path, largest=LARGEST_PLAN)
        return cls(content.decode("utf-8-sig", errors="replace"), str(path), content)

    @property
    def path(self) -> Path:
        """File of the plan; of a text in memory, only the name means something."""
        return Path(self.file)

    @property
    def sha256(self) -> str:
        """Digest of the file, or of the text in UTF-8."""
        return hashlib.sha256(self.content).hexdigest()

    @cached_property
    def header(self) -> PlanHeader | None:
        """Origin of a compiled plan; None for a plan written by hand."""
        return header(self.text)

    @cached_property
    def _tree(self) -> ast.Module:
        try:
            return ast.parse(self.text, self.file)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as problem:
            line = getattr(problem, "lineno", None) or 1
            column = getattr(problem, "offset", None) or 1
            message = f"neither a recipe nor a plan: {getattr(problem, 'msg', None) or problem}"
            advice = "a plan is Python source; a recipe starts with an XML declaration, Prefix: or Ontology:"
            raise BadInput([error("C002", message, Span(self.file, line, column), advice)]) from None

    @cached_property
    def _nodes(self) -> tuple[ast.AST, ...]:
        return tuple(ast.walk(self._tree))

    @cached_property
    def _calls(self) -> tuple[ast.Call, ...]:
        """All calls, those with less around them first."""
        return tuple(node for node in self._nodes if isinstance(node, ast.Call))

    @property
    def imports_planlang(self) -> bool:
        """True if the file imports planlang, or something of it, outside of functions."""
        body = self._tree.body
        names = [alias.name for one in body if isinstance(one, ast.Import) for alias in one.names]
        names += [one.module or "" for one in body if isinstance(one, ast.ImportFrom)]
        return "planlang" in [name.partition(".")[0] for name in names]

    @cached_property
    def calls(self) -> tuple[CallText, ...]:
        """All calls; inner ones come later."""
        bound = {node.id for node in self._nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
        bound.update(node.arg for node in self._nodes if isinstance(node, ast.arg))
        found: list[CallText] = []
        for call in self._calls:
            function, given, first = call.func, call.args, next(iter(call.args), None)
            if is_partial := isinstance(function, ast.Name) and function.id == "partial" and bool(given):
                function, *given = given
            keywords = tuple(Keyword(one.arg, *_place(one)) for one in call.keywords)
            is_open = any(isinstance(one, ast.Starred) for one in given) or None in [one.name for one in keywords]
            found.append(
                CallText(
                    self._called(call),
                    *_place(call),
                    keywords,
                    written=function.id if isinstance(function, ast.Name) and function.id not in bound else None,
                    is_partial=is_partial,
                    given=None if is_open else len(given),
                    cls=self._class_name(first, self._constants) if first is not None else None,
                    literal=first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else None,
                )
            )
        return tuple(found)

    @property
    def actions(self) -> tuple[CallText, ...]:
        """Descriptions of actions, among :attr:`calls`."""
        return tuple(one for one in self.calls if one.function == "action")

    @cached_property
    def functions(self) -> tuple[FunctionText, ...]:
        """All async functions; those at the top of the file come first, in order."""
        return tuple(
            FunctionText(
                one.name,
                one.lineno,
                self._plans.get(one.name) is one,
                tuple(each.arg for each in (*one.args.args, *one.args.kwonlyargs)),
                (ast.get_docstring(one) or "").partition("\n")[0],
                tuple(sorted(_place(node)[0] for node in ast.walk(one) if self._is_location(node))),
            )
            for one in self._nodes
            if isinstance(one, ast.AsyncFunctionDef)
        )

    @cached_property
    def drives(self) -> Mapping[int, str]:
        """Lines that name ``at_location`` in a call with a base motion (``by=``) -> local name of its class."""
        return {
            one.lineno: cls
            for call in self._calls
            for one in (call.func, *call.args[:1])
            if self._is_location(one)
            for keyword in call.keywords
            if keyword.arg == "by" and (cls := self._class_name(keyword.value, self._constants)) is not None
        }

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """Steps of the plans of the file, plan after plan, each in the order of the text."""
        return tuple(step for function in self._plans.values() for step in self._steps(function))

    def behind(self, step: Step) -> tuple[Step, ...]:
        """Steps that remain behind a step of a plan, each call followed by the steps of the called plan.

        The order is that of the text: of branches that run at once, the first counts as the earlier. A plan is entered
        once, so that one that calls itself ends.
        """
        entered = {step.function}

        def within(function: str, after: tuple[int, int]) -> Iterator[Step]:
            for one in self.steps:
                if one.function == function and (one.line, one.column) > after:
                    yield one
                    if one.is_call and one.what not in entered:
                        entered.add(one.what)
                        yield from within(one.what, (0, 0))

        return tuple(within(step.function, (step.line, step.column)))

    @cached_property
    def outputs(self) -> frozenset[str]:
        """Names of what the actions create (``outputs_created``): it need not exist before."""
        nodes = (node for value in self._arguments("outputs_created") for node in ast.walk(value))
        return frozenset(node.id for node in nodes if isinstance(node, ast.Name))

    @cached_property
    def waiting(self) -> float:
        """Sum of the durations of actions that are given as numbers [s]."""
        stated = (one.value for one in self._arguments("duration") if isinstance(one, ast.Constant))
        return sum(float(value) for value in stated if isinstance(value, int | float) and 0 <= value < math.inf)

    def needs(self, module: ModuleType, plan: Plan[Any, Any]) -> Needs:
        """What a plan needs, including the functions that it calls; ``module`` is the loaded plan, with its values."""
        with self._refusing():
            return _Reading(self, module).needs(plan.name)

    def read_names(self, module: ModuleType, plan: Plan[Any, Any], performs: Performs) -> frozenset[str]:
        """Names that a plan reads, except in plans that process modules replace."""
        with self._refusing():
            return _Reading(self, module).read(plan.name, performs)

    @contextmanager
    def _refusing(self) -> Iterator[None]:
        """Refuse what is nested so deeply that Python can parse it, but not walk through it."""
        try:
            yield
        except RecursionError:
            advice = "split long expressions: assign their parts to names"
            raise BadInput([error("C002", "this plan is nested too deeply", Span(self.file), advice)]) from None

    def _arguments(self, name: str) -> Iterator[ast.expr]:
        """Yield what calls pass by a name."""
        return (keyword.value for call in self._calls for keyword in call.keywords if keyword.arg == name)

    @cached_property
    def _plans(self) -> Mapping[str, ast.AsyncFunctionDef]:
        """Plan functions at the top of the file, by name."""
        return {
            one.name: one
            for one in self._tree.body
            if isinstance(one, ast.AsyncFunctionDef) and "plan" in map(self._called, one.decorator_list)
        }

    def _steps(self, function: ast.AsyncFunctionDef) -> list[Step]:
        nodes = list(ast.walk(function))
        assignments = (one for one in nodes if isinstance(one, ast.Assign))
        assigned = {
            target.id: one.value for one in assignments for target in one.targets if isinstance(target, ast.Name)
        }

        def meant(node: ast.expr) -> ast.expr:
            return assigned.get(node.id, node) if isinstance(node, ast.Name) else node

        calls = [one for one in nodes if isinstance(one, ast.Call)]
        given = [(meant(passed), keyword) for one in calls for keyword in one.keywords for passed in one.args]
        names = {
            passed: str(keyword.value.value)
            for passed, keyword in given
            if keyword.arg == "name" and isinstance(keyword.value, ast.Constant)
        }
        recoveries = {passed: meant(keyword.value) for passed, keyword in given if keyword.arg == "recoveries"}
        described = {name: text for name, one in assigned.items() if (text := self._described(one)) is not None}
        bound = {one.args[0]: one for one in calls if one.args and self.name(one.func) == "partial"}
        bound |= {one.func: ast.Call(ast.Name("partial"), [one.func, *one.args], one.keywords) for one in calls}
        steps: list[Step] = []
        for node in nodes:
            if isinstance(node, ast.Name) and node.id in self._plans:  # called, or passed on: partial(right, BOTTLE)
                text = self._described(bound.get(node, node))
                steps.append(Step(function.name, *_place(node), node.id, True, described=text, names=described))
            elif isinstance(node, ast.Call) and self.name(node.func) == "action" and node.args:
                what = self._class_name(node.args[0], self._constants) or ast.unparse(node.args[0])
                stated = recoveries.get(node)
                listed = stated.elts if isinstance(stated, ast.List | ast.Tuple) else [stated] if stated else []
                written = tuple(map(ast.unparse, listed))
                own = Step(function.name, *_place(node), what, False, names.get(node), written)
                steps.append(replace(own, described=self._described(node), names=described))
        return sorted(steps, key=lambda one: (one.line, one.column))

    def _described(self, node: ast.expr) -> str | None:
        """Text of an expression that describes something and does nothing; None for others."""
        if not all(isinstance(one, DESCRIBING) for one in ast.walk(node)):
            return None
        calls = (self.name(one.func) for one in ast.walk(node) if isinstance(one, ast.Call))
        return ast.unparse(node) if all(one in DESCRIPTIONS for one in calls) else None

    # Names and values

    @cached_property
    def _originals(self) -> Mapping[str, str]:
        """Names under which the file imports something of planlang -> its name there."""
        return {
            alias.asname or alias.name: alias.name
            for node in self._nodes
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "planlang"
            for alias in node.names
        }

    def name(self, node: ast.AST) -> str | None:
        """Name in planlang of what an expression names."""
        match node:
            case ast.Name(id=name):
                return self._originals.get(name, name)
            case ast.Attribute(attr=name):
                return name
        return None

    def _called(self, node: ast.expr) -> str | None:
        return self.name(node.func if isinstance(node, ast.Call) else node)

    def _is_location(self, node: ast.AST) -> bool:
        return self.name(node) == "at_location"

    @cached_property
    def _constants(self) -> Mapping[str, str]:
        """What the file assigns to names, as far as it may be a class: its local name."""
        constants: dict[str, str] = {}
        for one in self._tree.body:
            if isinstance(one, ast.Assign) and (value := self._class_name(one.value, constants)) is not None:
                constants.update((target.id, value) for target in one.targets if isinstance(target, ast.Name))
        return constants

    def _class_name(self, node: ast.expr, constants: Mapping[str, str]) -> str | None:
        """Local name of the class that an expression names: of a sum or an f-string, the end says it."""
        while True:
            match node:
                case ast.Constant(value=str(text)):
                    return local_name(text)
                case ast.Name(id=name):
                    return constants.get(name)
                case ast.BinOp(right=last) | ast.JoinedStr(values=[*_, last]):
                    node = last
                case ast.Call(args=[first, *_]) if self._called(node) == "action_class":
                    node = first
                case _:
                    return None


def _place(node: Any) -> tuple[int, int]:
    """Line and column of a node, both from 1."""
    return node.lineno, node.col_offset + 1


def _text(node: ast.expr | None, values: Mapping[str, Any]) -> str | None:
    """Value of a string expression: a literal, one of the values by its name, or a sum of these."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.Name(id=name) if isinstance(values.get(name), str):
            constant: str = values[name]  # may be an ActionClass
            return constant
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            parts = _text(left, values), _text(right, values)
            return parts[0] + parts[1] if parts[0] is not None and parts[1] is not None else None
    return None


class _Reading:
    """What the functions of a loaded plan need and read. Recursive definitions are analysed once."""

    def __init__(self, source: PlanSource, module: ModuleType) -> None:
        self._name, self._values = source.name, vars(module)
        self._top = _definitions(source._tree.body)
        self._known: dict[int, Needs] = {}
        self._read: dict[str, frozenset[str]] = {}

    def needs(self, name: str) -> Needs:
        """What a plan function needs; all functions of the module together if it is defined elsewhere."""
        nodes = [self._top[name]] if name in self._top else self._top.values()
        return _together(self._definition(node, self._top) for node in nodes)

    def _definition(self, node: ast.AST, scope: Scope) -> Needs:
        if id(node) not in self._known:
            self._known[id(node)] = Needs()  # the result inside of a recursion
            pieces: Iterable[ast.AST] = [node]
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                pieces = ast.iter_child_nodes(node)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                scope = {**scope, **_definitions(node.body)}
            self._known[id(node)] = _together(self._within(piece, scope) for piece in pieces)
        return self._known[id(node)]

    def _within(self, node: ast.AST, scope: Scope) -> Needs:
        """What a piece of source needs; local functions and values count where they are used."""
        needs: list[Needs]
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() if scope.get(node.name) is node:
                return Needs()
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if scope.get(name) is value:
                if not any(isinstance(inner, ast.Await) for inner in ast.walk(value)):
                    return Needs()
                needs = []
            case ast.Call(func=function, args=[first, *_]) if self._name(function) in ("action", "Action"):
                own = self._class(first, node.keywords)
                needs = [Needs(nearest_unstated(own), modular=(own,))] if own is not None else []
            case ast.Call(func=function, args=[described, *_]) if self._name(function) == "perform":
                return self._performed(described, node, scope)
            case ast.Call(args=[first, described, *_]) if self._name(first) == "perform":  # partial(perform, ...)
                return self._performed(described, node, scope)
            case ast.Call(func=function, args=branches) if self._name(function) == "try_in_order":
                return self._choice(branches, node, scope)
            case ast.Call(args=[first, *branches]) if self._name(first) == "try_in_order":  # partial(try_in_order, ...)
                return self._choice(branches, node, scope)
            case ast.Name() | ast.Attribute() if self._name(node) == "at_location":
                needs = [Needs(("Translation-LocationChange",))]
            case ast.Name(id=name, ctx=ast.Load()) if name in scope:
                definition = scope[name]
                needs = [self._definition(definition, self._top if self._top.get(name) is definition else scope)]
            case _:
                needs = []
        return _together([*needs, *(self._within(child, scope) for child in ast.iter_child_nodes(node))])

    def _performed(self, described: ast.expr, call: ast.Call, scope: Scope) -> Needs:
        """What a call of ``perform`` needs: a process module, unless ``otherwise`` gives a plan for the action."""
        others = [*call.args, *(keyword.value for keyword in call.keywords)]
        others.remove(described)
        own = self._within(described, scope)
        if any(keyword.arg == "otherwise" for keyword in call.keywords):
            own = replace(own, modular=())
        return _together([own, *(self._within(other, scope) for other in others)])

    def _choice(self, positional: list[ast.expr], call: ast.Call, scope: Scope) -> Needs:
        branches = [*positional, *(keyword.value for keyword in call.keywords if keyword.arg != "name")]
        if any(isinstance(branch, ast.Starred) for branch in branches):
            return _together(self._within(branch, scope) for branch in branches)
        return Needs(choices=(tuple(Alternative(_title(b), b.lineno, self._within(b, scope)) for b in branches),))

    def read(self, name: str, performs: Performs) -> frozenset[str]:
        """Names that a plan function reads, itself or as arguments of functions that read them."""
        if name not in self._read:
            whole = [self._top[name]] if name in self._top else self._top.values()
            self._read[name] = frozenset(
                one.id for node in whole for one in ast.walk(node) if isinstance(one, ast.Name)
            )  # the result inside of a recursion
            self._read[name] = frozenset(one for node in whole for one in self._names(node, performs))
        return self._read[name]

    def _names(self, node: ast.AST, performs: Performs) -> Iterator[str]:
        """Yield the names that a piece of source reads; see :meth:`read`."""
        if isinstance(node, ast.Name):
            yield node.id
        unread: set[str | None] = set()
        if isinstance(node, ast.Call):
            called = [one.id for one in (*node.args[:1], node.func) if isinstance(one, ast.Name)]
            known = next((self._top[one] for one in called if one in self._top), None)
            if isinstance(known, ast.AsyncFunctionDef):
                unread |= {one.arg for one in known.args.kwonlyargs} - self.read(known.name, performs)
            if self._is_performed(node, performs):
                unread |= {"otherwise", "recoveries"}
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, ast.keyword) or child.arg not in unread:
                yield from self._names(child, performs)

    def _is_performed(self, call: ast.Call, performs: Performs) -> bool:
        """Check whether a call performs an action by a process module rather than by its plan."""
        for described in call.args[:2]:
            match described:
                case ast.Call(func=function, args=[first, *_]) if self._name(function) in ("action", "Action"):
                    own = _text(first, self._values)
                    others = [keyword.value for keyword in call.keywords if keyword.arg == "otherwise"]
                    return own is not None and bool(others) and performs(own, self._plan(others[0]))
        return False

    def _plan(self, branch: ast.expr) -> Branch | None:
        """The plan of this module that a branch calls; None if it calls something else."""
        match branch:
            case ast.Call(args=[ast.Name(id=name), *_]) | ast.Name(id=name):
                plan = self._values.get(name)
                return plan if isinstance(plan, Plan) else None
        return None

    def _class(self, node: ast.expr, keywords: Iterable[ast.keyword]) -> str | None:
        """Class of a described action, with its superclasses if the source gives them."""
        own = _text(node, self._values)
        below = next((keyword.value for keyword in keywords if keyword.arg == "below"), None)
        listed = below.elts if isinstance(below, ast.Tuple | ast.List) else (below,)
        known = [
            one for each in listed if (one := _text(each, self._values))
        ]  # an empty one is refused when the plan runs
        return action_class(own, below=known) if own and known else own


def _title(branch: ast.expr) -> str:
    match branch:
        case ast.Call(func=ast.Name("partial") | ast.Attribute(attr="partial"), args=[function, *_]):
            return ast.unparse(function)
    return ast.unparse(branch)


def _definitions(body: list[ast.stmt]) -> dict[str, ast.AST]:
    """Functions, classes and values that a body defines, by name."""
    definitions: dict[str, ast.AST] = {}
    for node in body:
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                definitions[name] = node
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                definitions[name] = value
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                definitions[name] = value
    return definitions


def _together(needs: Iterable[Needs]) -> Needs:
    """Union of needs, with each action class and each choice once."""
    every = list(needs)
    return Needs(
        tuple(dict.fromkeys(one for each in every for one in each.actions)),
        tuple(dict.fromkeys(one for each in every for one in each.choices)),
        tuple(dict.fromkeys(one for each in every for one in each.modular)),
    )
