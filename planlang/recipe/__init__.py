"""Recipes: their model, readers of the dialects they are written in, the order of their steps, checks, and fixes.

General layout: ``model`` is what a recipe says. ``readers`` get ``statements`` from an ontology, one reader for each
dialect; ``actions`` knows the action classes, ``order`` answers questions about orders. ``reading`` is the way in: it
finds the task, makes the model of it and of what is below it, with ``fillers``, and judges it by the ``checks``;
``fixes`` mend its text.
"""

from planlang.recipe.actions import Actions
from planlang.recipe.model import (
    Allen,
    Ending,
    Flow,
    Kind,
    Ordering,
    Overlap,
    Parameter,
    Place,
    Reason,
    Recipe,
    RecipeSet,
    Source,
    StateMachine,
    Step,
    Thing,
    Transition,
)
from planlang.recipe.reading import Reading, read_recipe, stated_tasks, top_tasks

__all__ = [
    "Actions",
    "Allen",
    "Ending",
    "Flow",
    "Kind",
    "Ordering",
    "Overlap",
    "Parameter",
    "Place",
    "Reading",
    "Reason",
    "Recipe",
    "RecipeSet",
    "Source",
    "StateMachine",
    "Step",
    "Thing",
    "Transition",
    "read_recipe",
    "stated_tasks",
    "top_tasks",
]
