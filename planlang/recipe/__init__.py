"""Recipes: their model, readers of the dialects they are written in, checks, and their dependency graph.

General layout: ``model`` is what a recipe says. ``readers`` get ``statements`` from an ontology, one reader for each
dialect; ``reading``, ``fillings`` and ``terms`` make the model of them, ``tasks`` finds the task and what is below it,
``dialects`` tells parts that no task holds together. ``repairs`` mends what is safe to mend; ``check_*`` and ``wise``
judge; ``graph`` and ``intervals`` answer questions about orders; ``actions`` and ``tables`` know the action classes.
"""

from planlang.recipe.actions import Actions
from planlang.recipe.model import (
    Allen,
    Description,
    End,
    Ending,
    Flow,
    Kind,
    Name,
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
from planlang.recipe.reading import Reading, read_recipe
from planlang.recipe.tasks import choose_task, stated_tasks, top_tasks

__all__ = [
    "Actions",
    "Allen",
    "Description",
    "End",
    "Ending",
    "Flow",
    "Kind",
    "Name",
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
    "choose_task",
    "read_recipe",
    "stated_tasks",
    "top_tasks",
]
