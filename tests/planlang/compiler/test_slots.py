"""Slots: what a step needs and does not state is that of the step around it, else a parameter of the plan."""

import inspect
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang import a_location, an_object
from planlang.compiler import CompiledPlan, compile_recipe
from planlang.diagnostics import BadInput, Severity
from planlang.language.loading import load_plan
from planlang.testing import Script, run_plan

HEAD = """
Prefix: : <http://planlang.org/test#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>
Import: <http://knowrob.org/kb/knowrob.owl>
Individual: cup1
    Types: k:Cup
Individual: plate1
    Types: k:DinnerPlate
Individual: table1
    Types: k:Table
Individual: there
    Types: k:Point3D
    Facts: k:aboveOf table1
Individual: gripper
    Types: k:HolderGripper
"""
ABOVE = "k:PurposefulAction"
PUT = "k:PuttingSomethingSomewhere, k:objectActedOn value cup1"


def written(classes: dict[str, str]) -> str:
    return HEAD + "".join(f"Class: {name}\n    SubClassOf: {above}\n" for name, above in classes.items())


@pytest.fixture
def compiled(tmp_path: Path) -> Any:
    """Compiles a recipe of classes, the task ``Serve`` first."""

    def compile_classes(**classes: str) -> CompiledPlan:
        path = tmp_path / "recipe.omn"
        path.write_text(written(classes), encoding="utf-8")
        return compile_recipe(path, task="Serve")

    return compile_classes


def steps(*names: str) -> str:
    return ", ".join([ABOVE, *(f"k:subAction some {name}" for name in names)])


def found(plan: CompiledPlan, code: str) -> list[str]:
    return [one.help or "" for one in plan.diagnostics if one.code == code]


def main(plan: CompiledPlan) -> Any:
    return getattr(load_plan(plan.plan_source), plan.functions[-1])


def parameters(plan: CompiledPlan) -> dict[str, Any]:
    return {name: one.default for name, one in inspect.signature(main(plan).function).parameters.items()}


def performed(plan: Any, *classes: str) -> list[dict[str, str]]:
    """The properties, as text, of what a scripted run performs of some classes."""
    script, done = Script(), []
    for name in classes:
        script.on(name, does=lambda belief, action: done.append({key: str(one) for key, one in action.properties}))
    assert run_plan(plan, script=script).failure is None
    return done


def test_what_is_not_stated_is_a_keyword_without_default_of_which_a_warning_tells(compiled: Any) -> None:
    plan = compiled(Serve=steps("PickUp"), PickUp="k:PickingUpAnObject")
    assert parameters(plan) == {"pick_up_object_acted_on": inspect.Parameter.empty}
    (advice,) = found(plan, "R062")
    assert advice.endswith('set={"PickUp.objectActedOn": X}')
    with pytest.raises(TypeError, match="missing 1 required keyword-only argument: 'pick_up_object_acted_on'"):
        run_plan(main(plan))


def test_a_scripted_run_passes_it(compiled: Any) -> None:
    plan = compiled(Serve=steps("PutCup"), PutCup=PUT)
    place = a_location(on=an_object("Table"))
    ran = performed(partial(main(plan), put_cup_to_location=place), "PutCup", "PuttingSomethingSomewhere")
    assert ran == [{"object_acted_on": "cup1", "to_location": str(place)}]


def test_each_step_of_a_task_has_its_own_parameter(compiled: Any) -> None:
    plan = compiled(Serve=steps("Put1", "Put2"), Put1=PUT, Put2=PUT)
    assert set(parameters(plan)) == {"cup", "put1_to_location", "put2_to_location"}


@pytest.mark.parametrize(
    ("stated", "passed"),
    [("k:objectActedOn value plate1", "plate"), ("k:objectActedOn some k:Cup", "cup")],
)
def test_inner_steps_inherit_what_the_step_around_them_states(compiled: Any, stated: str, passed: str) -> None:
    inner = f"k:ActionOnObject, {stated}, k:subAction some Take"
    plan = compiled(Serve=steps("Grasp"), Grasp=inner, Take="k:TakingSomething")
    assert (found(plan, "R062"), list(parameters(plan))) == ([], [passed])
    assert performed(main(plan), "Take", "TakingSomething") == [
        {"object_acted_on": "plate1" if passed == "plate" else "Cup"}
    ]


def test_a_recipe_takes_from_each_step_that_it_performs_what_its_own_steps_need(compiled: Any) -> None:
    one, other = (f"Bring, k:objectActedOn value {thing}, k:toLocation value there" for thing in ("cup1", "plate1"))
    plan = compiled(
        Serve=steps("BringCup", "BringPlate", "BringSomething"),
        BringCup=one,
        BringPlate=other,
        BringSomething="Bring",
        Bring=steps("Put"),
        Put="k:PuttingSomethingSomewhere",
    )
    names = ["bring_something_object_acted_on", "bring_something_to_location"]
    assert [name for name, default in parameters(plan).items() if default is inspect.Parameter.empty] == names
    things = {names[0]: an_object("Bowl-Eating", "http://example.org/#bowl1"), names[1]: an_object("Table")}
    done = performed(partial(main(plan), **things), "Put", "PuttingSomethingSomewhere")
    got = sorted((one["object_acted_on"], one["to_location"]) for one in done)
    assert got == [("bowl1", "Table"), ("cup1", "above(table1)"), ("plate1", "above(table1)")]


def test_of_several_things_around_a_step_none_is_chosen(compiled: Any) -> None:
    several = "k:ActionOnObject, k:objectActedOn value cup1, k:objectActedOn value plate1, k:subAction some PickUp"
    plan = compiled(Serve=steps("Clear"), Clear=several, PickUp="k:PickingUpAnObject")
    assert list(parameters(plan)) == ["cup", "plate", "clear_pick_up_object_acted_on"]
    (advice,) = found(plan, "R062")
    assert advice.endswith('set={"Clear.PickUp.objectActedOn": X}')


@pytest.mark.parametrize(
    ("motion", "more", "open"),
    [
        ("k:ITaSCMotion", "", ["object_acted_on", "device_used"]),
        ("k:ITaSCMotion", ", k:deviceUsed value gripper", ["object_acted_on"]),
        ("k:CirclingMotion", ", k:objectActedOn value cup1", ["device_used"]),
        ("k:PushingMotion", ", k:objectActedOn value cup1", []),  # its process module pushes with a free hand
    ],
)
def test_a_motion_needs_what_its_constraints_are_about(compiled: Any, motion: str, more: str, open: list[str]) -> None:
    mc = "http://knowrob.org/kb/motion-constraints.owl#"
    low = f"<{mc}HeightConstraint>, <{mc}constrUpperLimit> value 0.1"
    for feature, whole in (("tool", "DeviceUsed"), ("world", "ObjectActedOn")):
        low += f", <{mc}{feature}Feature> some (k:ObjectMainAxis and (k:physicalPartOf some k:{whole}))"
    plan = compiled(Serve=steps("Move"), Move=f"{motion}, k:constrainedBy some Low{more}", Low=low)
    asked = [name for name, default in parameters(plan).items() if default is inspect.Parameter.empty]
    assert asked == [f"move_{name}" for name in open]
    assert len(found(plan, "R062")) == len(open)
    assert not found(compiled(Serve=steps("Move"), Move=motion + ", k:objectActedOn value cup1"), "R062")


@pytest.mark.parametrize("motion", ["k:Translation-LocationChange", "k:Reaching"])
def test_a_motion_without_target_is_an_error_where_the_step_is_defined(compiled: Any, motion: str) -> None:
    with pytest.raises(BadInput) as caught:
        compiled(Serve=steps("Move"), Move=motion)
    (problem,) = (one for one in caught.value.diagnostics if one.severity is Severity.ERROR)
    assert (problem.code, problem.span.line if problem.span else 0) == ("R061", written({"Serve": ""}).count("\n") + 1)


def test_a_target_is_that_of_the_step_around_but_of_no_step_farther_out(compiled: Any) -> None:
    near = compiled(Serve=steps("Go"), Go=f"{steps('Reach')}, k:toLocation value there", Reach="k:Reaching")
    assert "to_location=there)" in near.source
    with pytest.raises(BadInput) as caught:
        compiled(
            Serve=f"{steps('Grasp')}, k:toLocation value there",
            Grasp="k:GraspingSomething, k:objectActedOn value cup1, k:subAction some Reach",
            Reach="k:Reaching",
        )
    assert [one.code for one in caught.value.diagnostics if one.code.startswith("R06")] == ["R061"]


@pytest.mark.parametrize(
    ("filler", "said"),
    [
        ("value gripper", "toLocation of `Move` is the device `gripper`, but must be a place, an object or a person"),
        ("value 3", "toLocation of `Move` is the value 3, but must be a place, an object or a person"),
        ("some k:Reaching", "toLocation of `Move` is `Reaching`, but must be a place, an object or a person"),
    ],
)
def test_a_filler_of_another_kind_is_one_error_in_its_line(compiled: Any, filler: str, said: str) -> None:
    with pytest.raises(BadInput) as caught:
        compiled(Serve=steps("Move"), Move=f"k:Translation-LocationChange, k:toLocation {filler}")
    told = [one for one in caught.value.diagnostics if one.code in ("R032", "R060")]
    assert [(one.code, one.message) for one in told] == [("R060", said)]


@pytest.mark.parametrize("device", ["LeftArm", "Arm", "LeftHand", "RightHand"])
@pytest.mark.parametrize("written_as", ["value", "some"])
def test_an_arm_or_a_hand_is_a_device(compiled: Any, device: str, written_as: str) -> None:
    uses = f"k:deviceUsed some k:{device}" if written_as == "some" else "k:deviceUsed value mine"
    stated = f"k:FetchingAnObject, k:objectActedOn value cup1, {uses}"
    fetch = f"{stated}\nIndividual: mine\n    Types: k:{device}" if written_as == "value" else stated
    plan = compiled(Serve=steps("Fetch"), Fetch=fetch)
    assert not found(plan, "R060")
    assert "device_used=" in plan.source
    assert device in plan.source


@pytest.mark.parametrize("what", ["k:DrinkingBottle", "k:Robot", "k:Table-PieceOfFurniture"])
def test_what_is_no_part_of_a_robot_is_no_device_and_the_advice_names_one(compiled: Any, what: str) -> None:
    stated = "k:FetchingAnObject, k:objectActedOn value cup1, k:deviceUsed value mine"
    with pytest.raises(BadInput) as caught:
        compiled(Serve=steps("Fetch"), Fetch=f"{stated}\nIndividual: mine\n    Types: {what}")
    (told,) = (one for one in caught.value.diagnostics if one.code == "R060")
    assert told.message == "deviceUsed of `Fetch` is the object `mine`, but must be a device"
    assert told.help is not None
    assert "`deviceUsed some LeftHand` in `Fetch`" in told.help


def test_a_recipe_may_declare_what_its_own_primitives_need(compiled: Any) -> None:
    stir = "k:PurposefulAction\nIndividual: stirring\n    Types: k:Primitive\n    Facts: k:performsAction Stir,"
    plan = compiled(Serve=steps("Stir"), Stir=f'{stir} k:processModule "stir", k:requires "recipient: person"')
    assert 'stir_recipient: Annotated[Person, "Stir.recipient"]' in plan.source


STATED = {"objectActedOn": "k:objectActedOn value cup1", "toLocation": "k:toLocation value there"}
STATING = st.lists(st.frozensets(st.sampled_from(sorted(STATED))), min_size=1, max_size=5)


@settings(max_examples=examples(100))
@given(STATING)
def test_a_task_asks_for_what_its_steps_leave_open(tmp_path_factory: Any, stating: list[frozenset[str]]) -> None:
    classes = {
        f"Put{number}": ", ".join(["k:PuttingSomethingSomewhere", *(STATED[name] for name in sorted(names))])
        for number, names in enumerate(stating)
    }
    path = tmp_path_factory.mktemp("slots") / "recipe.omn"
    path.write_text(written({"Serve": steps(*classes), **classes}), encoding="utf-8")
    plan = compile_recipe(path)
    asked = {one.rsplit('set={"', 1)[1].removesuffix('": X}') for one in found(plan, "R062")}
    assert asked == {f"Put{n}.{name}" for n, names in enumerate(stating) for name in set(STATED) - names}
    empty = [name for name, default in parameters(plan).items() if default is inspect.Parameter.empty]
    assert len(empty) == len(asked)
