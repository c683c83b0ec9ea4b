"""Plans of recipes, for tests."""

from __future__ import annotations

import functools
import linecache
import os
from pathlib import Path
from types import ModuleType
from typing import Any

from planlang.language.plans import Plan
from planlang.resources import bundled


@functools.cache
def compiled(recipe: str | os.PathLike[str], task: str | None = None) -> Plan[..., Any]:
    """The plan of a recipe: of a file, or of a bundled recipe by name (``compiled("serve_a_drink")``).

    The plan's own names are in its module: ``plan.function.__globals__["BOTTLE"]``. Raises BadInput with the
    diagnostics when the recipe has errors.
    """
    from planlang.compiler import compile_recipe

    path = Path(recipe)
    if not path.suffix and not path.exists():
        path = bundled("recipes") / f"{path}.omn"
    plan = compile_recipe(path, task=task)
    name = plan.functions[-1]
    file = f"<plan of {path.name}>"
    linecache.cache[file] = (len(plan.source), None, plan.source.splitlines(keepends=True), file)
    module = ModuleType(name)
    exec(compile(plan.source, file, "exec"), module.__dict__)
    found = getattr(module, name)
    assert isinstance(found, Plan)
    return found
