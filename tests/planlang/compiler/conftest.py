"""Reading plan sources back: which step may come before which, told from the source alone."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from small_recipes import HEAD

from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.expressions import without_digits
from planlang.designators import snake_case

Scope = dict[str, ast.AsyncFunctionDef | ast.expr]
"""What names stand for inside of a function."""


@dataclass
class Happening:
    """Steps and the pairs of them that a piece of plan puts in order."""

    steps: list[str] = field(default_factory=list)
    before: set[tuple[str, str]] = field(default_factory=set)

    def then(self, later: Happening) -> Happening:
        """Both, this one first."""
        across = {(a, b) for a in self.steps for b in later.steps}
        return Happening(self.steps + later.steps, self.before | later.before | across)


def _last(text: ast.expr) -> ast.expr:
    """The local name in ``RECIPE + "StirSoup"``."""
    return text.right if isinstance(text, ast.BinOp) else text


def _described(place: ast.expr) -> str:
    """The name that a place would have as a variable, of where it is described."""
    assert isinstance(place, ast.Call)
    return without_digits(snake_case(ast.literal_eval(place.args[0])))


class PlanReader:
    """Interprets the constructs that compiled plans are made of.

    With ``calls_are_steps`` what a called recipe does is not looked into.
    """

    def __init__(self, source: str, *, calls_are_steps: bool = False) -> None:
        self.calls_are_steps = calls_are_steps
        module = ast.parse(source)
        self.functions = {node.name: node for node in module.body if isinstance(node, ast.AsyncFunctionDef)}
        self.classes = {
            ast.unparse(node.targets[0]): ast.literal_eval(_last(node.value.args[0]))
            for node in module.body
            if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call)
            if ast.unparse(node.value.func) == "action_class"
        }

    def orders(self, name: str) -> Happening:
        """Return what a plan function does, with the functions that it calls."""
        return self._body(self.functions[name].body, {})

    def _body(self, statements: list[ast.stmt], scope: Scope) -> Happening:
        scope = dict(scope)
        done = Happening()
        for statement in statements:
            if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
                scope[statement.targets[0].id] = statement.value
            if isinstance(statement, ast.AsyncFunctionDef):
                scope[statement.name] = statement
            elif isinstance(statement, ast.AsyncWith):
                done = done.then(self._body(statement.body, scope))
            elif isinstance(statement, (ast.Expr, ast.Assign)) and isinstance(statement.value, ast.Await):
                call = statement.value.value
                assert isinstance(call, ast.Call)
                done = done.then(self._call(call.func, call.args, call.keywords, scope))
        return done

    def _branch(self, node: ast.expr, scope: Scope, name: str | None = None) -> Happening:
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            assert node.func.id == "partial"
            return self._call(node.args[0], node.args[1:], node.keywords, scope, name)
        return self._call(node, [], [], scope, name)

    def _call(
        self,
        function: ast.expr,
        arguments: list[ast.expr],
        keywords: list[ast.keyword],
        scope: Scope,
        name: str | None = None,
    ) -> Happening:
        assert isinstance(function, ast.Name)
        given = {keyword.arg: keyword.value for keyword in keywords}
        if function.id == "perform" and "otherwise" in given:
            recipe = given["otherwise"]
            return Happening([ast.unparse(recipe)]) if self.calls_are_steps else self._branch(recipe, scope)
        is_call = function.id in (*self.functions, "try_in_order")
        if self.calls_are_steps and is_call and function.id not in scope:
            return Happening([ast.unparse(arguments[-1] if arguments else function)])
        match function.id:
            case "perform":
                return Happening([self._named(arguments[0], given)])
            case "achieve":
                return self._branch(arguments[1], scope)
            case "with_failure_handling":
                return self._branch(arguments[0], scope)
            case "at_location":
                place = arguments[0]
                where = place.id if isinstance(place, ast.Name) else _described(place)
                return Happening([f"at {where}"]).then(self._branch(arguments[1], scope))
            case "par":
                named = {str(k.arg): self._branch(k.value, scope, k.arg) for k in keywords}
                return self._side_by_side(named, [])
            case "partial_order":
                steps, pairs = arguments
                assert isinstance(steps, ast.Dict)
                keys = [ast.literal_eval(key) for key in steps.keys if key is not None]
                branches = {key: self._branch(value, scope, key) for key, value in zip(keys, steps.values, strict=True)}
                return self._side_by_side(branches, ast.literal_eval(pairs))
            case called:
                known = scope.get(called) or self.functions[called]
                if isinstance(known, ast.expr):
                    return self._branch(known, scope)
                return self._body(known.body, scope if called in scope else {})

    def _named(self, described: ast.expr, given: dict[str | None, ast.expr]) -> str:
        """The name of a step: its own, or else its class's."""
        if "name" in given:
            return str(ast.literal_eval(given["name"]))
        assert isinstance(described, ast.Call)
        cls = described.args[0]
        return str(self.classes[cls.id] if isinstance(cls, ast.Name) else ast.literal_eval(_last(cls)))

    @staticmethod
    def _side_by_side(branches: dict[str, Happening], pairs: list[tuple[str, str]]) -> Happening:
        steps = [step for branch in branches.values() for step in branch.steps]
        before = {pair for branch in branches.values() for pair in branch.before}
        before |= {(a, b) for first, second in pairs for a in branches[first].steps for b in branches[second].steps}
        while more := {(a, d) for a, b in before for c, d in before if b == c} - before:
            before |= more
        return Happening(steps, before)


@pytest.fixture
def read_plan() -> type[PlanReader]:
    """Reads a plan's source back."""
    return PlanReader


@pytest.fixture
def compiled(tmp_path: Path) -> Any:
    """Compiles a recipe given as its parts."""

    def compile_text(*parts: str, **options: Any) -> CompiledPlan:
        path = tmp_path / "test.omn"
        path.write_text("\n".join((HEAD, *parts)), encoding="utf-8")
        return compile_recipe(path, **options)

    return compile_text
