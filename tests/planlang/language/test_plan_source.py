"""Plans as text: what PlanSource reads in them, and what happens when they are loaded."""

from __future__ import annotations

import ast
import re
import warnings

import pytest
from examples import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_plans import KITCHEN, PLAIN, needs, read

from planlang.diagnostics import BadInput
from planlang.language.loading import load_plan
from planlang.language.plan_text import CallText, Keyword, Needs, Step
from planlang.language.source import PlanSource
from tests.support.refusals import refusal

# What a plan needs

FILLING = "Pouring", "http://example.org/kitchen.owl#Care"


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (["await perform(action('Reaching'))"], ["Reaching"]),
        (["await perform(planlang.action('Reaching'))"], ["Reaching"]),
        (["await perform(act('Reaching'))"], ["Reaching"]),
        (["await perform(action(KITCHEN + 'Pouring'))"], ["http://example.org/kitchen.owl#Pouring"]),
        (["await perform(action(KITCHEN + 'Fill', below='Pouring'))"], ["Pouring"]),
        (["await perform(action(KITCHEN + 'Fill', below=('Pouring', KITCHEN + 'Care')))"], [*FILLING]),
        (["await grasp()", "await look()"], ["ClosingAGripper", "LookingForSomething"]),
        (["await par(grasp, partial(look))"], ["ClosingAGripper", "LookingForSomething"]),
        (["await at_location(KITCHEN, reach)"], ["Translation-LocationChange", "Reaching"]),
        (["await planlang.at_location(KITCHEN, lambda: reach())"], ["Translation-LocationChange", "Reaching"]),
        (["await perform(action('GraspingSomething'), otherwise=grasp)"], ["GraspingSomething", "ClosingAGripper"]),
        (["async def inner() -> None:", "    await look()", "await par(inner)"], ["LookingForSomething"]),
        (["async def unused() -> None:", "    await look()", "await grasp()"], ["ClosingAGripper"]),
        (["wanted = action('Reaching')", "await perform(wanted)"], ["Reaching"]),
        (["seen = await perform(action('Perceiving'))"], ["Perceiving"]),
        (["if KITCHEN:", "    await look()", "else:", "    await serve()"], ["LookingForSomething"]),
    ],
)
def test_actions_are_those_of_what_the_plan_names(body: list[str], expected: list[str]) -> None:
    found = needs(*body)
    assert sorted(found.actions) == sorted(expected)
    assert found.choices == ()


def test_a_process_module_is_needed_for_what_no_branch_of_the_plan_does_instead() -> None:
    found = needs(
        "await perform(action('GraspingSomething'), otherwise=grasp)",
        "await par(partial(perform, action('Pouring'), otherwise=reach))",
        "await perform(action('Stirring'))",
    )
    assert sorted(found.modular) == ["ClosingAGripper", "Reaching", "Stirring"]


def test_plans_that_call_each_other_are_followed_once() -> None:
    found = needs("await again()", before="""
@plan
async def again() -> None:
    await serve()
    await grasp()
""")  # fmt: skip
    assert found.actions == ("ClosingAGripper",)


@pytest.mark.parametrize(
    "line",
    [
        "await try_in_order(grasp, partial(look))",
        "await par(partial(try_in_order, grasp, other=look))",
        "await try_in_order(first=grasp, look=look, name='either')",
    ],
)
def test_the_alternatives_of_a_choice_have_needs_of_their_own(line: str) -> None:
    found = needs("await reach()", line)
    assert (found.actions, len(found.choices)) == (("Reaching",), 1)
    assert [one.name for one in found.choices[0]] == ["grasp", "look"]
    assert [one.needs.actions for one in found.choices[0]] == [("ClosingAGripper",), ("LookingForSomething",)]
    assert {one.line for one in found.choices[0]} == {KITCHEN.count("\n") + 5}


def test_alternatives_that_only_the_running_plan_knows_are_all_needed() -> None:
    assert needs("await try_in_order(*(grasp, look))").actions == ("ClosingAGripper", "LookingForSomething")


def test_of_a_class_that_only_the_running_plan_knows_nothing_is_needed() -> None:
    assert needs("for cls in (KITCHEN,):", "    await perform(action(cls + 'Pouring'))") == Needs()


def test_a_plan_that_was_imported_needs_what_its_file_needs() -> None:
    source = read("from planlang import action", "class Kept:", "    WHAT = action('Reaching')", "kept: object = Kept")
    other = load_plan(read(PLAIN)).go
    assert source.needs(load_plan(source), other).actions == ("Reaching",)


def test_an_empty_superclass_is_refused_by_the_plan_and_not_by_its_reader() -> None:
    assert needs("await perform(action(KITCHEN + 'Stir', below=''))").modular == (
        "http://example.org/kitchen.owl#Stir",
    )


# What a plan reads

COOK = """
from functools import partial
from planlang import Object, Recovery, action, an_object, fetch_again, perform, plan
from planlang.failures import ObjectLost

SPOON, POT = an_object("Spoon"), an_object("Pot")

@plan("http://example.org/kitchen.owl#Stir")
async def stir(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await perform(action("CirclingMotion", object_acted_on=pot, device_used=spoon))

@plan("http://example.org/kitchen.owl#Cook")
async def cook(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await perform(
        action("Stirring", object_acted_on=pot),
        otherwise=partial(stir, spoon=spoon, pot=pot),
        recoveries=[Recovery(ObjectLost, fetch_again(spoon))],
    )

@plan("http://example.org/kitchen.owl#Serve")
async def serve(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await perform(action("Serving"), otherwise=partial(cook, spoon=spoon, pot=pot))

@plan
async def alone(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await perform(action("Serving"), otherwise=lambda: stir(spoon=spoon))

@plan
async def twice(*, spoon: Object = SPOON, pot: Object = POT) -> None:
    await twice(spoon=spoon)
"""


@pytest.mark.parametrize(
    ("task", "modules", "expected"),
    [
        ("stir", ["Stirring"], {"spoon", "pot"}),
        ("cook", [], {"spoon", "pot"}),
        ("cook", ["Stirring"], {"pot"}),
        ("serve", [], {"spoon", "pot"}),
        ("serve", ["Stirring"], {"pot"}),
        ("serve", ["Serving"], set()),
        ("alone", [], {"spoon"}),
        ("alone", ["Serving"], set()),
        ("twice", [], {"spoon"}),
    ],
)
def test_what_only_plans_need_that_modules_stand_in_for_is_not_read(
    task: str, modules: list[str], expected: set[str]
) -> None:
    source = PlanSource(COOK, "cook.py")
    module = load_plan(source)
    found = source.read_names(module, getattr(module, task), lambda cls, otherwise: cls in modules)
    assert found & {"spoon", "pot"} == expected


def test_the_plan_that_stands_behind_a_step_is_told_with_its_class() -> None:
    source = PlanSource(COOK, "cook.py")
    module, asked = load_plan(source), list[tuple[str, object]]()

    def performs(cls: str, otherwise: object) -> bool:
        asked.append((cls, otherwise))
        return False

    for plan in (module.serve, module.alone):
        source.read_names(module, plan, performs)
    assert asked == [("Serving", module.cook), ("Stirring", module.stir), ("Serving", None)]


def test_an_imported_plan_reads_what_its_file_reads() -> None:
    source, other = PlanSource(COOK, "cook.py"), load_plan(read(PLAIN))
    assert {"spoon", "pot"} <= source.read_names(load_plan(source), other.go, lambda cls, otherwise: False)


# Steps, classes, functions

TEXT = """
import planlang
from planlang import Recovery, action as act, at_location, perform, plan, action_class

RECIPE = "http://example.org/kitchen.owl#"
POUR = action_class(RECIPE + "Pour", below="Pouring")
HAND, LOOKED = an_object("Hand"), [Recovery(Seen, look, retries=2)]

@plan
async def grasp(hard=False, *, cup=CUP) -> None:
    'Grasp a cup.\\n\\nIt has to be empty.'
    wanted = act(RECIPE + "CloseHand", device_used=HAND)
    await perform(wanted, name="close", recoveries=LOOKED)

@planlang.plan(RECIPE + "Serve")
async def serve(cup=CUP) -> None:
    looked = [Recovery(Lost), Recovery(Seen, look)]
    await grasp(cup=cup)
    await perform(planlang.action(POUR, duration=2.5, outputs_created=(TEA, {MILK})), recoveries=looked)
    await planlang.at_location(PLACE, partial(grasp), by=action_class(f"{UNKNOWN}Drive"))
    await perform(act(BASE + "Offer", duration=math.inf), act(cls, duration=3), recoveries=(Recovery(Lost),))

async def helper(cup, *others) -> None:
    @plan
    async def inside() -> None:
        await partial(at_location, PLACE, by=OTHER)
"""


def test_steps_are_told_with_their_lines_names_and_recoveries() -> None:
    assert PlanSource(TEXT, "kitchen.py").steps == (
        Step("grasp", 12, 14, "CloseHand", False, "close", ("LOOKED",)),
        Step("serve", 18, 11, "grasp", True),
        Step("serve", 19, 19, "Pour", False, None, ("Recovery(Lost)", "Recovery(Seen, look)")),
        Step("serve", 20, 47, "grasp", True),
        Step("serve", 21, 19, "Offer", False, None, ("Recovery(Lost)",)),
        Step("serve", 21, 59, "cls", False, None, ("Recovery(Lost)",)),
    )


def test_behind_a_step_remain_those_after_it_and_those_of_the_plans_that_they_call() -> None:
    source = PlanSource(TEXT, "kitchen.py")
    close, first, pour, again, offer, other = source.steps
    assert source.behind(first) == (pour, again, close, offer, other)
    assert source.behind(again) == (offer, other)
    assert source.behind(close) == source.behind(other) == ()


def test_a_plan_is_entered_once_behind_a_step_even_if_it_calls_itself() -> None:
    source = read(PLAIN, "@plan", "async def again():", "    await go()", "    await again()", "    await go()")
    reaching, first, second, third = source.steps
    assert source.behind(first) == (second, third, reaching)


def test_classes_have_their_local_names_wherever_the_text_states_them() -> None:
    source = PlanSource(TEXT, "kitchen.py")
    naming = [one for one in source.calls if one.function in ("action", "action_class", "plan")]
    assert sorted((one.line, str(one.function), str(one.cls)) for one in naming) == [
        (6, "action_class", "Pour"),
        (12, "action", "CloseHand"),
        (15, "plan", "Serve"),
        (19, "action", "Pour"),
        (20, "action_class", "Drive"),
        (21, "action", "None"),
        (21, "action", "Offer"),
    ]
    assert len(source.actions) == 4


def test_calls_are_told_with_what_their_arguments_say() -> None:
    pour = "planlang.action('http://example.org/kitchen.owl#Pour', to_locaton=1, **others)"
    source = read("import planlang", pour, "x = partial(look, 1, near=cup)", "x(f(*them))")
    near, others = Keyword("near", 3, 22), (Keyword("to_locaton", 2, 56), Keyword(None, 2, 70))
    iri = "http://example.org/kitchen.owl#Pour"
    assert source.calls == (
        CallText("action", 2, 1, others, None, False, None, "Pour", iri),
        CallText("partial", 3, 5, (near,), "look", True, 1, None, None),
        CallText("x", 4, 1, (), None, False, 1, None, None),
        CallText("f", 4, 3, (), "f", False, None, None, None),
    )


def test_functions_are_told_with_parameters_words_and_lines_of_locations() -> None:
    found = PlanSource(TEXT, "kitchen.py").functions
    assert [(one.name, one.line, one.is_plan, one.parameters) for one in found] == [
        ("grasp", 10, True, ("hard", "cup")),
        ("serve", 16, True, ("cup",)),
        ("helper", 23, False, ("cup",)),
        ("inside", 25, False, ()),
    ]
    assert [one.summary for one in found] == ["Grasp a cup.", "", "", ""]
    assert [one.locations for one in found] == [(), (20,), (26,), (26,)]
    assert PlanSource(TEXT, "kitchen.py").drives == {20: "Drive"}


def test_outputs_and_waiting_are_those_that_the_text_states() -> None:
    source = PlanSource(TEXT, "kitchen.py")
    assert (sorted(source.outputs), source.waiting) == (["MILK", "TEA"], 5.5)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("from planlang import plan", True),
        ("import math, planlang.failures as f", True),
        ("from planlang.failures import GraspMissed", True),
        ("import planlanguage", False),
        ("from . import planlang", False),
        ("def f():\n    import planlang", False),
    ],
)
def test_a_plan_imports_planlang_at_the_top(line: str, *, expected: bool) -> None:
    assert read("'Words.'", line).imports_planlang is expected


# Texts that are no plan


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("x = (\n", 2, "'(' was never closed"),
        ("  x = 1\n", 2, "unexpected indent"),
        ("x = '\0'\n", 1, "null bytes"),
        ("x = " + "(" * 300 + ")" * 300, 2, "too many nested parentheses"),
        ("x = 1" + " + 1" * 50_000, 1, ""),
        ("x = " + "-" * 100_000 + "1", 1, ""),
    ],
    ids=["open", "indented", "null", "nested", "sum", "signs"],
)
def test_a_text_that_is_no_python_is_refused_with_its_line(text: str, line: int, reason: str) -> None:
    with pytest.raises(BadInput) as caught:
        _ = read("import planlang", text).steps
    (problem,) = caught.value.diagnostics
    assert (problem.code, problem.span and problem.span[:2]) == ("C002", ("kitchen.py", line))
    assert problem.message.startswith("neither a recipe nor a plan: ")
    assert reason in problem.message


def test_a_plan_that_is_nested_too_deeply_to_be_walked_through_is_refused() -> None:
    source = read(PLAIN, "@plan", "async def count():", "    return 1" + " + 1" * 930)
    module = load_plan(source)
    assert source.needs(module, module.go).actions == ("Reaching",)
    with refusal("C002"):
        source.needs(module, module.count)


@settings(max_examples=examples(500))
@given(st.text() | st.lists(st.sampled_from(re.findall(r"\s+|\w+|\W", TEXT))).map("".join))
def test_of_any_text_everything_is_read_or_it_is_refused_as_no_python(text: str) -> None:
    source = PlanSource(text, "kitchen.py")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of escapes that Python does not know
        try:
            ast.parse(text)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            with refusal("C002"):
                _ = source.steps
            return
        steps = source.steps
    assert all(one in source.behind(steps[0]) for one in steps[1:] if one.function == steps[0].function)
    assert {one.line for one in source.actions} >= {one.line for one in steps if not one.is_call}
    _ = source.calls, source.functions, source.drives, source.outputs, source.waiting, source.imports_planlang


NAMES = st.sampled_from(["Reach", "Grasp", "Pour", "Look", "Wipe"])
CLASSES = st.sampled_from(
    ['"{0}"', '"http://example.org/kitchen.owl#{0}"', 'RECIPE + "{0}"', 'f"{{RECIPE}}{0}"', "{0}"]
)
SPELLINGS = st.sampled_from(
    [
        ("from planlang import action, action_class, perform, plan", "", "action"),
        ("from planlang import action as act, action_class, perform, plan", "", "act"),
        ("import planlang as p", "p.", "p.action"),
    ]
)
BETWEEN = st.lists(st.sampled_from(["", "# action('Commented')", "x = 'action(1)'"]), max_size=2)
Written = tuple[str, int, str, bool, str | None]
"""A step: its function and line, its class or plan, whether it is a call, and its name."""


@st.composite
def plans(draw: st.DrawFn) -> tuple[str, list[Written]]:
    """Draw the text of a plan, and its steps."""
    imported, before, action = draw(SPELLINGS)
    lines = [imported, 'RECIPE = "http://example.org/kitchen.owl#"']
    lines += [f'{one} = {before}action_class(RECIPE + "{one}", below="Reaching")' for one in ("Reach", "Grasp", "Pour")]
    lines += [f'{one} = "{one}"' for one in ("Look", "Wipe")]
    expected: list[Written] = []
    for number in range(draw(st.integers(1, 3))):
        lines += [*draw(BETWEEN), f"@{before}plan", f"async def plan_{number}():", "    pass"]
        for _ in range(draw(st.integers(0, 4))):
            lines += [f"    {line}" for line in draw(BETWEEN)]
            if number and draw(st.booleans()):
                called = f"plan_{draw(st.integers(0, number - 1))}"
                lines.append(f"    await {called}()")
                expected.append((f"plan_{number}", len(lines), called, True, None))
            else:
                cls, name = draw(NAMES), draw(st.sampled_from([None, "step"]))
                stated = f", name={name!r}" if name else ""
                lines.append(f"    await {before}perform({action}({draw(CLASSES).format(cls)}, near=1){stated})")
                expected.append((f"plan_{number}", len(lines), cls, False, name))
    return "\n".join(lines) + "\n", expected


@settings(max_examples=examples(1000))
@given(plans())
def test_the_steps_of_a_plan_are_those_that_were_written_however_they_are_spelt(
    drawn: tuple[str, list[Written]],
) -> None:
    text, expected = drawn
    source = PlanSource(text, "drawn.py")
    assert [(one.function, one.line, one.what, one.is_call, one.name) for one in source.steps] == expected
    assert [one.line for one in source.actions] == [line for _, line, _, is_call, _ in expected if not is_call]
    for number, step in enumerate(source.steps):
        after = [one for one in source.steps[number + 1 :] if one.function == step.function]
        behind = source.behind(step)
        assert [one for one in behind if one.function == step.function] == after
        assert {one.function for one in behind} >= {one.what for one in after if one.is_call} - {
            one.name for one in source.functions if all(one.name != step.function for step in source.steps)
        }
