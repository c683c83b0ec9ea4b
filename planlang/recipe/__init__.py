"""Recipes: their model, readers of the dialects they are written in, the order of their steps, checks, and fixes.

General layout: ``model`` holds the data classes of a recipe. ``readers`` extract ``statements`` from an ontology, one
reader for each dialect; ``actions`` knows the action classes, ``order`` answers questions about the order of steps.
``reading`` is the entry point: it finds the task, builds the model of it and of the recipes below it with the help of
``fillers``, and runs the ``checks``. ``fixes`` correct the text of the file.
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
