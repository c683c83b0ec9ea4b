"""What a plan takes of a robot: told from its source, with alternatives of which one is enough."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from executive.robots import Availability, FindingKind, Missing
from executive.runs.plan_files import Needs, assess, import_plan, main_plan, needs_of

HEAD = """
from functools import partial
import planlang
from planlang import action, action as act, at_location, par, perform, perform_or, plan, try_in_order

KITCHEN = "http://example.org/kitchen.owl#"
CLOSING = action("ClosingAGripper")

@plan
async def grasp(hard: bool = False) -> None:
    await perform(CLOSING)

@plan
async def reach() -> None:
    await perform(action("Reaching"))

@plan
async def look() -> None:
    await perform(planlang.action("LookingForSomething"))
"""


def needs(folder: Path, *body: str, before: str = "") -> Needs:
    """What a plan with these lines needs."""
    path = folder / "kitchen.py"
    lines = "".join(f"    {line}\n" for line in body)
    path.write_text(f"{HEAD}{before}\n@plan\nasync def serve() -> None:\n{lines}", encoding="utf-8")
    module = import_plan(path)
    return needs_of(module, main_plan(module, None))


def told(found: Needs, *unable: str) -> tuple[list[str], list[tuple[str, str]]]:
    """What a robot lacks that cannot do some classes of actions, and the alternatives that it cannot do."""

    def lacking(actions: Iterable[str]) -> tuple[Missing, ...]:
        return tuple(
            Missing(name, FindingKind.CAPABILITY, Availability.MISSING, (name,), "no")
            for name in actions
            if name in unable
        )

    assessment = assess(found, lacking)
    infeasible = [(alternative.name, why.name) for alternative, why in assessment.infeasible]
    return [missing.name for missing in assessment.missing], infeasible


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (["await perform(action('Reaching'))"], ["Reaching"]),
        (["await perform(planlang.action('Reaching'))"], ["Reaching"]),
        (["await perform(act('Reaching'))"], ["Reaching"]),
        (["await perform(action(KITCHEN + 'Pouring'))"], ["http://example.org/kitchen.owl#Pouring"]),
        (["await grasp()", "await look()"], ["ClosingAGripper", "LookingForSomething"]),
        (["await par(grasp, partial(look))"], ["ClosingAGripper", "LookingForSomething"]),
        (["await at_location(KITCHEN, reach)"], ["Translation-LocationChange", "Reaching"]),
        (["await planlang.at_location(KITCHEN, lambda: reach())"], ["Translation-LocationChange", "Reaching"]),
        (["await perform_or(action('GraspingSomething'), grasp)"], ["GraspingSomething", "ClosingAGripper"]),
        (["async def inner() -> None:", "    await look()", "await par(inner)"], ["LookingForSomething"]),
        (["async def unused() -> None:", "    await look()", "await grasp()"], ["ClosingAGripper"]),
        (["wanted = action('Reaching')", "await perform(wanted)"], ["Reaching"]),
        (["seen = await perform(action('Perceiving'))"], ["Perceiving"]),
        (["if KITCHEN:", "    await look()", "else:", "    await serve()"], ["LookingForSomething"]),
    ],
)
def test_actions_are_those_of_what_the_plan_names(tmp_path: Path, body: list[str], expected: list[str]) -> None:
    found = needs(tmp_path, *body)
    assert sorted(found.actions) == sorted(expected)
    assert found.choices == ()


@pytest.mark.parametrize(
    "line",
    [
        "await try_in_order(grasp, look)",
        "await planlang.try_in_order(partial(grasp, hard=True), look)",
        "await perform_or(action('PurposefulAction'), partial(try_in_order, grasp, look))",
        "await try_in_order(first=grasp, second=look)",
    ],
)
def test_one_feasible_alternative_is_enough(tmp_path: Path, line: str) -> None:
    found = needs(tmp_path, line)
    assert told(found) == ([], [])
    assert told(found, "ClosingAGripper") == ([], [("grasp", "ClosingAGripper")])
    assert told(found, "LookingForSomething") == ([], [("look", "LookingForSomething")])
    assert told(found, "ClosingAGripper", "LookingForSomething") == (["ClosingAGripper", "LookingForSomething"], [])


def test_local_branches_are_alternatives_too(tmp_path: Path) -> None:
    found = needs(
        tmp_path,
        "async def by_hand() -> None:",
        "    await grasp()",
        "by_eye = partial(look)",
        "await try_in_order(by_hand, by_eye)",
    )
    assert told(found, "ClosingAGripper") == ([], [("by_hand", "ClosingAGripper")])
    assert told(found, "LookingForSomething") == ([], [("by_eye", "LookingForSomething")])


def test_what_is_needed_beside_a_choice_stays_needed(tmp_path: Path) -> None:
    found = needs(tmp_path, "await try_in_order(grasp, look)", "await grasp()")
    assert told(found, "ClosingAGripper") == (["ClosingAGripper"], [("grasp", "ClosingAGripper")])


def test_choices_may_be_nested(tmp_path: Path) -> None:
    found = needs(tmp_path, "await try_in_order(either, look)", before="""
@plan
async def either() -> None:
    await try_in_order(grasp, reach)
""")  # fmt: skip
    assert told(found, "ClosingAGripper") == ([], [("grasp", "ClosingAGripper")])
    assert told(found, "ClosingAGripper", "Reaching") == ([], [("either", "ClosingAGripper")])
    assert told(found, "ClosingAGripper", "LookingForSomething") == (
        [],
        [("grasp", "ClosingAGripper"), ("look", "LookingForSomething")],
    )


def test_plans_that_are_not_called_are_not_needed(tmp_path: Path) -> None:
    assert told(needs(tmp_path, "await look()"), "ClosingAGripper", "Reaching") == ([], [])


def test_plans_that_call_each_other_are_followed_once(tmp_path: Path) -> None:
    found = needs(tmp_path, "await again()", before="""
@plan
async def again() -> None:
    await serve()
    await grasp()
""")  # fmt: skip
    assert found.actions == ("ClosingAGripper",)


def test_what_a_robot_may_lack_is_a_warning_and_refuses_nothing() -> None:
    unknown = Missing(
        "http://example.org#Juggling", FindingKind.CAPABILITY, Availability.UNKNOWN, ("Reaching",), "nobody knows"
    )
    assessment = assess(Needs(("Reaching",)), lambda actions: (unknown,))
    assert (assessment.missing, assessment.unknown) == ((), (unknown,))
    (warning,) = assessment.notes(None)
    assert (warning.code, warning.severity.value) == ("X009", "warning")
    assert "Juggling" in warning.message
