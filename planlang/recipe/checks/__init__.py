"""Checks of recipes: each is one function, declared with the codes that it may report and those that suppress it.

General layout: one file per subject. ``misspellings`` checks names, ``steps`` sub-actions and states, ``orderings`` the
order of steps, ``parameters`` the fillers of properties, with repairs that are unambiguous, ``slots`` the kinds of
fillers, ``losses`` statements that belong to no recipe. A check of a whole file takes a :class:`CheckedFile`, one of a
single recipe a :class:`CheckedRecipe`; :mod:`planlang.recipe.reading` lists and runs them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Generic, ParamSpec, TypeVar

from planlang.designators import local_name
from planlang.ontology import Ontology, expand, shorten
from planlang.recipe.actions import Actions, recipes_for
from planlang.recipe.guesses import Known, without_number
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.recipe.readers import created_individuals
from planlang.recipe.scopes import added_by_scopes
from planlang.recipe.statements import Statements
from planlang.records import dataclass
from planlang.spelling import Spellings

MOST_NAMES = 5
"""Maximum number of names in one message: they fit on two lines of a terminal."""

_Args = ParamSpec("_Args")
_T_co = TypeVar("_T_co", covariant=True)


@dataclass(frozen=True, slots=True)
class Check(Generic[_Args, _T_co]):
    """A function that may report ``codes``, and is skipped if any code of ``unless`` was reported.

    ``unless`` are codes of mistakes that would make this check report mere consequences of them.
    """

    function: Callable[_Args, _T_co]
    codes: tuple[str, ...]
    unless: frozenset[str]

    def __call__(self, *args: _Args.args, **kwargs: _Args.kwargs) -> _T_co:
        """Run the check."""
        return self.function(*args, **kwargs)

    def applies(self, reported: Collection[str]) -> bool:
        """True if none of the codes reported so far suppresses the check."""
        return self.unless.isdisjoint(reported)


def check(*codes: str, unless: Collection[str] = ()) -> Callable[[Callable[_Args, _T_co]], Check[_Args, _T_co]]:
    """Declare a function as a check. Each code belongs to exactly one check."""
    return lambda function: Check(function, codes, frozenset(unless))


def listing(names: Sequence[str]) -> str:
    """Format the local names of IRIs for a message; beyond :data:`MOST_NAMES` only their number is given."""
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(f"`{local_name(name)}`" for name in names[:MOST_NAMES]) + more


@dataclass(frozen=True)
class CheckedFile:
    """A file to check: its action classes, the chosen task with the recipes below it, and reading options."""

    actions: Actions
    recipes: RecipeSet
    scopes: bool = True

    @property
    def ontology(self) -> Ontology:
        """Ontology whose main document is the file."""
        return self.actions.ontology

    @cached_property
    def performed(self) -> Known:
        """Performed classes to suggest: of the vocabulary, and those that a primitive or the library performs, but no
        steps of the file's own recipes.
        """
        actions, own = self.actions, self.recipes.recipes
        others = (one for one in self.ontology.subclasses(expand("Action")) if one not in own)
        public = (one for one in others if shorten(one) != one or one in actions.primitives or one in actions.library)
        return Known((one for one in public if any(recipes_for(actions, one))), without_number)

    @cached_property
    def modules(self) -> Spellings:
        """Classes (IRIs, or local names of the vocabulary) that process modules outside the ontology perform."""
        return Spellings(sorted(self.actions.performed()))


@dataclass(frozen=True)
class CheckedRecipe:
    """A recipe to check: ``statements`` as the file states it, ``recipe`` as read from them."""

    file: CheckedFile
    recipe: Recipe
    statements: Statements

    @property
    def actions(self) -> Actions:
        """Action classes of the file."""
        return self.file.actions

    @property
    def ontology(self) -> Ontology:
        """Ontology whose main document is the file."""
        return self.file.ontology

    @property
    def owners(self) -> tuple[Recipe | Step, ...]:
        """The task and its steps, each with the parameters that it states itself."""
        return (_stating(self.recipe), *map(_stating, self.recipe.steps))

    @cached_property
    def created(self) -> frozenset[str]:
        """Individuals (IRIs) that sub-actions create, which need not be defined elsewhere."""
        return created_individuals(self.ontology, self.statements)

    @cached_property
    def added(self) -> tuple[tuple[str, str], ...]:
        """Orders of steps (IRIs) that location scopes add; the stated orders must be acyclic."""
        if not self.file.scopes:
            return ()
        return added_by_scopes(self.actions, self.recipe, self.file.recipes)


_Owner = TypeVar("_Owner", Recipe, Step)


def _stating(owner: _Owner) -> _Owner:
    """Copy of a task or step without inherited parameters."""
    if not any(one.is_inherited for one in owner.parameters):
        return owner
    return replace(owner, parameters=tuple(one for one in owner.parameters if not one.is_inherited))
