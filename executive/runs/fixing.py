"""Fixes of recipes, validated by rehearsals of their plans."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from executive.runs.files import RecipeFile
from planlang.recipe.fixes.fixing import Fixed, fix_recipe
from planlang.rehearsal import rehearse


def fixed(file: RecipeFile, *, task: str | None, folders: Sequence[Path], accepted: Sequence[str]) -> Fixed:
    """Fix a recipe by :func:`planlang.recipe.fixes.fixing.fix_recipe`. Raises BadInput if it cannot be read.

    Rehearsals use copies in another folder, so they also search the recipe's own folder for imports.
    """
    searched = (*file.folder, *folders)
    return fix_recipe(
        file.path,
        task=task,
        folders=folders,
        accepted=frozenset(accepted),
        rehearse=partial(rehearse, task=task, folders=searched),
        content=file.content,
    )
