"""A filler that is not understood is an error; one that means the same as a name is that name."""

from __future__ import annotations

from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic, Severity

RECIPE = """\
Prefix: : <http://planlang.org/test#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>
Ontology: <http://planlang.org/test>

Class: Serve
    SubClassOf: k:PurposefulAction, {task}
Class: Look
    SubClassOf: k:LookingForSomething, {step}
Class: Check
    SubClassOf: k:CheckingWhetherConditionObtains, k:conditionEvaluated some ({condition})
Class: Drive
    SubClassOf: k:Translation-LocationChange, {drive}
Individual: order
    Types: k:PartialOrdering-Strict
    Facts: {order}
Individual: cup1
    Types: k:Cup
Individual: cup2
    Types: k:Cup
Individual: table1
    Types: k:Table-PieceOfFurniture
Individual: there
    Types: k:Point2D{place}
"""
PARTS = {
    "task": "k:subAction some Look, k:subAction some Check, k:subAction some Drive",
    "step": "k:objectActedOn some k:Cup",
    "condition": "k:VisualPerception and (k:detectedObject some k:Cup)",
    "drive": "k:toLocation value there",
    "order": "k:occursBeforeInOrdering Look, k:occursAfterInOrdering Drive",
    "place": ", k:near value table1",
}
PARTS["place"] = "\n    Facts: k:near table1"


def compiled(folder: Path, **parts: str) -> tuple[str, list[Diagnostic]]:
    """Source of the plan below its header, if any, and all errors and warnings."""
    path = folder / "recipe.omn"
    path.write_text(RECIPE.format(**{**PARTS, **parts}), encoding="utf-8")
    try:
        done = compile_recipe(path)
    except BadInput as problem:
        return "", list(problem.diagnostics)
    source = done.source or ""
    return source[source.find("RECIPE =") :], [one for one in done.diagnostics if one.severity is not Severity.NOTE]


NOT_UNDERSTOOD = [
    ("step", "k:objectActedOn min 2 k:Cup"),
    ("step", "k:objectActedOn max 2 k:Cup"),
    ("step", "k:objectActedOn only k:Cup"),
    ("step", "k:objectActedOn exactly 0 k:Cup"),
    ("step", "k:objectActedOn min 0 k:Cup"),
    ("step", "k:objectActedOn some k:Cup, k:objectActedOn max 0 k:Cup"),
    ("step", "k:objectActedOn some k:Cup, k:objectActedOn only (k:Cup and (k:on-Physical some k:Shelf))"),
    ("step", "k:objectActedOn some (k:Cup and (k:on-Physical some k:Nowhere))"),
    ("step", "k:objectActedOn some (k:Cup and (k:on-Physical value table1) and not k:Bowl-Eating)"),
    ("step", "k:objectActedOn some (k:Cup and (k:on-Physical some (k:Table-PieceOfFurniture and k:Desk)))"),
    ("step", "k:objectActedOn some (k:Cup and (k:on-Physical value table1) and (k:depthOfObject value 0.1))"),
    ("step", "k:objectActedOn some (k:Cup and (k:on-Physical only k:Table-PieceOfFurniture))"),
    ("step", "k:objectActedOn some (k:Cup and k:Container)"),
    ("step", "k:objectActedOn some (k:Cup or k:Bowl-Eating)"),
    ("step", "k:objectActedOn some (not k:Bowl-Eating)"),
    ("step", "k:objectActedOn some {{cup1, cup2}}"),
    ("step", "k:objectActedOn Self"),
    ("step", "inverse k:objectActedOn some k:Cup"),
    ("step", "not (k:objectActedOn value cup1)"),
    ("step", "(k:objectActedOn value cup1) or (k:objectActedOn value cup2)"),
    ("step", "k:duration some xsd:float[>= 3.0f]"),
    ("step", "k:objectActedOn exactly 2 (k:Cup or k:Bowl-Eating)"),
    ("step", "k:objectActedOn exactly 2 k:Patient"),
    ("step", "k:objectActedOn min 2 (k:Cup and (k:on-Physical value table1))"),
    ("task", PARTS["task"] + ", k:objectActedOn exactly 2 k:Cup"),
    ("task", "k:subAction some (Look and Drive)"),
    ("task", "k:subAction some (Look and not Drive)"),
    ("task", "k:subAction some (Look and (k:objectActedOn min 2 k:Cup))"),
    ("task", "k:subAction some (Look and (k:objectActedOn only k:Cup))"),
    ("task", "k:subAction some (Look and (inverse k:objectActedOn some k:Cup))"),
    ("task", "k:subAction some (Look and (Drive or Check))"),
    ("task", "k:subAction some ((Look or Drive) and not Check)"),
    ("task", "k:subAction some ((Look and not Check) or Drive)"),
    ("task", "k:subAction some Look, k:taskStartState some (Look and Drive), k:taskEndState value Look"),
    ("order", "k:occursBeforeInOrdering Look, k:occursBeforeInOrdering _:other, k:occursAfterInOrdering Drive"),
    ("condition", "k:VisualPerception and (k:detectedObject exactly 2 k:Cup)"),
    ("condition", "k:VisualPerception and (k:detectedObject some (k:Cup and (k:on-Physical some k:Shelf)))"),
    ("condition", "k:VisualPerception and (k:detectedObject only k:Cup)"),
    ("condition", "k:VisualPerception and not (k:detectedObject some k:Cup)"),
    ("drive", "k:toLocation some (k:Point2D and (k:near value table1))"),
    ("drive", "k:toLocation some Nowhere"),
    ("place", ", k:near exactly 2 k:Table-PieceOfFurniture"),
    ("place", ", k:near some (k:Table-PieceOfFurniture and not k:Desk-PieceOfFurniture)"),
    ("place", "\n    Facts: k:near _:somewhere"),
]


@pytest.mark.parametrize(("part", "expression"), NOT_UNDERSTOOD, ids=lambda value: value)
def test_what_is_not_understood_of_a_filler_is_an_error(tmp_path: Path, part: str, expression: str) -> None:
    whole = f"{expression}, k:orderingConstraints value order" if part == "task" else expression
    parts = {part: whole.replace("{{", "{").replace("}}", "}")}
    if part == "order":
        parts["task"] = PARTS["task"] + ", k:orderingConstraints value order"
    _, diagnostics = compiled(tmp_path, **parts)
    errors = [one for one in diagnostics if one.severity is Severity.ERROR]
    assert errors, diagnostics
    assert all(one.span is not None and one.span.line > 1 and one.help for one in errors)


@pytest.mark.parametrize(
    ("expression", "cup"),
    [
        ("k:Cup and (k:on-Physical value table1)", '"Cup", where=a_location(on=TABLE)'),
        ("(k:on-Physical value table1) and k:Cup", '"Cup", where=a_location(on=TABLE)'),
        ("k:Cup and (k:on-Physical exactly 1 k:Table-PieceOfFurniture)", '"Cup", where=a_location(on='),
        (
            "k:Cup and (k:near value cup1) and (k:on-Physical value table1)",
            '"Cup", where=a_location(near=CUP',
        ),
    ],
)
@pytest.mark.parametrize("part", ["step", "condition"])
def test_a_thing_of_a_class_may_have_to_stand_in_relations_to_others(
    tmp_path: Path, expression: str, cup: str, part: str
) -> None:
    whole = {
        "step": f"k:objectActedOn some ({expression})",
        "condition": f"k:VisualPerception and (k:detectedObject some ({expression}))",
    }
    plan, diagnostics = compiled(tmp_path, **{part: whole[part]})
    assert f"an_object({cup}" in plan, diagnostics


@pytest.mark.parametrize(
    ("part", "expression"),
    [
        ("step", "k:objectActedOn exactly 3 k:Cup"),
        ("step", "k:objectActedOn exactly 3 (k:Cup and (k:on-Physical value table1))"),
        ("task", PARTS["task"].replace("some Look", "some (Look and (k:objectActedOn exactly 3 k:Cup))")),
    ],
)
def test_a_step_about_a_number_of_things_is_performed_so_often(tmp_path: Path, part: str, expression: str) -> None:
    plan, diagnostics = compiled(tmp_path, **{part: expression})
    assert plan.count("times=3") == 1, diagnostics


def test_the_steps_of_a_step_about_a_number_of_things_are_performed_once_for_each(tmp_path: Path) -> None:
    plan, _ = compiled(
        tmp_path, step="k:TransportingAnObject, k:toLocation value table1, k:objectActedOn exactly 3 k:Cup"
    )
    assert plan.count("times=3") == 1


SAME = [
    ("step", "k:objectActedOn exactly 1 k:Cup"),
    ("step", "k:objectActedOn min 1 k:Cup"),
    ("step", "k:objectActedOn some (k:Cup and k:Cup)"),
    ("step", "k:objectActedOn some ((k:Cup))"),
    ("step", "k:objectActedOn some (k:Cup or k:Cup)"),
    ("step", "k:objectActedOn some (k:Cup and <http://www.w3.org/2002/07/owl#Thing>)"),
    ("step", "k:objectActedOn exactly 1 (k:Cup and k:Cup)"),
    ("step", "k:objectActedOn some k:Cup, k:objectActedOn only k:Cup"),
    ("step", "k:objectActedOn some k:Cup, k:objectActedOn max 1 k:Cup"),
    ("task", PARTS["task"].replace("some Look", "some (Look and Look)")),
    ("task", PARTS["task"].replace("some Look", "some (Look and k:LookingForSomething)")),
    ("task", PARTS["task"].replace("some Look", "some (k:LookingForSomething and Look)")),
    ("condition", "k:VisualPerception and (k:detectedObject exactly 1 k:Cup)"),
    ("drive", "k:toLocation some {there}"),
]


@pytest.mark.parametrize(("part", "expression"), SAME, ids=lambda value: value)
def test_what_means_the_same_as_a_name_gives_the_same_plan(tmp_path: Path, part: str, expression: str) -> None:
    plan, diagnostics = compiled(tmp_path)
    assert plan, diagnostics
    again, more = compiled(tmp_path, **{part: expression})
    assert again == plan, more
    assert [one.code for one in more] == [one.code for one in diagnostics]


def test_one_of_a_single_individual_is_that_individual(tmp_path: Path) -> None:
    plan, _ = compiled(tmp_path, step="k:objectActedOn value cup1")
    assert compiled(tmp_path, step="k:objectActedOn some {cup1}")[0] == plan != ""


def test_the_message_repeats_the_expression_and_says_what_to_write(tmp_path: Path) -> None:
    _, diagnostics = compiled(tmp_path, step="k:objectActedOn min 3 k:Cup")
    (found,) = [one for one in diagnostics if one.severity is Severity.ERROR]
    assert (found.code, found.message) == ("R035", "objectActedOn of `Look` is 3 of `Cup`, but a step takes one")
    assert found.help == "write `objectActedOn exactly 3`, or a step for each"
