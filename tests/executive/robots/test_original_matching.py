"""`planlang match --semantics original` agrees with KnowRob's rules, which an oracle applies to rdflib graphs."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable
from functools import cache
from itertools import product
from pathlib import Path

import pytest

from executive.robots import Availability, FindingKind, Semantics
from executive.robots.matching import Possessions
from executive.robots.robot import claims_of, parts_of, read_self_model
from executive.robots.tasks import Match, match
from planlang.ontology import Ontology, load
from planlang.recipe import Actions
from planlang.recipe.reading import stated_tasks
from tests.support.corpus_recipes import RECIPES
from tests.support.original_matcher import Answer, OriginalMatcher, read

ROBOTS = ("PR2@hydro.owl", "amigo@hydro.owl", "amigo@re_stack.owl.in", "baxter@hydro.owl", "pioneer@hydro.owl")
VOCABULARIES = ("knowrob", "srdl2", "srdl2-cap", "srdl2-comp", "srdl2-action", "srdl2-dl")


class Corpus:
    """The corpus under the names by which its files import each other, without planlang's own vocabulary."""

    def __init__(self, corpus: Path, folder: Path) -> None:
        self.folder = folder
        for file in (*(corpus / "ontologies").iterdir(), *(corpus / "robots").glob("*.owl*")):
            name = file.name.partition("@")[0]
            if "re_stack" not in file.name and "2011" not in file.name:
                shutil.copy(file, folder / f"{name}.owl")
        shutil.copy(corpus / "ontologies" / "roboearth@re_stack_vitalijs.owl.in", folder / "roboearth.owl")
        for name in ("EASE-WF", "EASE-OBJ"):  # not in the corpus; planlang's own part of them is in Manchester syntax
            (folder / f"{name}.owl").write_text('<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"/>')
        self.corpus = corpus
        self.graph = cache(read)
        self.robot = cache(self._robot)

    def load(self, *files: Path) -> Ontology:
        """Return files with all vocabularies."""
        names = [f"{name}.owl" for name in (*VOCABULARIES, "roboearth")]
        for file in files:
            shutil.copy(file, self.folder / file.name)
            names.append(file.name)
        whole = self.folder / "whole.owl"
        imports = "".join(f'<owl:imports rdf:resource="file:///{name}"/>' for name in names)
        spaces = 'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:owl="http://www.w3.org/2002/07/owl#"'
        whole.write_text(
            f'<rdf:RDF {spaces}><owl:Ontology rdf:about="file:///whole">{imports}</owl:Ontology></rdf:RDF>'
        )
        return load(whole, folders=[self.folder], builtin=False)

    def _robot(self, name: str) -> Possessions:
        model = read_self_model(self.load(self.corpus / "robots" / name))
        return Possessions(model.name, parts_of(model), claims_of(model), model)

    def compare(self, ontology: Ontology, tasks: Iterable[str] | None = None) -> int:
        """Assert that tasks, by default all, match every robot as by the oracle; return their number."""
        robots = [robot for robot in map(self.robot, ROBOTS) if robot.model is not None]
        paths = [robot.model.ontology.documents[-1].path for robot in robots if robot.model]
        oracle = OriginalMatcher(map(self.graph, dict.fromkeys([*(one.path for one in ontology.documents), *paths])))
        asked = list(oracle.tasks() if tasks is None else tasks)
        for task, (robot, path) in product(asked, zip(robots, paths, strict=True)):
            assert robot.model is not None
            told = match(ontology, task, robot, Semantics.ORIGINAL).as_json()
            expected = oracle.answer(task, robot.model.iri, self.graph(path))
            assert Answer(*(frozenset(told[field]) for field in Answer._fields)) == expected, f"{task}, {robot.robot}"
            assert told["feasible"] is not bool(expected.missing_capabilities | expected.missing_components)
        return len(asked)


@pytest.fixture(scope="module")
def files(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    return Corpus(corpus, tmp_path_factory.mktemp("corpus"))


@pytest.mark.long
def test_the_oracle_gives_the_known_answers_for_serving_a_drink(files: Corpus) -> None:
    rows = json.loads((files.corpus / "truth" / "srdl_expected_serve_drink.json").read_text(encoding="utf-8"))
    recipes = {"serve_drink_hydro": RECIPES[-3], "serve_drink_re_stack": RECIPES[-2]}
    for row in rows:
        robot = next(name for name in ROBOTS if name.removesuffix(".in") == row["robot_file"])
        model = files.robot(robot).model
        assert model is not None
        whole = files.load(files.corpus / "recipes" / recipes[row["recipe_set"]])
        paths = dict.fromkeys(document.path for one in (whole, model.ontology) for document in one.documents)
        found = OriginalMatcher(map(files.graph, paths)).answer(
            row["task"], row["robot"], files.graph(paths.popitem()[0])
        )
        assert found == Answer(*(frozenset(row["original"][field]) for field in Answer._fields)), robot


@pytest.mark.long
@pytest.mark.parametrize("recipe", RECIPES)
def test_every_task_of_a_recipe_is_matched_as_by_the_original(files: Corpus, recipe: str) -> None:
    path = files.corpus / "recipes" / recipe
    assert files.compare(files.load(path), stated_tasks(Actions(load(path))))


@pytest.mark.long
def test_every_task_of_the_vocabularies_is_matched_as_by_the_original(files: Corpus) -> None:
    assert files.compare(files.load()) > 10


SHELF = """
Prefix: : <http://example.org/shelf.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: srdl2-cap: <http://knowrob.org/kb/srdl2-cap.owl#>
Prefix: srdl2-comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Ontology: <http://example.org/shelf.owl>
Class: :Sorting
    SubClassOf: knowrob:Action, knowrob:subAction some (:Lifting and knowrob:objectActedOn some :Box)
Class: :SortingWell
    SubClassOf: :Sorting, knowrob:subAction some :Labelling
Class: :Tidying
    EquivalentTo: :SortingWell
    SubClassOf: srdl2-cap:dependsOnCapability some :CarryingCapability
Class: :CarryingCapability
    SubClassOf: srdl2-cap:Capability, srdl2-comp:dependsOnComponent some :Tray
Class: :Tray
Class: :Helper
    SubClassOf: knowrob:Robot, srdl2-cap:hasCapability some :CarryingCapability
Class: :Lifting
    SubClassOf: knowrob:Action, srdl2-cap:dependsOnCapability some :LiftingCapability
Class: :Labelling
    SubClassOf: knowrob:Action, srdl2-comp:dependsOnComponent some (:Printer or :Pen)
Class: :LiftingCapability
    SubClassOf: srdl2-cap:Capability, srdl2-cap:dependsOnCapability some :HoldingCapability
Class: :HoldingCapability
    SubClassOf: srdl2-cap:Capability, srdl2-cap:dependsOnCapability some :{circle}
Class: :SeeingCapability
    SubClassOf: srdl2-cap:Capability
Class: :Box
Class: :Pen
Class: :Printer
Individual: :helper
    Types: :Helper
    Facts: srdl2-comp:subComponent :pen1
Individual: :pen1
    Types: :{part}
"""


def shelf(folder: Path, task: str, circle: str = "SeeingCapability", part: str = "Pen") -> Match:
    path = folder / "shelf.omn"
    path.write_text(SHELF.replace("{circle}", circle).replace("{part}", part), encoding="utf-8")
    model = read_self_model(load(path))
    robot = Possessions(model.name, parts_of(model), claims_of(model), model)
    return match(load(path), f"http://example.org/shelf.owl#{task}", robot, Semantics.ORIGINAL)


def names(found: Match, state: Availability) -> set[str]:
    return {one.text for one in found.in_state(state)}


@pytest.mark.parametrize(
    ("circle", "part", "missing"),
    [
        ("SeeingCapability", "Pen", set()),
        ("LiftingCapability", "Pen", {"LiftingCapability"}),
        ("SeeingCapability", "Box", {"Printer or Pen"}),
    ],
)
def test_inherited_sub_actions_count_cycles_give_nothing_and_no_prerequisites_mean_available(
    tmp_path: Path, circle: str, part: str, missing: set[str]
) -> None:
    found = shelf(tmp_path, "SortingWell", circle, part)
    assert {"LiftingCapability"} < {one.text for one in found.required(FindingKind.CAPABILITY)}
    assert names(found, Availability.MISSING) == missing | {"Tray"}


def test_a_claim_is_believed_but_its_components_are_still_required(tmp_path: Path) -> None:
    found = shelf(tmp_path, "Tidying")
    assert (found.feasible, names(found, Availability.MISSING)) == (False, {"Tray"})


def test_of_equivalent_classes_only_the_one_without_the_axiom_inherits(tmp_path: Path) -> None:
    required = {one.text for one in shelf(tmp_path, "Tidying").required(FindingKind.CAPABILITY)}
    assert required == {"CarryingCapability"}  # nothing of SortingWell
    required = {one.text for one in shelf(tmp_path, "SortingWell").required(FindingKind.CAPABILITY)}
    assert required == {"CarryingCapability", "LiftingCapability"}
