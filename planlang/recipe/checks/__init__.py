"""Checks of recipes: each is one function, declared with the codes that it may report and those that suppress it.

General layout: one file for each subject. ``misspellings`` judges names, ``steps`` also states, ``orderings``
what is ordered and what is not, ``parameters`` what fills properties, and mends what is safe to mend, ``slots`` whether
that is of the right kind, ``losses`` statements that reach no recipe. A check of a whole file takes a
:class:`CheckedFile`, one of a single recipe a :class:`CheckedRecipe`; :mod:`planlang.recipe.reading` lists and runs
them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Generic, ParamSpec, TypeVar

from planlang.designators import local_name
from planlang.ontology import Ontology
from planlang.recipe.actions import Actions
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.recipe.order import added_by_scopes
from planlang.recipe.statements import Statements
from planlang.records import dataclass

MOST_NAMES = 5
"""Names that one message lists: as many fit on two lines of a terminal."""

_Asked = ParamSpec("_Asked")
_T_co = TypeVar("_T_co", covariant=True)


@dataclass(frozen=True, slots=True)
class Check(Generic[_Asked, _T_co]):
    """A function that judges something: it may report ``codes``, and is left out where one of ``unless`` was reported.

    ``unless`` are the codes of mistakes of which whatever the check would report is, or may be, a mere consequence.
    """

    function: Callable[_Asked, _T_co]
    codes: tuple[str, ...]
    unless: frozenset[str]

    def __call__(self, *args: _Asked.args, **kwargs: _Asked.kwargs) -> _T_co:
        """Judge."""
        return self.function(*args, **kwargs)

    def applies(self, reported: Collection[str]) -> bool:
        """Return True if none of the codes that were reported before suppresses the check."""
        return self.unless.isdisjoint(reported)


def check(*codes: str, unless: Collection[str] = ()) -> Callable[[Callable[_Asked, _T_co]], Check[_Asked, _T_co]]:
    """Declare a function as a check. Each code is reported by one check only."""
    return lambda function: Check(function, codes, frozenset(unless))


def listing(names: Sequence[str]) -> str:
    """Return the local names of IRIs as a list in a message; of many the first, and the number of the others."""
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(f"`{local_name(name)}`" for name in names[:MOST_NAMES]) + more


@dataclass(frozen=True)
class CheckedFile:
    """A file to judge: its action classes, the chosen task with the recipes below it, and options of the reading."""

    actions: Actions
    recipes: RecipeSet
    scopes: bool = True

    @property
    def ontology(self) -> Ontology:
        """The ontology that the file is the main document of."""
        return self.actions.ontology


@dataclass(frozen=True)
class CheckedRecipe:
    """A recipe to judge: ``statements`` as the file states it, ``recipe`` as it was read from these."""

    file: CheckedFile
    recipe: Recipe
    statements: Statements

    @property
    def actions(self) -> Actions:
        """The action classes of the file."""
        return self.file.actions

    @property
    def ontology(self) -> Ontology:
        """The ontology that the file is the main document of."""
        return self.file.ontology

    @property
    def owners(self) -> tuple[Recipe | Step, ...]:
        """All that has parameters, the task itself and its steps, with those that they state themselves."""
        return (_stating(self.recipe), *map(_stating, self.recipe.steps))

    @cached_property
    def added(self) -> tuple[tuple[str, str], ...]:
        """The orders of steps (IRIs) that location scopes add; the stated orders must have no cycle."""
        if not self.file.scopes:
            return ()
        return added_by_scopes(self.actions, self.recipe, self.file.recipes)


_Owner = TypeVar("_Owner", Recipe, Step)


def _stating(owner: _Owner) -> _Owner:
    """Return a task or step without what it inherits."""
    if not any(one.is_inherited for one in owner.parameters):
        return owner
    return replace(owner, parameters=tuple(one for one in owner.parameters if not one.is_inherited))
