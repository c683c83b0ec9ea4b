"""Recipes in SOMA's vocabulary compile to the plan of the same recipe in KnowRob's; what is no recipe is named."""

import re
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic, has_errors
from planlang.ontology import load

HERE = Path(__file__).parent / "soma"
RECIPE = """\
Prefix: : <http://example.org/r.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: soma: <http://www.ease-crc.org/ont/SOMA.owl#>
Prefix: dul: <http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#>
Ontology: <http://example.org/r.owl>
Class: Task
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Step
Class: Step
    SubClassOf: {}, knowrob:objectActedOn some soma:Cup
"""


def plan_of(path: Path) -> str:
    """The source of a plan, without what names the vocabulary of its actions."""
    plan = compile_recipe(path)
    assert plan.diagnostics == (), list(map(str, plan.diagnostics))
    return plan.source


def written(folder: Path, text: str, name: str = "r.omn") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def found(path: Path) -> list[Diagnostic]:
    try:
        return list(compile_recipe(path).diagnostics)
    except BadInput as bad:
        return list(bad.diagnostics)


def test_a_recipe_with_somas_actions_has_the_plan_of_one_with_knowrobs() -> None:
    soma, knowrob = plan_of(HERE / "serve_soma.ttl"), plan_of(HERE / "serve_knowrob.ttl")
    classes = {
        "FETCHING": '"FetchingAnObject"',
        "PLACING": '"PuttingSomethingSomewhere"',
        "SERVING": '"DeliveringAnObject"',
    }
    for name, cls in classes.items():
        soma = re.sub(rf"below={name}\b", f"below={cls}", soma)
    declarations = re.compile(r"^(SOMA = |[A-Z_]+ = action_class\(SOMA).*\n+", re.MULTILINE)
    headers = re.compile(r"^(Compiled by|What follows has) .*\n", re.MULTILINE)
    texts = [re.sub(r"\n+", "\n", headers.sub("", declarations.sub("", text))) for text in (soma, knowrob)]
    assert texts[0] == texts[1]


def test_a_workflow_of_somas_tasks_fills_roles_and_orders_steps() -> None:
    plan = plan_of(HERE / "serve_flow.ttl")
    steps = re.findall(
        r'action\(SOMA \+ "(\w+)", below=(?:"\w+"|\w+), ([^)]*)\)', plan.partition("async def serve(")[2]
    )
    assert steps == [
        ("Fetching", "object_acted_on=cup"),
        ("Placing", "object_acted_on=cup, to_location=table"),
        ("PickingUp", "object_acted_on=cup"),
        ("Serving", "object_acted_on=cup, recipient=anna"),
    ]


def test_the_vocabulary_of_soma_is_read_only_where_its_names_are_used(tmp_path: Path) -> None:
    soma = written(tmp_path, RECIPE.format("soma:PickingUp"))
    plain = written(tmp_path, RECIPE.format("knowrob:Reaching").replace("soma:Cup", "knowrob:Cup"), "plain.omn")
    read = [{one.path.name for one in load(path).documents} for path in (soma, plain)]
    assert ["soma.omn" in names for names in read] == [True, False]


ADDRESSES = [
    "http://www.ease-crc.org/ont/SOMA.owl",
    "http://www.ease-crc.org/ont/SOMA-HOME.owl#",
    "https://ease-crc.github.io/soma/owl/2.1.0/SOMA-ACT.owl",
    "package://soma/owl/SOMA.owl",
    "http://www.ease-crc.org/ont/EASE-OBJ.owl",
    "http://www.ontologydesignpatterns.org/ont/dul/DUL.owl",
    "http://www.ease-crc.org/ont/DUL.owl",
    "package://knowrob/owl/URDF.owl",
]


@pytest.mark.parametrize("address", ADDRESSES)
def test_soma_and_dul_are_known_at_every_address_of_theirs(address: str, tmp_path: Path) -> None:
    text = RECIPE.format("soma:PickingUp").replace("r.owl>\nClass", f"r.owl>\n    Import: <{address}>\nClass")
    assert found(written(tmp_path, text)) == []


@pytest.mark.parametrize(
    "space",
    [
        "http://www.ease-crc.org/ont/SOMA-ACT.owl#",
        "http://www.ease-crc.org/ont/EASE-ACT.owl#",
        "https://www.ease-crc.org/ont/SOMA.owl#",
    ],
)
def test_names_of_modules_and_of_ease_are_read_as_somas(space: str, tmp_path: Path) -> None:
    text = RECIPE.format(f"<{space}PickingUp>")
    path = written(tmp_path, text)
    assert [one.code for one in found(path)] == ["O015"]
    assert compile_recipe(path).source.count('SOMA + "PickingUp", below="PickingUpAnObject"') == 1


def test_axioms_of_somas_own_sources_state_no_parameters(tmp_path: Path) -> None:
    source = """Prefix(:=<http://www.ease-crc.org/ont/SOMA.owl#>)
Prefix(dul:=<http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#>)
Ontology(<http://www.ease-crc.org/ont/SOMA.owl>
Declaration(Class(:PickingUp)) SubClassOf(:PickingUp :Manipulating) SubClassOf(:Manipulating dul:Task)
SubClassOf(:PickingUp ObjectSomeValuesFrom(dul:hasParticipant dul:Object)) SubClassOf(dul:Task dul:Entity)
SubClassOf(dul:Entity ObjectSomeValuesFrom(dul:hasLocation dul:Entity)))"""
    text = RECIPE.format("soma:PickingUp")
    alone = compile_recipe(written(tmp_path, text)).source
    (tmp_path / "SOMA.owl").write_text(source)
    path = written(tmp_path, text.replace("r.owl>\nClass", "r.owl>\n    Import: <SOMA.owl>\nClass"))
    assert [one for one in found(path) if one.code.startswith("R")] == []
    assert compile_recipe(path).source.partition("RECIPE =")[2] == alone.partition("RECIPE =")[2]


WRONG = {
    "soma:PickUp": ("R020", "did you mean `PickingUp`?"),
    "soma:Dancing": ("R020", "did you mean `Distancing`?"),
    "soma:Openning": ("R058", "did you mean `Opening`?"),
    "soma:Squeezing": ("R021", "register a process module for `Step` or `Squeezing`"),
}


@pytest.mark.parametrize("name", WRONG)
def test_an_action_of_soma_that_nothing_performs_or_that_is_not_there_is_named(name: str, tmp_path: Path) -> None:
    code, advice = WRONG[name]
    problems = [one for one in found(written(tmp_path, RECIPE.format(name))) if one.code == code]
    assert len(problems) == 1
    assert advice in (problems[0].help or "")


@pytest.mark.parametrize("name", ["PickUp", "Teleporting"])
def test_a_step_of_a_workflow_of_a_class_that_somas_vocabulary_lacks_is_refused_before_the_run(
    name: str, tmp_path: Path
) -> None:
    for file in HERE.glob("*.ttl"):
        written(tmp_path, file.read_text(), file.name)
    flow = tmp_path / "serve_flow.ttl"
    written(tmp_path, flow.read_text().replace(":take a soma:PickingUp", f":take a soma:{name}"), flow.name)
    (problem,) = found(flow)
    assert (problem.code, has_errors([problem])) == ("R020", True)
    assert (
        problem.message
        == f"nothing performs `take`: `{name}` (http://www.ease-crc.org/ont/SOMA.owl#{name}) is not defined"
    )


NO_RECIPES = {
    "tells what was done": "Individual: act1\n    Types: dul:Action\n    Facts: dul:executesTask fetch1\n"
    "Individual: fetch1\n    Types: soma:Fetching\n",
    "defines classes": "Class: Mug\n    SubClassOf: soma:Cup\n",
    "has neither a workflow nor objects with a pose": "Individual: cup1\n    Types: soma:Cup\n",
}


@pytest.mark.parametrize("what", NO_RECIPES)
def test_a_file_in_somas_words_that_is_no_recipe_is_named_with_what_to_do(what: str, tmp_path: Path) -> None:
    path = written(tmp_path, RECIPE.partition("Class: Task")[0] + NO_RECIPES[what])
    (problem,) = [one for one in found(path) if one.code == "R001"]
    assert "in SOMA's words" in problem.message
    assert what in problem.message
    assert "soma:hasStep" in (problem.help or "")
    assert has_errors([problem])
