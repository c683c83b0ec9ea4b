"""The texts of plan and recipe, and the lines in them that a step comes from."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping

from planlang.designators import local_name
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.records import dataclass

LONGEST = 200_000
"""Characters of a text that a page has; a longer one is cut at a line."""


@dataclass(frozen=True, slots=True)
class Source:
    """A file of the run: its name without folders, its text, and the line of each class of actions (local name)."""

    name: str
    text: str
    lines: Mapping[str, int]


def plan_source(name: str, text: str) -> Source:
    """Return a plan with the lines of its actions, ``action(RECIPE + "GraspBottle", ...)``, and of its functions.

    A class that is performed at several lines has the first, as a trace does not say at which it was.
    """
    lines: dict[str, int] = {}
    for number, cls in _named(text):
        lines.setdefault(cls, number)
    return Source(name, cut(text), lines)


def cut(text: str) -> str:
    """Return a text up to the last line that fits."""
    return text if len(text) <= LONGEST else text[: text.rfind("\n", 0, LONGEST) + 1] + "...\n"


def _named(text: str) -> Iterator[tuple[int, str]]:
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError):
        return
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id="action" | "plan"), args=[first, *_]):
                strings = [one.value for one in ast.walk(first) if isinstance(one, ast.Constant)]
                if strings and isinstance(strings[-1], str):
                    yield node.lineno, local_name(strings[-1])
            case ast.AsyncFunctionDef():
                yield node.lineno, node.name


def recipe_source(recipes: RecipeSet, name: str, text: str) -> Source:
    """Return a recipe with the lines of its tasks and steps, as far as they are in that file."""
    lines: dict[str, int] = {}
    for one in _described(recipes):
        if one.span is not None and one.span.file == recipes.source.file:
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
