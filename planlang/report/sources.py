"""The texts of plan and recipe, and the lines in them that a step comes from."""

from __future__ import annotations

import ast
import functools
import inspect
import linecache
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field

from planlang.designators import local_name
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.records import dataclass
from planlang.report.tree import names

LONGEST = 200_000
"""Characters of a text that a page has; a longer one is cut at a line."""


@dataclass(frozen=True, slots=True)
class Source:
    """A file of the run: its name without folders, its text, and the line of each class of actions (local name)."""

    name: str
    text: str
    lines: Mapping[str, int]
    places: Mapping[str, Sequence[int]] = field(default_factory=dict)
    """Of a plan: the lines at which each of its functions names ``at_location``, in their order."""


def plan_source(name: str, text: str) -> Source:
    """Return a plan with the lines of its actions, ``action(RECIPE + "GraspBottle", ...)``, and of its functions.

    A class that is performed at several lines has the first, as a trace does not say at which it was.
    """
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError):
        return Source(name, cut(text), {})
    lines: dict[str, int] = {}
    for _, number, cls in sorted(_named(tree)):
        lines.setdefault(cls, number)
    places = {
        function.name: sorted(
            node.lineno for node in ast.walk(function) if isinstance(node, ast.Name) and node.id == "at_location"
        )
        for function in ast.walk(tree)
        if isinstance(function, ast.AsyncFunctionDef)
    }
    return Source(name, cut(text), lines, {function: found for function, found in places.items() if found})


def source_of(function: object) -> Source | None:
    """Return the file that a plan function comes from, which need not be on a disk; None if there is no text of it."""
    while isinstance(function, functools.partial):
        function = function.func
    code = getattr(inspect.unwrap(function), "__code__", None) if callable(function) else None
    text = "".join(linecache.getlines(code.co_filename)) if code is not None else ""
    return plan_source(names([code.co_filename])[0], text) if code is not None and text else None


def cut(text: str) -> str:
    """Return a text up to the last line that fits."""
    return text if len(text) <= LONGEST else text[: text.rfind("\n", 0, LONGEST) + 1] + "...\n"


def _named(tree: ast.Module) -> Iterator[tuple[bool, int, str]]:
    """Yield the lines where classes of actions are named, and whether that only declares them.

    A constant of the module stands for its value.
    """
    constants = {
        target.id: one.value
        for one in tree.body
        if isinstance(one, ast.Assign)
        for target in one.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id="action" | "action_class" | "plan" as called), args=[first, *_]):
                value = constants.get(first.id, first) if isinstance(first, ast.Name) else first
                strings = [one.value for one in ast.walk(value) if isinstance(one, ast.Constant)]
                if strings and isinstance(strings[-1], str):
                    yield called == "action_class", node.lineno, local_name(strings[-1])
            case ast.AsyncFunctionDef():
                yield False, node.lineno, node.name


def recipe_source(recipes: RecipeSet, name: str, text: str) -> Source:
    """Return a recipe with the lines of its tasks and steps, as far as they are in that file."""
    lines: dict[str, int] = {}
    for one in _described(recipes):
        if one.span is not None and names([one.span.file]) == names([recipes.source.file]):
            lines.setdefault(local_name(one.iri), one.span.line)
    return Source(name, cut(text), lines)


def labels_of(recipes: RecipeSet) -> dict[str, str]:
    """Return the recipe's words for its tasks and steps, by the local names of their classes."""
    labels: dict[str, str] = {}
    for one in _described(recipes):
        if one.label:
            labels.setdefault(local_name(one.iri), one.label)
    return labels


def _described(recipes: RecipeSet) -> Iterator[Recipe | Step]:
    for recipe in recipes.recipes.values():
        yield recipe
        yield from recipe.steps
