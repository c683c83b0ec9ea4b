"""A slip of the finger in any name of a recipe, in any dialect, is one error that says what was meant.

Here a sample is tried; ``python tests/planlang/recipe/test_misspellings.py`` tries every name of every recipe in three
ways, which takes some minutes, and prints what is not told. Names of recipes behind it (``D3 D5``) choose some.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Severity
from planlang.ontology.convert import Target, convert
from planlang.recipe.checks.misspellings import Neighbours
from planlang.recipe.fixes.fixing import fix_recipe
from planlang.recipe.statements import WORDS
from tests.support.examples import some

BUNDLED = Path(__file__).parents[3] / "recipes"
HEAD = """\
Prefix: : <http://planlang.org/test#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: srdl2-cap: <http://knowrob.org/kb/srdl2-cap.owl#>
Ontology: <http://planlang.org/test>
"""
STEPS = """
Class: LookAround
    SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn value bottle1
Class: DriveThere
    SubClassOf: knowrob:Translation-LocationChange, knowrob:toLocation value nearBottle
Class: OpenHand
    SubClassOf: knowrob:OpeningAGripper, knowrob:deviceUsed value gripper
Individual: bottle1
    Types: knowrob:DrinkingBottle
Individual: gripper
    Types: knowrob:HolderGripper
Individual: nearBottle
    Types: knowrob:Point2D
    Facts: knowrob:inReachOf bottle1
"""
ORDERS = """
Individual: DriveFirst
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering DriveThere, knowrob:occursAfterInOrdering LookAround
Individual: OpenLast
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering LookAround, knowrob:occursAfterInOrdering OpenHand
"""
RECIPES = {
    "D1": """
Class: ServeGuest
    SubClassOf: knowrob:PurposefulAction and (knowrob:subAction some OpenHand) and (knowrob:subAction some LookAround)
        and (knowrob:subAction some DriveThere) and (knowrob:orderingConstraints value DriveFirst)
        and (knowrob:orderingConstraints value OpenLast)
""" + ORDERS + STEPS,
    "D1f": """
Class: ServeGuest
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some OpenHand, knowrob:subAction some LookAround,
        knowrob:subAction some DriveThere, knowrob:orderingConstraints value DriveFirst,
        knowrob:orderingConstraints value OpenLast, srdl2-cap:dependsOnCapability some srdl2-cap:ArmMotionCapability
""" + ORDERS + STEPS,
    "D1e": """
Class: ServeGuest
    EquivalentTo: knowrob:PurposefulAction and (knowrob:subAction some OpenHand) and (knowrob:subAction some LookAround)
        and (knowrob:subAction some DriveThere) and (knowrob:orderingConstraints value DriveFirst)
        and (knowrob:orderingConstraints value OpenLast)
""" + ORDERS + STEPS,
    "D2": """
Class: ServeGuest
    SubClassOf: knowrob:PurposefulAction, knowrob:subEvents some OpenHand, knowrob:subEvents some LookAround,
        knowrob:subEvents some DriveThere, knowrob:orderingConstraints value DriveFirst,
        knowrob:orderingConstraints value OpenLast
""" + ORDERS + STEPS,
    "own words": """
Class: ServeGuest
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some OpenHand, knowrob:subAction some LookAround,
        knowrob:subAction some DriveThere, orderingConstraints value DriveFirst, orderingConstraints value OpenLast
""" + ORDERS.replace("knowrob:occurs", "occurs") + STEPS,
    "data flow": """
Class: ServeGuest
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some OpenHand, knowrob:subAction some LookAround,
        knowrob:inputOutputConstraints value FoundBottle
Individual: FoundBottle
    Types: knowrob:InputOutputMapping
    Facts: knowrob:createsOutput LookAround, knowrob:requiresInput OpenHand, knowrob:resourceType knowrob:DrinkingBottle
""" + STEPS,
    "D3": """
Class: ServeGuest
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some OpenHand, knowrob:subAction some LookAround,
        knowrob:subAction some DriveThere, knowrob:stateTransition value LookThenDrive,
        knowrob:stateTransition value LookThenOpen, knowrob:stateTransition value DriveThenLook,
        knowrob:taskStartState some LookAround, knowrob:taskEndState some OpenHand
Individual: LookThenDrive
    Types: knowrob:IntrinsicStateChangeEvent
    Facts: knowrob:fromState LookAround, knowrob:toState DriveThere, knowrob:causedBy knowrob:COMPLETED_FAILED
Individual: LookThenOpen
    Types: knowrob:IntrinsicStateChangeEvent
    Facts: knowrob:fromState LookAround, knowrob:toState OpenHand, knowrob:causedBy knowrob:COMPLETED_SUCCESSFUL
Individual: DriveThenLook
    Types: knowrob:IntrinsicStateChangeEvent
    Facts: knowrob:fromState DriveThere, knowrob:toState LookAround, knowrob:causedBy knowrob:COMPLETED_OK
""" + STEPS,
    "D4": """
Prefix: acat: <http://knowrob.org/kb/acat-adt.owl#>
Individual: ServeGuest
    Types: knowrob:PurposefulAction
    Facts: knowrob:subAction firstChunk, acat:adtMainObject bottle1
Individual: firstChunk
    Types: knowrob:LookingForSomething
    Facts: acat:nextAction secondChunk, knowrob:objectActedOn bottle1
Individual: secondChunk
    Types: knowrob:ClosingAGripper
    Facts: acat:nextAction thirdChunk, knowrob:deviceUsed gripper
Individual: thirdChunk
    Types: knowrob:OpeningAGripper
    Facts: acat:previousAction secondChunk, knowrob:deviceUsed gripper
Individual: bottle1
    Types: knowrob:DrinkingBottle
Individual: gripper
    Types: knowrob:HolderGripper
""",
    "D5": """
Prefix: dul: <http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#>
Prefix: ease: <http://www.ease-crc.org/ont/EASE.owl#>
Individual: ServingWorkflow
    Types: dul:Workflow
    Facts: dul:definesTask ServeGuest, ease:hasStep lookTask, ease:hasStep closeTask, ease:hasStep openTask
Individual: ServeGuest
    Types: knowrob:PurposefulAction
Individual: lookTask
    Types: knowrob:LookingForSomething
    Facts: ease:before closeTask, dul:isTaskOf bottleRole
Individual: closeTask
    Types: knowrob:ClosingAGripper
    Facts: ease:precedes openTask
Individual: openTask
    Types: knowrob:OpeningAGripper
    Facts: ease:after lookTask
Individual: bottleRole
    Types: dul:Role
    Facts: dul:classifies bottle1
Individual: bottle1
    Types: knowrob:DrinkingBottle
""",
}  # fmt: skip
"""One small recipe of each dialect, and of the side forms."""

TASKS = ("ServeADrink", "ServeGuest")
"""Names that nothing says a second time, so that nothing can tell that they are misspelt."""

_NAME = {
    Target.MANCHESTER: re.compile(r"(?<![<\w/.#:-])(?:[\w-]+:(?!\s))?(?P<name>[A-Za-z][\w-]{3,})(?![\w:])"),
    Target.RDFXML: re.compile(r"(?<=[#:;])(?P<name>[A-Za-z][\w-]{3,})(?=\"|\s+rdf:resource=\"[^\"]*\"/>)"),
}
_NO_NAMES = re.compile(r"\"[^\"]*\"|#[^\n]*|<[^>]*>|\b(?:some|value|and|or)\b|^.*(?:Prefix|Ontology|Import):.*$", re.M)
_OF_LANGUAGES = re.compile(r"</?(?:rdf|rdfs|owl):\w+|xmlns:\w+|<!ENTITY[^>]*>|xml:base=\"[^\"]*\"|http://[^\"#]*")


def text_of(recipe: str, syntax: Target) -> str:
    text = (BUNDLED / recipe).read_text(encoding="utf-8") if recipe.endswith(".omn") else with_head(RECIPES[recipe])
    if syntax is Target.MANCHESTER:
        return text
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recipe.omn"
        path.write_text(text, encoding="utf-8")
        return convert(path, syntax).text


def with_head(text: str) -> str:
    """The text behind its prefixes and the others."""
    prefixes = re.findall(r"^Prefix: .*\n", text, re.MULTILINE)
    return "".join([*prefixes, HEAD, re.sub(r"^Prefix: .*\n", "", text, flags=re.MULTILINE)])


def places(text: str, syntax: Target) -> list[tuple[int, int]]:
    """Return where names stand in a text (start, end)."""
    hidden = _NO_NAMES if syntax is Target.MANCHESTER else _OF_LANGUAGES
    shown = hidden.sub(lambda found: " " * len(found[0]), text)
    found = (match.span("name") for match in _NAME[syntax].finditer(shown))
    return [(start, end) for start, end in found if text[start:end] not in TASKS]


def slips(name: str, place: int) -> Iterator[str]:
    """A letter of the name left out, doubled, exchanged with the next one."""
    yield name[:place] + name[place + 1 :]
    yield name[:place] + name[place] + name[place:]
    if place + 1 < len(name) and name[place] != name[place + 1]:
        yield name[:place] + name[place + 1] + name[place] + name[place + 2 :]


def misspelt(text: str, syntax: Target, chance: random.Random) -> Iterator[tuple[str, str, str]]:
    """Right name, misspelt name, and the text with it in one place; each place in three ways."""
    for start, end in places(text, syntax):
        name = text[start:end]
        letters = [place for place in range(1, len(name)) if name[place].isalpha() and name[place - 1].isalpha()]
        for wrong in slips(name, chance.choice(letters)):
            yield name, wrong, text[:start] + wrong + text[end:]


def plan_of(text: str, path: Path) -> str:
    """Return what the plan does; raises BadInput."""
    path.write_text(text, encoding="utf-8")
    source = compile_recipe(path).source
    return re.sub(r"#[^\n]*", "", source[source.index("@plan") :])


@cache
def right_plan(recipe: str, syntax: Target) -> str:
    with tempfile.TemporaryDirectory() as folder:
        return plan_of(text_of(recipe, syntax), Path(folder) / "recipe.owl")


def not_told(recipe: str, syntax: Target, name: str, wrong: str, text: str, path: Path) -> str | None:
    """Return what is wrong with what is said about a misspelling; None if all is well."""
    try:
        plan = plan_of(text, path)
    except BadInput as problem:
        first = next(one for one in problem.diagnostics if one.severity is Severity.ERROR)
        if problem.diagnostics[0] is not first:
            return f"{recipe}: {name} as {wrong}: first comes {problem.diagnostics[0]}"
        said = set(re.split(r"[^\w-]+", str(first)))
        line = text[: text.index(wrong)].count("\n") + 1 if text.count(wrong) == 1 else None
        is_here = first.span is not None and (line is None or wrong not in first.message or first.span.line == line)
        return None if {name, wrong} <= said and is_here else f"{recipe}: {name} as {wrong}: {first}"
    return None if plan == right_plan(recipe, syntax) else f"{recipe}: {name} as {wrong}: another plan, and no error"


CASES = [
    (recipe, syntax) for recipe in (*RECIPES, "serve_a_drink.omn") for syntax in (Target.MANCHESTER, Target.RDFXML)
]


SOME = [
    pytest.param(*case, marks=() if number % 16 in (0, 9) else pytest.mark.long) for number, case in enumerate(CASES)
]


@pytest.mark.parametrize(("recipe", "syntax"), SOME)
def test_a_slip_in_any_name_is_the_first_error_or_changes_nothing(tmp_path: Path, recipe: str, syntax: Target) -> None:
    chance = random.Random(f"{recipe} {syntax.value}")
    some = list(misspelt(text_of(recipe, syntax), syntax, chance))
    found = [not_told(recipe, syntax, *one, tmp_path / "recipe.owl") for one in chance.sample(some, 5)]
    assert [one for one in found if one is not None] == []


@pytest.mark.parametrize("syntax", some([Target.RDFXML, Target.MANCHESTER]))
def test_fixing_a_slip_brings_the_plan_back(tmp_path: Path, syntax: Target) -> None:
    chance, path = random.Random(5), tmp_path / "recipe.owl"
    for recipe in ("D1f", "D3", "D5"):
        text = text_of(recipe, syntax)
        some = [one for one in misspelt(text, syntax, chance) if one[0] in WORDS and one[1] not in text]
        _, wrong, changed = chance.choice(some)
        path.write_text(changed, encoding="utf-8")
        found = fix_recipe(path)
        assert plan_of(found.after, path) == right_plan(recipe, syntax), wrong


@pytest.mark.parametrize(
    ("written", "known", "near"),
    [
        ("Reachng", ["Reaching", "Grasping"], ["Reaching"]),
        ("cup2", ["cup1", "cups"], []),
        ("bottle21", ["bottle12"], []),
        ("Poin2tD", ["Point2D", "Point3D"], ["Point2D"]),
        ("MoveToA", ["MoveToB", "MoveTo"], []),
        ("TakeCap", ["TakeCup"], []),
        ("TakeCapp", ["TakeCap", "TakeCappy"], ["TakeCap", "TakeCappy"]),
        ("ReachForBottle", ["ReachToBottle"], []),
        ("toe", ["to", "tow"], []),
        ("Plate", ["Place"], []),
        ("Basil", ["Basin"], []),
        ("Trensport", ["Transport"], ["Transport"]),
    ],
)
def test_names_are_near_by_one_slip_that_is_nobodys_will(written: str, known: list[str], near: list[str]) -> None:
    assert Neighbours(known).of(written) == near


@pytest.mark.parametrize("term", ["subClasOf", "someValuesFrm", "onPropertty", "Clas"])
def test_a_misspelt_term_of_owl_is_one_error_and_fixed(tmp_path: Path, term: str) -> None:
    right = {"subClasOf": "subClassOf", "someValuesFrm": "someValuesFrom", "onPropertty": "onProperty"}.get(
        term, "Class"
    )
    path, text = tmp_path / "recipe.owl", text_of("D1f", Target.RDFXML)
    path.write_text(re.sub(rf"(</?(?:owl|rdfs):){right}\b", rf"\g<1>{term}", text), encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        compile_recipe(path)
    (found,) = (one for one in caught.value.diagnostics if one.severity is Severity.ERROR)
    assert found.code == "O013"
    assert right in (found.help or "")
    assert plan_of(fix_recipe(path).after, path) == right_plan("D1f", Target.RDFXML)


def main() -> None:
    """Try every name of every recipe; print what is not told."""
    tried = 0
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        for recipe, syntax in ((name, syntax) for name, syntax in CASES if name in (sys.argv[1:] or (name,))):
            for one in misspelt(text_of(recipe, syntax), syntax, random.Random(recipe)):
                tried += 1
                found = not_told(recipe, syntax, *one, Path(folder) / "recipe.owl")
                if found is not None:
                    failures.append(found)
                    sys.stdout.write(f"{syntax.value} {found}\n")
    sys.stdout.write(f"{tried} misspellings tried, {len(failures)} not told\n")


if __name__ == "__main__":
    main()


def test_a_property_of_the_vocabulary_in_another_namespace_is_proposed_with_its_own(tmp_path: Path) -> None:
    file = tmp_path / "map.omn"
    file.write_text(
        "Prefix: : <http://example.org/map.owl#>\nPrefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>\n"
        "Ontology: <http://example.org/map.owl>\nImport: <http://knowrob.org/kb/knowrob.owl>\n"
        "Individual: seen1\n    Types: knowrob:SemanticMapPerception\n    Facts: createdByAlgorithm seen1\n"
    )
    with pytest.raises(BadInput) as caught:
        compile_recipe(file)
    (found,) = (one for one in caught.value.diagnostics if one.code == "R058")
    meant = "http://knowrob.org/kb/knowrob.owl#createdByAlgorithm"
    assert found.help == f"did you mean `createdByAlgorithm` ({meant})?"
