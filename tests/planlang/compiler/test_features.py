"""Plans that the compiler makes of nested recipes, parameters, devices, scopes and recoveries, on small recipes."""

from pathlib import Path
from typing import Any

import pytest
from plan_text import unbroken

from planlang.compiler import CompiledPlan, compile_recipe
from planlang.diagnostics import BadInput, Severity

HEAD = """
Prefix: : <http://planlang.org/test#>
Prefix: room: <http://planlang.org/room#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
Ontology: <http://planlang.org/test>
Import: <http://knowrob.org/kb/knowrob.owl>

Individual: room:bottle1
    Types: k:DrinkingBottle
Individual: room:cup1
    Types: k:Cup
Individual: room:patient1
    Types: k:Patient
Individual: gripper
    Types: k:HolderGripper
Individual: there
    Types: k:Point2D
    Facts: k:inReachOf room:bottle1
Individual: graspPose
    Types: k:Point3D
    Facts: k:inCenterOf room:bottle1
"""


def orderings(*pairs: str) -> str:
    """Individuals O1, O2, ... for pairs written ``A<B``."""
    lines = []
    for number, pair in enumerate(pairs, 1):
        a, b = pair.split("<")
        lines.append(f"Individual: O{number}\n    Types: k:PartialOrdering-Strict")
        lines.append(f"    Facts: k:occursBeforeInOrdering {a}, k:occursAfterInOrdering {b}")
    return "\n".join(lines)


def task(name: str, steps: str, *more: str, above: str = "k:PurposefulAction", constraints: int = 0) -> str:
    parts = [above, *(f"k:subAction some {step}" for step in steps.split()), *more]
    parts += [f"k:orderingConstraints value O{number}" for number in range(1, constraints + 1)]
    return f"Class: {name}\n    SubClassOf: {', '.join(parts)}\n"


def step(name: str, above: str, *parts: str) -> str:
    return f"Class: {name}\n    SubClassOf: {', '.join((above, *parts))}\n"


@pytest.fixture
def compiled(tmp_path: Path) -> Any:
    """Compiles a recipe given as its parts."""

    def compile_text(*parts: str, **options: Any) -> CompiledPlan:
        path = tmp_path / "test.omn"
        path.write_text("\n".join((HEAD, *parts)), encoding="utf-8")
        return compile_recipe(path, **options)

    return compile_text


def body(plan: CompiledPlan, function: str) -> str:
    """The source of one plan function, from its ``async def``."""
    return plan.source.split(f"async def {function}(")[1].split("\n\n\n")[0]


def test_steps_of_one_place_run_at_it_and_hand_places_narrow_it(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Drive Reach Close", constraints=2),
        orderings("Drive<Reach", "Reach<Close"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose", "k:deviceUsed value gripper"),
        step("Close", "k:ClosingAGripper", "k:deviceUsed value gripper"),
    )
    source = body(plan, "take")
    assert "async def at_there() -> None:" in source
    assert "reaching=(grasp_pose,)" in source
    assert 'a_location("there", in_reach_of=bottle, using=GRIPPER)' in plan.source


def test_without_scopes_a_base_motion_is_a_step_like_any_other(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Drive Reach", constraints=1),
        orderings("Drive<Reach"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
        scopes=False,
    )
    assert "at_location" not in plan.source
    written = "perform(action(RECIPE + 'Drive', below='Translation-LocationChange', to_location=there)"
    assert written in unbroken(plan.source)


def test_base_motion_that_nothing_follows_opens_no_scope(compiled: Any) -> None:
    plan = compiled(task("Go", "Drive"), step("Drive", "k:Translation-LocationChange", "k:toLocation value there"))
    assert "at_location" not in plan.source


def test_step_unordered_with_the_next_base_motion_stays_outside_without_an_object(
    compiled: Any, read_plan: Any
) -> None:
    plan = compiled(
        task("Go", "Drive Back Look", constraints=2),
        orderings("Drive<Back", "Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        "Individual: home\n    Types: k:Point2D\n    Facts: k:inReachOf room:cup1",
        step("Back", "k:Translation-LocationChange", "k:toLocation value home"),
        step("Look", "k:LookingForSomething"),
    )
    happening = read_plan(plan.source).orders("go")
    assert ("Look", "Back") not in happening.before
    assert ("Back", "Look") not in happening.before


def test_base_motion_to_a_thing_goes_where_that_is_in_reach(compiled: Any) -> None:
    plan = compiled(
        task("Go", "Drive Look", constraints=1),
        orderings("Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value room:bottle1"),
        step("Look", "k:LookingForSomething"),
    )
    assert "at_location(a_location('near-bottle1', in_reach_of=bottle), at_near_bottle" in unbroken(plan.source)


def test_place_of_a_base_that_something_else_names_too_is_described_once(compiled: Any) -> None:
    plan = compiled(
        task("Go", "Drive Look", constraints=1),
        orderings("Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Look", "k:LookingForSomething", "k:toLocation value there"),
    )
    assert plan.source.count("a_location(") == 1
    assert "at_location(there, at_there" in unbroken(plan.source)


def test_place_described_as_a_class_is_a_place(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Reach"),
        step("BesideTheCup", "k:Point3D", "k:toTheSideOf value room:cup1", "k:aboveOf some k:Table-PieceOfFurniture"),
        step("Reach", "k:Reaching", "k:toLocation some BesideTheCup"),
    )
    assert 'a_location("BesideTheCup", above=table_piece_of_furniture, next_to=cup)' in plan.source


def test_class_place_is_a_place_and_a_room_below_it_is_a_thing(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Reach Visit"),
        "Class: BesideTheCup\n    EquivalentTo: k:Place and (k:toTheSideOf value room:cup1)",
        step("Reach", "k:Reaching", "k:toLocation some BesideTheCup"),
        step("Visit", "k:Translation-LocationChange", "k:toLocation some k:Kitchen"),
    )
    assert 'a_location("BesideTheCup", next_to=cup)' in plan.source
    assert 'an_object("Kitchen")' in plan.source


def test_place_may_be_relative_to_another_place(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Reach"),
        "Individual: beyond\n    Types: k:Point3D\n    Facts: k:aboveOf graspPose, k:inReachOf room:patient1",
        step("Reach", "k:Reaching", "k:toLocation value beyond"),
    )
    assert [line.strip() for line in body(plan, "take").splitlines()[2:4]] == [
        'grasp_pose = a_location("graspPose", in_center_of=bottle)',
        'beyond = a_location("beyond", above=grasp_pose, in_reach_of=patient)',
    ]


def test_place_is_described_where_it_is_first_used_and_its_label_stands_in_the_plan_once(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Look Reach Again", constraints=2),
        orderings("Look<Reach", "Reach<Again"),
        'Individual: beyond\n    Annotations: rdfs:label "over it"\n'
        "    Types: k:Point3D\n    Facts: k:aboveOf room:cup1",
        step("Look", "k:LookingForSomething"),
        step("Reach", "k:Reaching", "k:toLocation value beyond"),
        task("Again", "Back", above="k:PurposefulAction"),
        step("Back", "k:Reaching", "k:toLocation value beyond"),
    )
    described = 'beyond = a_location("beyond", above=cup)'
    assert described in body(plan, "again")
    assert "# over it" not in body(plan, "take")
    lines = body(plan, "take").splitlines()
    (place,) = (number for number, line in enumerate(lines) if line.strip() == described)
    assert 'RECIPE + "Look"' in lines[place - 1]
    assert "to_location=beyond" in lines[place + 2]
    assert any("partial(again, cup=cup)" in line for line in lines[place:])


def test_place_that_a_called_function_has_for_another_thing_is_described_for_each(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Drive Fetch Touch", "k:objectActedOn value room:cup1", constraints=2),
        orderings("Drive<Fetch", "Fetch<Touch"),
        step("Over", "k:Point3D", "k:aboveOf some k:Cup"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        task("Fetch", "Reach", above="k:PurposefulAction"),
        step("Reach", "k:Reaching", "k:toLocation some Over", "k:objectActedOn some k:Cup"),
        step("Touch", "k:Reaching", "k:toLocation some Over"),
    )
    source = body(plan, "take")
    assert 'over = a_location("Over", above=cup_2)' in source
    assert 'over_2 = a_location("Over", above=cup)' in source
    assert "partial(fetch, cup=cup_2)" in source
    assert "to_location=over_2" in source
    assert "reaching=(over, over_2)" in source


def test_recipe_with_a_base_motion_of_its_own_ends_the_scope_of_its_caller(compiled: Any) -> None:
    plan = compiled(
        task("Outer", "Drive Fetch Reach", constraints=2),
        orderings("Drive<Fetch", "Fetch<Reach"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        task("Fetch", "DriveAgain Look", "k:orderingConstraints value P1"),
        "Individual: P1\n    Types: k:PartialOrdering-Strict\n"
        "    Facts: k:occursBeforeInOrdering DriveAgain, k:occursAfterInOrdering Look",
        step("DriveAgain", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Look", "k:LookingForSomething", "k:objectActedOn value room:bottle1"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
    )
    assert "at_location" in body(plan, "fetch")
    assert "at_location" not in body(plan, "outer")


def test_called_function_takes_the_callers_thing_of_the_same_property(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "GraspIt", above="k:PurposefulAction"),
        step("GraspIt", "Grasp", "k:objectActedOn value room:bottle1"),
        task("Grasp", "Look", "k:objectActedOn some k:DrinkingVessel", above="k:GraspingSomething"),
        step("Look", "k:LookingForSomething", "k:objectActedOn some k:DrinkingVessel"),
    )
    assert "async def grasp(*, drinking_vessel: Object = DRINKING_VESSEL) -> None:" in plan.source
    assert "partial(grasp, drinking_vessel=bottle)" in plan.source
    assert "async def serve(*, bottle: Object = BOTTLE) -> None:" in plan.source


def test_two_things_of_one_name_get_two_parameters(compiled: Any) -> None:
    plan = compiled(
        task("Look", "LookHere LookThere"),
        "Individual: bottle\n    Types: k:DrinkingBottle",
        step("LookHere", "k:LookingForSomething", "k:objectActedOn value room:bottle1"),
        step("LookThere", "k:LookingForSomething", "k:objectActedOn value bottle"),
    )
    assert "async def look(*, bottle: Object = BOTTLE, bottle_2: Object = BOTTLE_2) -> None:" in plan.source


def test_device_of_a_recipe_is_that_of_its_steps_and_of_recipes_below(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Grasp", "k:deviceUsed value gripper"),
        task("Grasp", "Close", above="k:PurposefulAction"),
        step("Close", "k:ClosingAGripper"),
    )
    assert 'action(RECIPE + "Close", below="ClosingAGripper", device_used=GRIPPER)' in plan.source


def test_recipe_nearer_than_a_primitive_is_called(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "CarefulReach"),
        task("CarefulReach", "Look", above="k:Reaching"),
        step("Look", "k:LookingForSomething"),
    )
    written = "action(RECIPE + 'CarefulReach', below='Reaching'), otherwise=careful_reach,"
    assert written in unbroken(plan.source)


def test_primitive_nearer_than_a_recipe_is_performed(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Reach"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
        "Class: k:VoluntaryBodyMovement\n    SubClassOf: k:subAction some Look",
        step("Look", "k:LookingForSomething"),
        task="Serve",
    )
    assert 'action(RECIPE + "Reach", below="Reaching", to_location=grasp_pose)' in plan.source


def test_recipes_of_two_superclasses_are_tried_in_order(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Bring"),
        step("Bring", "OneWay", "OtherWay"),
        task("OneWay", "Look", above="k:TransportationEvent"),
        task("OtherWay", "Reach", above="k:TransportationEvent"),
        step("Look", "k:LookingForSomething"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
        task="Serve",
    )
    assert "partial(try_in_order, one_way, partial(other_way, bottle=bottle))" in plan.source


def test_task_without_steps_of_its_own_takes_those_of_its_superclass(compiled: Any) -> None:
    plan = compiled(step("Mine", "Serve"), task("Serve", "Look"), step("Look", "k:LookingForSomething"), task="Mine")
    assert plan.functions == ("mine",)
    assert 'await perform(action(RECIPE + "Look", below="LookingForSomething"))' in plan.source


def test_recovery_stated_in_the_recipe_replaces_the_inherited_one(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Close"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
        "Individual: again\n    Types: k:Recovery\n"
        "    Facts: k:recoversAction Close, k:recoversFailure k:GraspMissed, k:strategy k:Repeat, k:attempts 4",
    )
    assert "Recovery(GraspMissed, attempts=4)" in plan.source
    assert "Recovery((GraspSlipped, GripperGoalNotReached), look_and_repeat(bottle)" in unbroken(plan.source)


def test_recovery_with_no_attempts_is_switched_off(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Close"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
        "Individual: never\n    Types: k:Recovery\n"
        "    Facts: k:recoversAction Close, k:recoversFailure k:GraspMissed, k:strategy k:Repeat, k:attempts 0",
    )
    assert "GraspMissed" not in plan.source


@pytest.mark.parametrize(
    ("stated", "written"),
    [
        ("k:strategy k:FetchAgain, k:escalatesTo k:ObjectUnfetchable", "fetch_again(bottle), attempts=2)"),
        ("k:strategy k:FetchAgain", "fetch_again(bottle), attempts=2, otherwise=None)"),
        ("k:strategy k:Repeat", "attempts=2)"),
        ("k:strategy k:Repeat, k:escalatesTo k:ObjectUnfetchable", "attempts=2, otherwise=ObjectUnfetchable)"),
    ],
)
def test_last_failure_is_written_unless_the_strategy_says_it(compiled: Any, stated: str, written: str) -> None:
    plan = compiled(
        task("Serve", "Close"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
        f"Individual: again\n    Types: k:Recovery\n    Facts: k:recoversAction Close, k:attempts 2, {stated},"
        " k:recoversFailure k:GraspMissed",
    )
    assert f"Recovery(GraspMissed, {written}" in unbroken(plan.source)


@pytest.mark.parametrize(("stated", "written"), [("0", "1"), ("2", "2")])
def test_number_of_places_that_a_scope_tries_is_that_of_the_recipe(compiled: Any, stated: str, written: str) -> None:
    failures = "NavigationFailure ManipulationPoseUnreachable ManipulationGoalInCollision LookingGoalUnreachable"
    plan = compiled(
        task("Serve", "Drive Look", constraints=1),
        orderings("Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value room:bottle1"),
        step("Look", "k:LookingForSomething"),
        "Individual: places\n    Types: k:Recovery\n"
        f"    Facts: k:recoversAction Drive, k:strategy k:NextSolution, k:attempts {stated}"
        + "".join(f", k:recoversFailure k:{failure}" for failure in failures.split()),
    )
    assert f"at_near_bottle, attempts={written}, by=" in unbroken(plan.source)


def test_task_that_is_run_by_itself_has_its_own_recoveries(compiled: Any) -> None:
    plan = compiled(
        task("Grasp", "Close", "k:objectActedOn value room:bottle1", above="k:GraspingSomething"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
    )
    assert "async def grasp_once() -> None:" in body(plan, "grasp")
    assert unbroken(plan.source).count("Recovery((GraspMissed,") == 1


def carrying(*after: str) -> tuple[str, ...]:
    """Statements of a recipe that grasps the bottle at one place, and then has further steps in order."""
    names = "Drive", "Grasp", *(line.split()[1] for line in after)
    return (
        task("Serve", " ".join(names), constraints=len(names) * (len(names) - 1) // 2),
        orderings(*(f"{one}<{other}" for number, one in enumerate(names) for other in names[number + 1 :])),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value room:bottle1"),
        task("Grasp", "Close", "k:objectActedOn value room:bottle1", above="k:GraspingSomething"),
        step("Close", "k:ClosingAGripper"),
        *after,
    )


def test_steps_between_a_grasp_and_the_release_go_back_to_the_grasp_when_the_thing_is_lost(compiled: Any) -> None:
    away = step("Away", "k:Translation-LocationChange", "k:toLocation value room:patient1")
    give = step("Give", "k:HandingOverAnObject", "k:objectActedOn value room:bottle1")
    back = step("Back", "k:Translation-LocationChange", "k:toLocation value room:cup1")
    text = unbroken(compiled(*carrying(away, give, back), scopes=False).source)
    assert "fetch_bottle = partial(perform," in text
    assert text.count("Recovery(ObjectLost, fetch_again(bottle), attempts=2") == 1, "around the grasp itself"
    assert text.count("Recovery(ObjectLost, fetch_again(bottle, fetch_bottle), attempts=2") == 2
    after_giving = text[text.index("perform(action(RECIPE + 'Give'") :].splitlines()[1:]
    assert [line for line in after_giving if "ObjectLost" in line] == [], "let go"


def test_letting_go_of_another_thing_leaves_the_first_one_watched(compiled: Any) -> None:
    give = step("Give", "k:HandingOverAnObject", "k:objectActedOn value room:cup1")
    look = step("Look", "k:LookingForSomething")
    text = unbroken(compiled(*carrying(give, look), scopes=False).source)
    assert text.count("fetch_again(bottle, fetch_bottle)") == 2


def test_label_of_a_step_stands_above_it(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Look"),
        'Class: Look\n    Annotations: rdfs:label "look\n around"\n    SubClassOf: k:LookingForSomething',
    )
    assert "    # look around\n    await perform(" in plan.source


def test_data_flow_orders_steps(compiled: Any, read_plan: Any) -> None:
    plan = compiled(
        task("Serve", "Reach Look", "k:inputOutputConstraints value Flow"),
        "Individual: Flow\n    Types: k:InputOutputMapping\n    Facts: k:createsOutput Look, k:requiresInput Reach",
        step("Look", "k:LookingForSomething"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
    )
    assert read_plan(plan.source).orders("serve").steps == ["Look", "Reach"]


def test_numbers_and_several_fillers_of_a_property_are_kept(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Reach"),
        step(
            "Reach",
            "k:Reaching",
            "k:linearVelocity value 0.3",
            "k:objectActedOn value room:bottle1",
            "k:objectActedOn value room:cup1",
            "k:toLocation value room:cup1",
        ),
    )
    assert "object_acted_on=(bottle, cup), to_location=cup, linear_velocity=0.3" in " ".join(plan.source.split())


def test_person_is_a_person_and_names_that_python_has_get_a_number(compiled: Any) -> None:
    plan = compiled(
        task("print", "Look"),
        step("Look", "k:LookingForSomething", "k:objectActedOn value room:patient1"),
    )
    assert "async def print_2(*, patient: Person = PATIENT) -> None:" in plan.source


def test_constants_have_numbers_only_where_they_meet_other_constants(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Look Read"),
        step("Look", "k:LookingForSomething", "k:objectActedOn value plan1"),
        step("Read", "k:LookingForSomething", "k:objectActedOn value recipe"),
        "Individual: plan1\n    Types: k:Cup\nIndividual: recipe\n    Types: k:Cup",
    )
    assert "plan_2: Object = PLAN," in plan.source, "the parameter meets the imported function, the constant does not"
    assert "\nPLAN = an_object(" in plan.source
    assert "\nRECIPE_2 = an_object(" in plan.source, "RECIPE is the namespace"


def test_properties_named_like_words_of_python_get_a_number(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Look"),
        "DataProperty: class\nDataProperty: name\nDataProperty: below",
        step("Look", "k:LookingForSomething", 'class value "first"', 'name value "second"', 'below value "third"'),
    )
    assert 'below="LookingForSomething", below_2="third", class_2="first", name_2="second")' in plan.source


def test_labels_cannot_break_out_of_docstrings(compiled: Any) -> None:
    evil = 'x\\"\\"\\"; import os #'
    plan = compiled(
        f'Class: Serve\n    Annotations: rdfs:label "{evil}"',
        "    SubClassOf: k:PurposefulAction, k:subAction some Look",
        step("Look", "k:LookingForSomething"),
    )
    compile(plan.source, "plan.py", "exec")
    assert "\nimport os" not in plan.source
    assert plan.source.count('"""') == 4


def test_all_errors_come_in_one_run(compiled: Any) -> None:
    with pytest.raises(BadInput) as found:
        compiled(
            task("Serve", "Look Lok Dance", "k:orderingConstraints value Nothing", constraints=2),
            orderings("Look<Dance", "Dance<Look"),
            step("Look", "k:LookingForSomething", "k:objectActedOn value nobody"),
            step("Dance", "k:PurposefulAction"),
        )
    codes = {d.code for d in found.value.diagnostics if d.severity is Severity.ERROR}
    assert codes == {"R011", "R012", "R020", "R033"}


def test_a_step_with_a_recipe_that_is_just_some_action_is_told_by_its_own_class(compiled: Any) -> None:
    text = task("T", "Part") + step("Part", "k:PurposefulAction", "k:subAction some Look")
    plan = compiled(text + step("Look", "k:Perceiving"))
    assert 'await perform(action(RECIPE + "Part", below="PurposefulAction"), otherwise=part)' in plan.source


def test_a_class_is_stated_where_it_is_used_once_and_else_before_all_that_uses_it(compiled: Any) -> None:
    text = task("T", "Look one two") + step("Look", "k:Perceiving") + step("Stare", "k:Perceiving")
    plan = compiled(text + "\nIndividual: one\n    Types: Stare\nIndividual: two\n    Types: Stare\n")
    assert 'STARE = action_class(RECIPE + "Stare", below="Perceiving")' in plan.source
    assert plan.source.count("perform, action(STARE), name=") == 2
    assert 'partial(perform, action(RECIPE + "Look", below="Perceiving"))' in plan.source


def test_a_class_that_is_long_beside_the_properties_of_its_step_is_stated_apart(compiled: Any) -> None:
    name = "ReachVery" + 70 * "o" + "ften"
    plan = compiled(task("T", name), step(name, "k:Reaching", "k:toLocation value graspPose"))
    assert f"action_class(RECIPE + '{name}', below='Reaching')" in unbroken(plan.source)
    assert "below=" not in body(plan, "t")


def test_an_individual_with_a_recipe_of_its_own_is_a_class_to_the_plan(compiled: Any) -> None:
    frames = [("T", "k:Action", "part"), ("part", "k:Action", "look")]
    text = "".join(
        f"\nIndividual: {name}\n    Types: {cls}\n    Facts: k:subAction {sub}\n" for name, cls, sub in frames
    )
    plan = compiled(text + "\nIndividual: look\n    Types: k:Perceiving\n", task="T")
    assert 'await perform(action(RECIPE + "part", below="Action"), otherwise=part)' in plan.source
    assert 'await perform(action("Perceiving"), name="look")' in plan.source
