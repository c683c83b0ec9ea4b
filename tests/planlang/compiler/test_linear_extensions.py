"""Plans of real recipes can be done in as many orders as the truth about them says."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from planlang.compiler import compile_recipe
from planlang.compiler.names import snake_case
from planlang.designators import local_name
from planlang.testing import all_linear_extensions

FILES = {
    "ChocolateCakeBaking@2011-03.owl": 8,
    "GetFromRefrigerator@2010-11.owl": 1,
    "make_pancakes@hydro.owl": 1,
    "pancake-making-constr@hydro.owl": 1,
    "pancake-making@groovy_2011-08.owl.in": 1,
    "pancake-making@hydro.owl": 1,
    "pouring@hydro.owl": 1,
    "serve_drink@knowrob_hydro_2014-11.owl": 2,
    "serve_drink_new@re_stack.owl": 1,
}
"""Recipes of ordered steps without errors, and how many tasks they state; that of re_stack/serve_drink has errors."""


@pytest.mark.parametrize("file", FILES)
def test_plan_has_as_many_linear_extensions_as_the_recipe(corpus: Path, file: str, read_plan: type[Any]) -> None:
    truth = json.loads((corpus / "truth" / f"{file}.json").read_text(encoding="utf-8"))
    assert len(truth["tasks"]) == FILES[file]
    for task in truth["tasks"]:
        name = local_name(task["task"])
        plan = compile_recipe(corpus / "recipes" / file, task=name, allow_abstract=True, scopes=False, data_flow=False)
        happening = read_plan(plan.source, calls_are_steps=True).orders(snake_case(name))
        number = Counter(happening.steps)
        steps = [f"{step} {count}" for step in number for count in range(number[step])]
        assert len(steps) == task["n_subactions"]
        assert max(number.values()) == 1, "steps of one name cannot be told apart"
        orders = {(f"{a} 0", f"{b} 0") for a, b in happening.before}
        assert all_linear_extensions(steps, orders, limit=1).total == task["linear_extensions"]
