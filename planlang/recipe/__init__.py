"""Recipes: their model, readers of the dialects they are written in, the order of their steps, checks, and fixes.

General layout: ``model`` holds the data classes of a recipe. ``readers`` extract ``statements`` from an ontology, one
reader for each dialect; ``actions`` knows the action classes, ``order`` answers questions about the order of steps.
``reading`` is the entry point: it finds the task, builds the model of it and of the recipes below it with the help of
``fillers``, and runs the ``checks``. ``fixes`` correct the text of the file.
"""

from planlang.recipe.actions import Actions as Actions
from planlang.recipe.model import Allen as Allen
from planlang.recipe.model import Ending as Ending
from planlang.recipe.model import Flow as Flow
from planlang.recipe.model import Kind as Kind
from planlang.recipe.model import Ordering as Ordering
from planlang.recipe.model import Overlap as Overlap
from planlang.recipe.model import Parameter as Parameter
from planlang.recipe.model import Place as Place
from planlang.recipe.model import Reason as Reason
from planlang.recipe.model import Recipe as Recipe
from planlang.recipe.model import RecipeSet as RecipeSet
from planlang.recipe.model import Source as Source
from planlang.recipe.model import StateMachine as StateMachine
from planlang.recipe.model import Step as Step
from planlang.recipe.model import Thing as Thing
from planlang.recipe.model import Transition as Transition
from planlang.recipe.reading import Reading as Reading
from planlang.recipe.reading import read_recipe as read_recipe
from planlang.recipe.reading import stated_tasks as stated_tasks
from planlang.recipe.reading import top_tasks as top_tasks
