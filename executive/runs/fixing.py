"""Fixes of recipes, judged by rehearsals of their plans."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from planlang.recipe.fixes.fixing import Fixed, fix_recipe
from planlang.testing.rehearsal import rehearse


def fixed(path: Path, *, task: str | None, folders: Sequence[Path], accepted: Sequence[str]) -> Fixed:
    """Fix a recipe as :func:`planlang.recipe.fixes.fixing.fix_recipe` does; raises BadInput if it cannot be read.

    Imports are also looked for beside the recipe itself, as copies of it are rehearsed elsewhere.
    """
    around = (path.parent, *folders)
    return fix_recipe(
        path,
        task=task,
        folders=folders,
        accepted=frozenset(accepted),
        rehearse=partial(rehearse, task=task, folders=around),
    )
