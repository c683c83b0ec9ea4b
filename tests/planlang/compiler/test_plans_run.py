"""Compiled plans run: data flow, overlaps and states, with scripted actions."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from loaded_plans import read
from plan_text import unbroken

from planlang import given
from planlang.compiler.compile import emit, without_data_flow
from planlang.compiler.lowering import Lowering
from planlang.designators import a_location, a_posture, an_object
from planlang.failures import GraspMissed, ObjectNotFound, PlanFailure, TransitionMissing
from planlang.files import bundled
from planlang.language.loading import load_plan
from planlang.ontology import Ontology, load
from planlang.recipe import (
    Actions,
    Allen,
    Ending,
    Flow,
    Kind,
    Ordering,
    Overlap,
    Parameter,
    Reason,
    Recipe,
    RecipeSet,
    Source,
    StateMachine,
    Step,
    Thing,
    Transition,
)
from planlang.recipe.canonical import canonical
from planlang.testing import Script, explore, run_plan

BASE = "http://planlang.org/test#"
PRIMITIVE = "http://knowrob.org/kb/knowrob.owl#LookingForSomething"
THERE = a_location(near=an_object("Cup"))
CUP = Thing(Kind.OBJECT, "Cup", BASE + "cup1", "http://knowrob.org/kb/knowrob.owl#Cup")


@pytest.fixture(scope="module")
def vocabulary() -> tuple[Ontology, Actions]:
    ontology = load(bundled("recipes") / "serve_a_drink.omn")
    return ontology, Actions(ontology)


def step(name: str, *parameters: Parameter, **more: Any) -> Step:
    return Step(BASE + name, BASE + name, parameters, (), PRIMITIVE, **more)


def about_the_cup(name: str) -> Step:
    return step(name, Parameter("objectActedOn", CUP))


def before(*pairs: str) -> tuple[Ordering, ...]:
    return tuple(Ordering(BASE + a, BASE + b) for a, b in (pair.split("<") for pair in pairs))


def flows(*pairs: str) -> tuple[Flow, ...]:
    return tuple(Flow(BASE + a, BASE + b, CUP.iri, "objectActedOn") for a, b in (pair.split(">") for pair in pairs))


def recipe(*steps: Step, **more: Any) -> Recipe:
    found = Recipe(BASE + "Task", "PurposefulAction", steps, **more)
    ordered = [Ordering(flow.producer, flow.consumer, reason=Reason.DATA_FLOW) for flow in found.flows]
    return replace(found, orderings=(*found.orderings, *ordered))


@pytest.fixture
def compiled(vocabulary: tuple[Ontology, Actions]) -> Callable[..., str]:
    """The source of a recipe."""

    def source(of: Recipe, *others: Recipe) -> str:
        ontology, actions = vocabulary
        recipes = RecipeSet(of.iri, {one.iri: one for one in (of, *others)}, Source("test.omn", "0" * 64))
        found = canonical(recipes)
        return emit(Lowering(ontology, found, actions).tree(), found, "0")[0]

    return source


def plan_of(source: str) -> Any:
    return load_plan(read(source)).task


def performed(source: str, of: Iterable[str], script: Script) -> Any:
    script.performs(*of)
    return run_plan(plan_of(source), script=script)


def test_a_result_is_handed_to_the_steps_that_use_it(compiled: Callable[..., str]) -> None:
    source = compiled(
        recipe(about_the_cup("Find"), about_the_cup("Grasp"), flows=flows("Find>Grasp"), orderings=before())
    )
    text = unbroken(source)
    assert "result_of_find = await perform(action(RECIPE + 'Find', object_acted_on=cup))" in text
    assert "object_acted_on=given(result_of_find, cup)" in text
    found, seen = an_object("Cup", BASE + "cup7"), []
    script = Script().on("Find", returns=found)
    script.on("Grasp", does=lambda belief, wanted: seen.append(wanted.get("object_acted_on")))
    performed(source, ["Find", "Grasp"], script)
    assert seen == [found]


@pytest.mark.parametrize(
    ("result", "otherwise", "expected"),
    [
        (an_object("Cup"), an_object("DrinkingBottle"), an_object("Cup")),
        (an_object("Cup"), "Dough", an_object("Cup")),
        (THERE, "nextPose", THERE),
        ({"nextPose": THERE, "finished": True}, "nextPose", THERE),
        ({"Cup": an_object("Cup", "x#cup1")}, an_object("Cup"), an_object("Cup", "x#cup1")),
        ({"Bowl": an_object("Bowl")}, an_object("Cup"), an_object("Cup")),
        (THERE, a_posture("nextPose"), THERE),
        (THERE, an_object("Cup"), an_object("Cup")),
        ("Batter", "Dough", "Batter"),
        ((0.5, 1.0), "Dough", "Dough"),
        (None, an_object("Cup"), an_object("Cup")),
        ("cup", an_object("Cup"), an_object("Cup")),
        (an_object("Cup"), 0.5, 0.5),
    ],
)
def test_given_takes_a_result_of_the_kind_that_is_needed(result: Any, otherwise: Any, expected: Any) -> None:
    assert given(result, otherwise) == expected


def test_what_hands_on_nothing_leaves_what_the_recipe_says(compiled: Callable[..., str]) -> None:
    source = compiled(recipe(about_the_cup("Find"), about_the_cup("Grasp"), flows=flows("Find>Grasp")))
    seen: list[Any] = []
    script = Script().on("Find", returns=(1.0, 2.0))
    script.on("Grasp", does=lambda belief, wanted: seen.append(str(wanted.get("object_acted_on"))))
    performed(source, ["Find", "Grasp"], script)
    assert seen == ["cup1"]


@pytest.mark.parametrize(
    ("orderings", "construct"),
    [
        (("Find<Look", "Find<Grasp", "Look<Pour", "Grasp<Pour"), "par"),
        (("Find<Grasp", "Look<Grasp", "Look<Pour"), "partial_order"),
        (("Find<Grasp", "Find<Pour", "Find<Look"), "par"),
    ],
)
def test_results_cross_branches_and_leave_them(
    compiled: Callable[..., str], orderings: tuple[str, ...], construct: str
) -> None:
    steps = [about_the_cup(name) for name in ("Find", "Grasp", "Look", "Pour", "Last")]
    last = [f"{name}<Last" for name in ("Find", "Grasp", "Look", "Pour")]
    source = compiled(
        recipe(*steps, orderings=before(*orderings, *last), flows=flows("Find>Grasp", "Find>Last", "Look>Pour"))
    )
    assert f"await {construct}(" in source
    cups = {name: an_object("Cup", BASE + name.lower()) for name in ("Find", "Look")}
    seen: dict[str, str] = {}
    script = Script()
    for name, cup in cups.items():
        script.on(name, returns=cup)
    for name in ("Grasp", "Pour", "Last"):
        script.on(name, does=lambda belief, wanted: seen.update({str(wanted.type)[-4:]: wanted.get("object_acted_on")}))
    performed(source, [step.name for step in steps], script)
    assert {key: str(value) for key, value in seen.items()} == {"rasp": "find", "Pour": "look", "Last": "find"}


def test_a_called_function_is_given_what_was_found(compiled: Callable[..., str]) -> None:
    callee = Recipe(BASE + "Fetch", "PurposefulAction", (about_the_cup("Grasp"),))
    caller = recipe(
        about_the_cup("Find"),
        Step(BASE + "Fetching", BASE + "Fetching", (Parameter("objectActedOn", CUP),), (callee.iri,)),
        flows=flows("Find>Fetching"),
    )
    source = compiled(caller, callee)
    assert "partial(fetch, cup=given(result_of_find, cup))" in source


def test_without_data_flow_steps_hand_nothing_on_and_are_not_ordered(compiled: Callable[..., str]) -> None:
    one = recipe(about_the_cup("Find"), about_the_cup("Grasp"), flows=flows("Find>Grasp"))
    source = compiled(without_data_flow(RecipeSet(one.iri, {one.iri: one}, Source("test.omn", "0" * 64))).main)
    assert "given" not in source
    assert "await par(" in source


ALLEN = {
    Allen.OVERLAPS: [("One begins", "Other begins"), ("Other begins", "One ends"), ("One ends", "Other ends")],
    Allen.DURING: [("Other begins", "One begins"), ("One ends", "Other ends")],
    Allen.STARTS: [("One ends", "Other ends")],
    Allen.FINISHES: [("Other begins", "One begins")],
    Allen.EQUALS: [],
}


@pytest.mark.parametrize("durations", [(1.0, 5.0), (5.0, 1.0), (3.0, 3.0)])
@pytest.mark.parametrize("relation", Allen)
def test_steps_overlap_as_the_recipe_says_however_long_they_take(
    compiled: Callable[..., str], relation: Allen, durations: tuple[float, float]
) -> None:
    source = compiled(recipe(step("One"), step("Other"), overlaps=(Overlap(BASE + "One", relation, BASE + "Other"),)))
    script = Script().on("One", after=durations[0]).on("Other", after=durations[1])
    done = performed(source, ["One", "Other"], script)
    one, other = (done.steps(name)[0] for name in ("One", "Other"))
    assert done.overlapped("One", "Other")
    if relation in (Allen.EQUALS, Allen.FINISHES):
        assert one.end == other.end
    if relation is Allen.DURING:
        assert performing(done, "One").start >= performing(done, "Other").start
        assert one.end <= other.end


def performing(run: Any, name: str) -> Any:
    """The action of a step, without what its branch waits for before."""
    return next(one for one in run.steps() if one.kind == "perform" and one.called(name))


def test_what_overlaps_ends_before_what_comes_after_begins(compiled: Callable[..., str]) -> None:
    source = compiled(
        recipe(
            step("First"),
            step("Heat"),
            step("Stir"),
            step("Serve"),
            orderings=before("First<Stir", "Heat<Serve"),
            overlaps=(Overlap(BASE + "Stir", Allen.DURING, BASE + "Heat"),),
        )
    )
    script = Script().on("First", after=4.0).on("Heat", after=1.0).on("Stir", after=2.0)
    done = performed(source, ["First", "Heat", "Stir", "Serve"], script)
    assert done.happened_before("First", "Stir")
    assert done.happened_before("Stir", "Serve")

    def check(run: Any) -> None:
        assert run.happened_before("Stir", "Serve")
        assert run.overlapped("Stir", "Heat_then_Serve")

    explore(plan_of(source), 20, script=script, check=check)


def test_a_step_that_starts_the_recipe_begins_before_all_others(compiled: Callable[..., str]) -> None:
    source = compiled(
        recipe(
            step("Wait"),
            step("Look"),
            step("Pour"),
            orderings=before("Look<Pour"),
            overlaps=(
                Overlap(BASE + "Wait", Allen.STARTS, BASE + "Task"),
                Overlap(BASE + "Wait", Allen.FINISHES, BASE + "Task"),
            ),
        )
    )
    done = performed(source, ["Wait", "Look", "Pour"], Script().on("Pour", after=9.0))
    assert performing(done, "Wait").start <= performing(done, "Look").start
    assert done.steps("Wait")[0].end == done.steps("Pour")[0].end


def machine(*transitions: tuple[str, Ending, str | None, str]) -> Recipe:
    names = list(dict.fromkeys(name for a, _, _, b in transitions for name in (a, b)))
    found = tuple(
        Transition(BASE + a, BASE + b, ending, BASE + outcome if outcome else None)
        for a, ending, outcome, b in transitions
    )
    return recipe(*map(step, names), machine=StateMachine(BASE + names[0], (BASE + "End",), found))


SEARCH = machine(
    ("Start", Ending.DONE, None, "Look"),
    ("Look", Ending.TRUE, "CONDITION_TRUE", "End"),
    ("Look", Ending.FALSE, "CONDITION_FALSE", "Go"),
    ("Go", Ending.DONE, "COMPLETED_OK", "Look"),
    ("Go", Ending.FAILED, "FAILED", "End"),
)


def visited(source: str, of: Recipe, script: Script) -> list[str]:
    done = performed(source, [one.name for one in of.steps], script)
    _ = done.value
    return [event["to"] for event in done.events if event["event"] == "transition"]


def test_a_loop_goes_on_until_what_is_checked_is_found(compiled: Callable[..., str]) -> None:
    script = Script().on("Look", returns=False, times=2).on("Look", fails=ObjectNotFound, times=1)
    assert visited(compiled(SEARCH), SEARCH, script) == ["Look", "Go", "Look", "Go", "Look", "Go", "Look", "End"]


def test_a_failure_takes_its_transition(compiled: Callable[..., str]) -> None:
    script = Script().on("Look", returns=False).on("Go", fails=GraspMissed)
    assert visited(compiled(SEARCH), SEARCH, script) == ["Look", "Go", "End"]


def test_outcomes_by_name_lead_on(compiled: Callable[..., str]) -> None:
    choice = machine(
        ("Weigh", Ending.OTHER, "LIGHT", "End"),
        ("Weigh", Ending.OTHER, "HEAVY", "Help"),
        ("Help", Ending.DONE, None, "End"),
    )
    source = compiled(choice)
    assert visited(source, choice, Script().on("Weigh", returns="HEAVY")) == ["Help", "End"]
    assert visited(source, choice, Script().on("Weigh", returns="LIGHT")) == ["End"]
    with pytest.raises(TransitionMissing):
        visited(source, choice, Script().on("Weigh", returns="HUGE"))


def test_states_stand_in_the_order_in_which_they_are_reached(compiled: Callable[..., str]) -> None:
    source = compiled(SEARCH)
    places = [source.index(f'"{name}":') for name in ("Start", "Look", "Go", "End")]
    assert places == sorted(places)


def test_real_finite_state_recipe_runs_to_its_end(corpus: Path, vocabulary: tuple[Ontology, Actions]) -> None:
    from planlang.recipe import read_recipe

    ontology = load(corpus / "recipes" / "object-search-recipe@hydro.owl")
    actions = Actions(ontology)
    recipes = read_recipe(actions).recipes
    assert recipes is not None
    found = canonical(recipes)
    source = emit(Lowering(ontology, found, actions).tree(), found, "0")[0]
    script = Script().on("check-if-found", returns=False, times=3)
    script.performs(*(step.action for step in recipes.main.steps))
    done = run_plan(load_plan(read(source)).find_bottle, script=script)
    assert done.value is None
    assert done.attempts("go-to-next-best-pose") == 4
    assert done.attempts("upload-vslam-map") + done.attempts("upload_vslam_map") >= 1


def test_failures_of_other_states_leave_the_machine(compiled: Callable[..., str]) -> None:
    with pytest.raises(PlanFailure):
        visited(compiled(SEARCH), SEARCH, Script().on("Start", fails=GraspMissed))
