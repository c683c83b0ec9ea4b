"""Real recipes say what an independent RDF script found in them, in every dialect; what differs is listed with why."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import networkx as nx
import pytest

from planlang.designators import local_name
from planlang.ontology import BNode, Literal, Ontology, expand, load
from planlang.recipe import Actions, Recipe, read_recipe, stated_tasks
from planlang.recipe.actions import recipes_for
from planlang.recipe.fillers import fillings, is_place, read_place, read_thing
from planlang.recipe.model import Reason
from planlang.recipe.order import Precedence, order_graph, recipe_order
from planlang.recipe.readers import workflow
from planlang.recipe.reading import read_recipe_of

CLASS_RECIPES = (
    "recipes/ChocolateCakeBaking@2011-03.owl",
    "recipes/GetFromRefrigerator@2010-11.owl",
    "recipes/TableSetting@2011-10.owl.in",
    "recipes/exploration-recipe@hydro.owl",
    "recipes/make_pancakes@hydro.owl",
    "recipes/object-search-recipe@hydro.owl",
    "recipes/pancake-making-constr@hydro.owl",
    "recipes/pancake-making@groovy_2011-08.owl.in",
    "recipes/pancake-making@hydro.owl",
    "recipes/pouring@hydro.owl",
    "recipes/serve_drink@knowrob_hydro_2014-11.owl",
    "recipes/serve_drink@re_stack.owl",
    "recipes/serve_drink_new@re_stack.owl",
    "ontologies/knowrob@hydro.owl",
    "ontologies/knowrob@2011-09_ias.owl",
)
TABLE = "recipes/acat-adt_example_pipetting@master.owl"
WORKFLOW = "recipes/pancake@kinetic.owl"

RECIPES_OF_KNOWROB = "the bundled vocabulary has KnowRob's classes and the library's recipes, not those of its ontology"

TASKS_OF_KNOWROB = (
    "AddingAnEgg",
    "ClosingACupboard",
    "ClosingACupboardDrawer",
    "Mixing",
    "PickingUpAnObject",
    "PuttingDownAnObject",
    "PuttingSomethingSomewhere",
)
"""Tasks of its ontology with steps that the library has recipes for."""

EXCEPTIONS: dict[tuple[str, str, str], str] = {
    (file, task, "nested through a superclass"): RECIPES_OF_KNOWROB
    for file, task in (
        ("recipes/ChocolateCakeBaking@2011-03.owl", "ChocolateCakeBaking"),
        ("recipes/ChocolateCakeBaking@2011-03.owl", "ChocolateCakeBakingStep1"),
        ("recipes/ChocolateCakeBaking@2011-03.owl", "ChocolateCakeBakingStep2"),
        ("recipes/ChocolateCakeBaking@2011-03.owl", "ChocolateCakeBakingStep4"),
        ("recipes/ChocolateCakeBaking@2011-03.owl", "ChocolateCakeBakingStep5"),
        ("recipes/ChocolateCakeBaking@2011-03.owl", "ChocolateCakeBakingStep6"),
        ("recipes/ChocolateCakeBaking@2011-03.owl", "ChocolateCakeBakingStep7"),
        ("recipes/GetFromRefrigerator@2010-11.owl", "GetObjectFromRefrigerator"),
        ("recipes/make_pancakes@hydro.owl", "MakePancakes"),
        ("recipes/TableSetting@2011-10.owl.in", "TableSetting"),
        ("recipes/pancake-making@groovy_2011-08.owl.in", "MakingPancakes"),
        ("recipes/pancake-making@hydro.owl", "MakingPancakes"),
        ("recipes/serve_drink_new@re_stack.owl", "ServeADrink"),
        *(
            (f"ontologies/{file}", task)
            for file in ("knowrob@hydro.owl", "knowrob@2011-09_ias.owl")
            for task in TASKS_OF_KNOWROB
        ),
    )
} | {
    (
        "recipes/pancake-making-constr@hydro.owl",
        "FlippingAPancake",
        "hasValue points to a class (parameters)",
    ): "the classes are individuals, too, which the value may be",
    (
        "recipes/object-search-recipe@hydro.owl",
        "FindBottle",
        "subaction superclass(es) not in the ontology: InferLikelyObjectLocations, StartVisionModules, "
        "StopVisionModules, UploadMapToRoboEarth",
    ): "the vocabulary here has these classes (searching.omn)",
}
"""(file, task, fact or anomaly) -> why it is not equal."""

LEGAL = {
    "finite-state recipe has a loop": "loops are what states are for",
    "classes also declared NamedIndividual": "OWL 2 allows a class and an individual of one name",
}
"""Beginning of an anomaly -> why nothing is said about it."""

SAID = {
    "no ordering at all": {"R042", "R045", "R047"},
    "someValuesFrom points to an individual": {"O042"},
    "hasValue points to a class": {"O043"},
    "anonymous class expression as subaction": {"R020"},
    "constraint graph has": {"R010", "R047"},
    "constraint mentions a class that is not a subaction": {"R010"},
    "subaction class never defined": {"R020"},
    "subaction without any ordering constraint": {"R020", "R047"},
    "no failure transition declared": {"R056"},
    "subaction superclass(es) not in the ontology": {"O041"},
    "owl:subClassOf used instead": {"O012"},
    "malformed XML comment removed": {"O006"},
    "duplicate XML attribute": {"O007"},
}
"""Beginning of an anomaly or a repair -> the codes of which one says it."""


@cache
def opened(path: Path) -> Actions:
    return Actions(load(path))


def truth(corpus: Path, file: str) -> dict[str, Any]:
    folder, name = file.split("/")
    prefix = "ONT_" if folder == "ontologies" else ""
    found: dict[str, Any] = json.loads((corpus / "truth" / f"{prefix}{name}.json").read_text(encoding="utf-8"))
    return found


def canonical(iri: str) -> str:
    return iri.replace("http://ias.cs.tum.edu/kb/knowrob.owl#", expand("Action").removesuffix("Action"))


def pairs(found: list[list[str]]) -> set[tuple[str, str]]:
    return {(canonical(a), canonical(b)) for a, b in found}


def linear_extensions(graph: nx.DiGraph) -> int:
    """Return how many orders a graph of at most some ten nodes allows."""

    @cache
    def count(done: frozenset[str]) -> int:
        ready = [node for node in graph if node not in done and set(graph.predecessors(node)) <= done]
        return sum(count(done | {node}) for node in ready) if ready else 1

    return count(frozenset())


def dialect(task: dict[str, Any]) -> str:
    words = " ".join(task["dialect"])
    if "stateTransition" in words:
        return "D3"
    if "subEvents" in words:
        return "D2"
    return "D1e" if "equivalentClass" in words else "D1" if "intersectionOf" in words else "D1f"


def stated_order(task: dict[str, Any], undefined: set[str]) -> nx.DiGraph:
    """The order among sub-actions that are defined, from the constraints of the truth."""
    graph = nx.DiGraph(pairs(task["constraints"]))
    graph.add_nodes_from(map(canonical, task["subactions"]))
    graph.remove_nodes_from(undefined | (set(graph) - set(map(canonical, task["subactions"]))))
    return graph


def undefined_in(task: dict[str, Any]) -> set[str]:
    return {canonical(iri) for iri, facts in task["actions"].items() if facts.get("defined_in", "") is None}


def stated(ontology: Ontology, iri: str, actions: Actions, task: str) -> set[tuple[str, str]]:
    """Return what a class states itself about the properties of its actions, and where a recipe mentions it."""
    statements = actions.statements(task)
    more = [sub.fillings for sub in statements.sub_actions if sub.iri == iri] if statements is not None else []
    found = [*fillings_of(ontology, iri), *(filling for one in more for filling in one)]
    known = {(local_name(filling.property), text(ontology, filling.term)) for filling in found}
    return known | conditions(ontology, iri)


def fillings_of(ontology: Ontology, iri: str) -> Iterator[Any]:
    own = {restriction.span for restriction in ontology.restrictions(iri)}
    for level in fillings(ontology, iri):
        yield from (filling for filling in level if filling.span in own)


def conditions(ontology: Ontology, iri: str) -> set[tuple[str, str]]:
    return {
        ("conditionEvaluated", text(ontology, restriction.filler))
        for restriction in ontology.restrictions(iri)
        if local_name(restriction.property) == "conditionEvaluated"
    }


def text(ontology: Ontology, term: object) -> str:
    if isinstance(term, Literal):
        return term.value
    if isinstance(term, BNode):
        inner = [member for member in ontology.members(term) if isinstance(member, str)]
        inner += [f"{local_name(one.property)}={text(ontology, one.filler)}" for one in ontology.restrictions(term)]
        return " and ".join(map(local_name, inner))
    return local_name(str(term))


def told(value: dict[str, Any]) -> str:
    if "iri" in value:
        return local_name(value["iri"])
    if "literal" in value:
        return str(value["literal"])
    if "restriction" in value:
        return f"{value['restriction']}={told(value['value'])}"
    return " and ".join(told(one) for one in value["and"])


def parameters(found: list[dict[str, Any]]) -> set[tuple[str, str]]:
    return {(one["property"], told(one["value"])) for one in found if one["property"] != "lispClass"}


def facts_of(actions: Actions, task: dict[str, Any]) -> Iterator[tuple[str, object, object]]:
    """Fact, what the truth holds, what the reader finds."""
    iri, ontology = canonical(task["task"]), actions.ontology
    recipe, undefined = read_recipe_of(actions, iri), undefined_in(task)
    statements = actions.statements(iri)
    assert statements is not None
    steps = {step.iri: step for step in recipe.steps}
    if iri.split("#")[0] not in expand("Action"):  # classes of the vocabulary have labels of our own
        yield "label", (task["label"] or [None])[0], recipe.label
    yield "dialect", dialect(task), recipe.dialect.name
    yield "superclasses", set(map(canonical, task["superclasses"])) - set(ontology.parents(iri)), set()
    yield "sub-actions", set(map(canonical, task["subactions"])), set(statements.names)
    yield "steps", set(map(canonical, task["subactions"])) - undefined, set(steps)
    orders = [one for one in statements.orderings if one.reason is Reason.CONSTRAINT]
    yield "constraints", pairs(task["constraints"]), {(one.before, one.after) for one in orders}
    yield "number of constraints", task["n_constraints_asserted"], len(orders)
    whole = nx.DiGraph((one.before, one.after) for one in orders)
    whole.add_nodes_from(statements.names)
    order: Precedence[str] = Precedence(whole.nodes, whole.edges)
    yield "reduction", pairs(task["transitive_reduction"]), set(order.reduction())
    yield "closure", task["closure_pairs"], order.number_of_pairs()
    yield "linear extensions", task["linear_extensions"], linear_extensions(whole)
    yield "total order", task["total_order"], order.number_of_pairs() == len(whole) * (len(whole) - 1) // 2
    if task["total_order"]:
        yield "order", tuple(map(canonical, task["order"])), order.extension
    among = {step: set(nx.descendants(stated_order(task, undefined), step)) for step in steps}
    if recipe.machine is None:
        graph = order_graph(steps, ((one.before, one.after) for one in recipe.orderings))
        yield "order of steps", among, {step: set(nx.descendants(graph, step)) for step in steps}
    for name, action in task["actions"].items():
        step = canonical(name)
        yield f"parameters of {local_name(step)}", parameters(action["params"]), stated(ontology, step, actions, iri)
        above = {canonical(one) for one in action["superclasses"]}
        yield f"superclasses of {local_name(step)}", above - set(ontology.parents(step)), set()
        if action["label"] and step in steps and steps[step].label is not None:
            yield f"label of {local_name(step)}", action["label"][0], steps[step].label
    yield "parameters of the task", parameters(task["task_params"]), stated(ontology, iri, actions, iri)
    nested = {name for name in steps if actions.statements(name) is not None and name in recipes_for(actions, name)[0]}
    yield "nested", set(map(canonical, task["nested"])), nested
    inherited = {
        local_name(name): {local_name(one) for one in step.recipes}
        for name, step in steps.items()
        if name not in nested
    }
    yield (
        "nested through a superclass",
        {name: set(classes) for name, classes in task["nested_via_superclass"].items()},
        {name: classes for name, classes in inherited.items() if classes},
    )
    if "fsm" in task:
        yield from states_of(recipe, task["fsm"])


def states_of(recipe: Recipe, fsm: dict[str, Any]) -> Iterator[tuple[str, object, object]]:
    machine = recipe.machine
    assert machine is not None
    yield "start", fsm["start"], [machine.start]
    yield "ends", set(fsm["end"]), set(machine.ends)
    found = {(one.source, one.target, local_name(one.outcome or "")) for one in machine.transitions}
    yield "transitions", {(a, b, outcome) for a, b, outcomes in fsm["transitions"] for outcome in outcomes}, found
    graph = nx.DiGraph((one.source, one.target) for one in machine.transitions)
    yield "loop", fsm["cyclic"], not nx.is_directed_acyclic_graph(graph)
    yield "reachable", set(fsm["reachable_from_start"]), {machine.start, *nx.descendants(graph, machine.start)}
    yield "outcomes", set(fsm["outcomes"]), {local_name(one.outcome or "") for one in machine.transitions}


def compared(file: str, task: str, facts: Iterator[tuple[str, object, object]]) -> None:
    for fact, expected, found in facts:
        if (file, task, fact) in EXCEPTIONS:
            assert found != expected, f"{file}, {task}, {fact}: no exception any more"
        else:
            assert found == expected, f"{file}, {task}: {fact}"


@pytest.mark.parametrize("file", CLASS_RECIPES)
def test_tasks_of_the_file_are_found(corpus: Path, file: str) -> None:
    expected = {canonical(task["task"]) for task in truth(corpus, file)["tasks"]}
    assert set(stated_tasks(opened(corpus / file))) == expected


@pytest.mark.parametrize("file", CLASS_RECIPES)
def test_recipes_are_what_the_truth_holds(corpus: Path, file: str) -> None:
    for task in truth(corpus, file)["tasks"]:
        compared(file, local_name(task["task"]), facts_of(opened(corpus / file), task))


@pytest.mark.parametrize("file", CLASS_RECIPES)
def test_anomalies_are_diagnostics(corpus: Path, file: str) -> None:
    actions, known = opened(corpus / file), truth(corpus, file)
    for task in known["tasks"]:
        found = (
            *actions.ontology.diagnostics,
            *read_recipe(actions, canonical(task["task"])).diagnostics,
        )
        codes = {diagnostic.code for diagnostic in found}
        for anomaly in (*task["anomalies"], *known.get("file_anomalies", ()), *known.get("repairs", ())):
            is_excepted = (file, local_name(task["task"]), anomaly) in EXCEPTIONS
            if not is_excepted and not anomaly.startswith(tuple(LEGAL)):
                wanted = next(codes for beginning, codes in SAID.items() if anomaly.startswith(beginning))
                assert codes & wanted, f"{local_name(task['task'])}: {anomaly}"


@pytest.mark.parametrize("file", [file for file in CLASS_RECIPES if file.startswith("recipes/")])
def test_designators_are_what_the_truth_holds(corpus: Path, file: str) -> None:
    ontology, known = opened(corpus / file).ontology, truth(corpus, file)
    for iri, facts in known["location_designators"].items():
        place = read_place(ontology, canonical(iri))
        assert is_place(ontology, canonical(iri))
        assert len(place.relations) == len(facts["relations"])
        expected = {local_name(target) for _, target in facts["relations"]}
        assert {reference.name for reference in place.references()} == expected
    for iri, cls in known["object_designators"].items():
        thing = read_thing(ontology, canonical(iri))
        assert cls in map(local_name, ontology.types(canonical(iri)))
        if thing is not None:
            assert local_name(thing.stated) == cls


def test_the_chunks_of_a_table_are_linked_as_the_truth_holds(corpus: Path) -> None:
    actions = opened(corpus / TABLE)
    (task,) = stated_tasks(actions)
    recipe = read_recipe_of(actions, task)
    found = {(local_name(one.before), local_name(one.after)) for one in recipe.orderings}
    links = truth(corpus, TABLE)["links"]
    chained = {(a, b) for a, word, b in links if word == "nextAction"}
    chained |= {(b, a) for a, word, b in links if word == "previousAction"}
    assert found == chained
    assert {(local_name(task), step.name) for step in recipe.steps} >= {
        (a, b) for a, word, b in links if word == "subAction"
    }
    assert {step.name for step in recipe.steps} == {name for pair in chained for name in pair}
    assert [step.action for step in recipe.steps] == ["GraspingSomething", "PuttingDownAnObject"]
    assert recipe.dialect.name == "D4"
    assert {"O007"} <= {diagnostic.code for diagnostic in actions.ontology.diagnostics}


def test_the_relations_of_a_workflow_are_what_the_truth_holds(corpus: Path) -> None:
    actions, known = opened(corpus / WORKFLOW), truth(corpus, WORKFLOW)
    (task,) = stated_tasks(actions)
    recipe = read_recipe_of(actions, task)
    assert recipe.dialect.name == "D5"
    assert known["defines"] == {
        local_name(name): [recipe.name] for name in workflow.workflows_of(actions.ontology, task)
    }
    assert [sorted(steps) for steps in known["workflows"].values()] == [sorted(step.name for step in recipe.steps)]
    names = [recipe.iri, *(step.iri for step in recipe.steps)]
    found = [
        [local_name(a), relation, local_name(b)] for a, relation, b, _ in workflow.relations(actions.ontology, names)
    ]
    assert sorted(found) == sorted(known["relations"])
    orders = [one for one in recipe.orderings if one.reason is Reason.CONSTRAINT]
    precedence = {(local_name(one.before), local_name(one.after)) for one in orders}
    assert precedence == {tuple(pair) for pair in known["precedence"]}
    order: Precedence[str] = recipe_order(recipe)
    reduction = {(local_name(a), local_name(b)) for a, b in order.reduction()}
    assert reduction == {tuple(pair) for pair in known["transitive_reduction"]}
    assert {(local_name(one.first), one.relation.value) for one in recipe.overlaps} == {
        ("Cracking_0", "starts"),
        ("FlippingAPancake_0", "finishes"),
    }


def test_every_truth_file_of_a_recipe_is_compared(corpus: Path) -> None:
    recipes = {f"recipes/{path.name}" for path in (corpus / "recipes").iterdir()}
    assert recipes == {file for file in (*CLASS_RECIPES, TABLE, WORKFLOW) if file.startswith("recipes/")}
    assert len(recipes) == 15


@pytest.mark.parametrize("file", [file for file in CLASS_RECIPES if "serve_drink" in file])
def test_parameters_of_steps_are_what_the_file_fills_in(corpus: Path, file: str) -> None:
    actions = opened(corpus / file)
    for task in truth(corpus, file)["tasks"]:
        for step in read_recipe_of(actions, canonical(task["task"])).steps:
            expected = {
                (p["property"].replace("bodyPartsUsed", "deviceUsed"), local_name(p["value"]["iri"]))
                for p in task["actions"][step.iri]["params"]
            }
            found = {(p.property, getattr(p.filler, "name", None) or local_name(p.filler.iri)) for p in step.parameters}
            assert found == expected
