"""Steps that nothing performs yet: they compile, hold all roles, open no scope and are not repeated in one."""

from pathlib import Path
from typing import Any

import pytest

from planlang.compiler import CompiledPlan, compile_recipe
from planlang.diagnostics import BadInput, Severity

HEAD = """
Prefix: : <http://planlang.org/test#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>
Import: <http://knowrob.org/kb/knowrob.owl>
Class: Cook
    SubClassOf: k:PurposefulAction, """


@pytest.fixture
def compiled(tmp_path: Path) -> Any:
    """Compiles a task of steps, given as class and superclass, and what else the file states."""

    def compile_steps(steps: dict[str, str], *more: str, constraints: str = "") -> CompiledPlan:
        listed = ", ".join(f"k:subAction some {name}" for name in steps)
        classes = [f"Class: {name}\n    SubClassOf: {above}" for name, above in steps.items()]
        path = tmp_path / "recipe.omn"
        path.write_text("\n".join([HEAD + listed + constraints, *classes, *more]), encoding="utf-8")
        return compile_recipe(path)

    return compile_steps


def test_the_warning_names_the_module_the_recipe_and_the_class_nearby(compiled: Any) -> None:
    anything = "k:PurposefulAction"
    plan = compiled({"StirSoup": anything, "Mixing2": "k:Mixing", "Reaching2": anything})
    found = [one for one in plan.diagnostics if one.code == "R021"]
    assert {one.severity for one in found} == {Severity.WARNING}
    said = {one.message.split("`")[1]: one.help for one in found}
    assert said["StirSoup"] == "register a process module for `StirSoup` (docs/guides/modules.md), or add sub-actions"
    assert "a process module for `Mixing2` or `Mixing` or" in said["Mixing2"]
    assert said["Reaching2"].endswith("a subclass of `Reaching`")


def test_no_step_within_a_recipe_of_the_library_is_a_class_to_place_it_below(compiled: Any) -> None:
    plan = compiled({"TiltBack": "k:PurposefulAction", "TakeVessel2": "k:PurposefulAction"})
    said = {one.message.split("`")[1]: one.help or "" for one in plan.diagnostics if one.code == "R021"}
    assert set(said) == {"TiltBack", "TakeVessel2"}
    assert all(help.endswith("or add sub-actions") for help in said.values())


def test_unordered_steps_that_may_need_anything_take_turns(compiled: Any) -> None:
    plan = compiled({"Look": "k:LookingForSomething", "Stir": "k:PurposefulAction"})
    assert plan.source.count('async with using("base", "torso", "arm", "gripper", "head")') == 1
    assert plan.source.count('async with using("head")') == 1


def test_it_opens_no_scope_and_is_neither_skipped_nor_repeated_in_one(compiled: Any) -> None:
    about = ", k:objectActedOn value bottle"
    steps = {"Go": "k:Translation-LocationChange, k:toLocation value there", "Stir": f"k:Mixing{about}"}
    plan = compiled(
        {**steps, "Look": f"k:LookingForSomething{about}"},
        "Individual: bottle\n    Types: k:DrinkingBottle",
        "Individual: there\n    Types: k:Point2D\n    Facts: k:inReachOf bottle",
        "Individual: O1\n    Types: k:PartialOrdering-Strict",
        "    Facts: k:occursBeforeInOrdering Go, k:occursAfterInOrdering Look",
        "Individual: O2\n    Types: k:PartialOrdering-Strict",
        "    Facts: k:occursBeforeInOrdering Look, k:occursAfterInOrdering Stir",
        "Individual: stirred\n    Types: k:Goal",
        '    Facts: k:ofAction k:Mixing, k:condition "holding(objectActedOn)"',
        constraints=", k:orderingConstraints value O1, k:orderingConstraints value O2",
    )
    assert plan.source.count("await at_location(") == 1
    assert "once=True" in plan.source
    assert "achieve" not in plan.source  # Stir has a goal, by which it would be skipped
    assert "look_from_another_place" not in plan.source  # which would repeat the scope


def test_a_misspelt_superclass_and_an_undefined_step_stay_errors(compiled: Any) -> None:
    with pytest.raises(BadInput) as found:
        compiled({"Look": "k:LookingForSomethin"}, constraints=", k:subAction some Nothing")
    assert {one.code for one in found.value.diagnostics if one.severity is Severity.ERROR} == {"R020", "R058"}


def test_what_was_poured_is_not_poured_again_when_the_vessel_is_lost_later(compiled: Any) -> None:
    plan = compiled(
        {
            "PourOut": "k:FluidFlow-Translation, k:objectActedOn value bottle, k:toLocation value pan",
            "Rest": "k:WaitForPredefinedTimeInterval, k:duration value 3.0",
        },
        "Individual: bottle\n    Types: k:DrinkingBottle",
        "Individual: pan\n    Types: k:CookingVessel",
        "Individual: O1\n    Types: k:PartialOrdering-Strict",
        "    Facts: k:occursBeforeInOrdering PourOut, k:occursAfterInOrdering Rest",
        constraints=", k:orderingConstraints value O1",
    )
    task = plan.source[plan.source.index("async def cook") :]
    assert "otherwise=partial(pour" in task
    assert "ObjectLost" not in task
    assert "ObjectLost" in plan.source, "before it is poured it is fetched again"
