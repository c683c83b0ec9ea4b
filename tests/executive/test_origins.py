"""What a compiled plan's recipe requires of a robot counts when the plan is run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from executive.runs.plan_files import import_plan, main_plan, required_of_plan
from executive.runs.plan_run import Outcome, RunOptions, run_plan_file
from planlang.compiler import compile_recipe
from planlang.diagnostics import Diagnostic, Severity
from planlang.files import bundled

ONTOLOGIES = bundled("ontologies")
AMIGO = RunOptions(
    robot=ONTOLOGIES / "robots" / "amigo.omn", environment=ONTOLOGIES / "environments" / "hospital_room.omn"
)
LOOKING = """
Prefix: : <http://example.org/looking.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: srdl2-comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Ontology: <http://example.org/looking.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Individual: bottle
    Types: knowrob:DrinkingBottle
Class: Search
    SubClassOf: knowrob:Action, knowrob:subAction some Look
Class: Look
    SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn value bottle
"""
SCANNER = "\n    SubClassOf: srdl2-comp:dependsOnComponent some srdl2-comp:Tilting2DLaserScanner\n"


def compiled(recipe: Path, text: str) -> Path:
    """The plan of a recipe, which is written, too."""
    recipe.write_text(text, encoding="utf-8")
    plan = recipe.with_name("search.py")
    plan.write_text(compile_recipe(recipe).source, encoding="utf-8")
    return plan


@pytest.mark.parametrize("cls", ["Search", "Look"], ids=["of the task", "of a step"])
def test_a_plan_edited_or_not_is_refused_like_its_recipe_for_what_only_that_says(cls: str, tmp_path: Path) -> None:
    recipe = tmp_path / "looking.omn"
    plan = compiled(recipe, LOOKING.replace(f"Class: {cls}", f"Class: {cls}{SCANNER}"))
    refused = run_plan_file(replace(AMIGO, recipe=recipe))
    assert (refused.outcome, refused.failure) == (Outcome.LACKS_CAPABILITY, ("MissingCapability",))
    assert "component Tilting2DLaserScanner: amigo has none" in refused.message
    assert run_plan_file(replace(AMIGO, plan=plan)).message == refused.message
    plan.write_text(plan.read_text(encoding="utf-8") + "\n# looked at\n", encoding="utf-8")
    assert run_plan_file(replace(AMIGO, plan=plan)).message == refused.message


@pytest.mark.parametrize(("now", "code"), [(LOOKING + "\n", "C009"), (LOOKING + "(", "C011"), (None, "C011")])
def test_of_a_recipe_that_is_gone_or_has_changed_a_warning_says_that_its_requirements_are_not_known(
    now: str | None, code: str, tmp_path: Path
) -> None:
    recipe = tmp_path / "looking.omn"
    plan = compiled(recipe, LOOKING)
    if now is None:
        recipe.unlink()
    else:
        recipe.write_text(now, encoding="utf-8")
    found: list[Diagnostic] = []
    assert required_of_plan(plan, main_plan(import_plan(plan), None), found) is None
    assert [(one.severity, one.code, str(one.span)) for one in found] == [(Severity.WARNING, code, f"{plan}:1:1")]


def test_a_plan_that_a_person_wrote_has_no_recipe_and_no_warning(tmp_path: Path) -> None:
    plan = tmp_path / "wait.py"
    plan.write_text("from planlang import plan\n\n\n@plan\nasync def rest() -> None:\n    pass\n")
    found: list[Diagnostic] = []
    assert required_of_plan(plan, main_plan(import_plan(plan), None), found) is None
    assert not found
