"""A fix that a person accepts never makes the recipe worse: checks and the order of the plan judge each one.

A scripted robot runs the plans here, and judges the judgement.
"""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from dropped_orders import STEPS, constraints, is_ordered, twelve_steps, without

from planlang.diagnostics import Severity
from planlang.files import bundled
from planlang.ontology import load
from planlang.recipe import Actions, read_recipe
from planlang.recipe.fixes.fixing import Fixed, fix_recipe
from tests.support.examples import some
from tests.support.rehearsal import rehearse

ORDERS = ("R040", "R042", "R045", "R039")
BUNDLED = [path for path in sorted(bundled("recipes").glob("*.omn")) if constraints(path.read_text(encoding="utf-8"))]
PAIRS = list(zip(STEPS, list(STEPS)[1:], strict=False))


def fixed(path: Path, *accepted: str) -> tuple[Fixed, Path]:
    """Fix a recipe; return the fixes, and the file of the fixed recipe."""
    found = fix_recipe(path, accepted=frozenset(accepted))
    after = path.with_name("fixed.omn")
    after.write_text(found.after, encoding="utf-8")
    return found, after


@pytest.mark.parametrize(("before", "after"), some(PAIRS, every=12))
def test_the_one_ordering_that_was_forgotten_of_twelve_steps_is_the_one_that_is_added(
    tmp_path: Path, before: str, after: str
) -> None:
    path = tmp_path / "twelve.omn"
    path.write_text(without(twelve_steps(), [f"{before}Then{after}"]), encoding="utf-8")
    found, result = fixed(path, *ORDERS)
    assert len(found.done) == 1
    assert is_ordered(result, before, after)
    assert rehearse(result) == ((), "")


@pytest.mark.parametrize("seed", some(range(30), every=30))
@pytest.mark.parametrize("recipe", some(BUNDLED, every=2), ids=lambda path: path.stem)
def test_a_fix_of_forgotten_orderings_never_yields_a_plan_that_goes_worse(
    tmp_path: Path, recipe: Path, seed: int
) -> None:
    text = recipe.read_text(encoding="utf-8")
    names, chance = constraints(text), random.Random(f"{recipe.stem} {seed}")
    dropped = chance.sample(names, k=chance.randint(1, len(names)))
    path = tmp_path / recipe.name
    path.write_text(without(text, dropped), encoding="utf-8")
    before = rehearse(path)
    _, result = fixed(path, *chance.sample(ORDERS, k=chance.randint(1, len(ORDERS))))
    after = rehearse(result)
    assert before is None or after is not None, dropped
    if after is not None:
        assert set(after.unmet) <= set(before.unmet if before is not None else ()), dropped
        assert not after.failure or before is None or before.failure, dropped


def ordered(text: str, *pairs: tuple[str, str]) -> str:
    """Return a recipe with further orderings."""
    stated = "".join(f",\n    knowrob:orderingConstraints value More{number}" for number in range(len(pairs)))
    more = "".join(
        f"Individual: More{number}\n    Types: knowrob:PartialOrdering-Strict\n"
        f"    Facts: knowrob:occursBeforeInOrdering {one}, knowrob:occursAfterInOrdering {other}\n"
        for number, (one, other) in enumerate(pairs)
    )
    head, _, tail = text.partition("\nIndividual: GoToBottleThenOpenHand")
    return f"{head}{stated}\nIndividual: GoToBottleThenOpenHand{tail}{more}"


def test_handing_over_before_driving_to_the_person_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "twelve.omn"
    between = ["CloseHandThenLiftBottle", "OfferBottleThenGiveBottle", "GiveBottleThenTuckArmAgain"]
    text = ordered(without(twelve_steps(), between), ("CloseHand", "GiveBottle"), ("GiveBottle", "LiftBottle"))
    path.write_text(text, encoding="utf-8")
    recipes = read_recipe(Actions(load(path)))
    (found,) = (one for one in recipes.diagnostics if one.code == "R067")
    assert found.severity is Severity.ERROR
    assert found.message.startswith("`GiveBottle` needs near(patient1), which `GoToPatient`")
    assert found.help == "order `GoToPatient` before `GiveBottle`"


def test_the_base_motion_to_the_recipient_is_named_and_not_the_one_to_the_object(tmp_path: Path) -> None:
    dropped = [
        "GoToPatientThenLookAtPatient",
        "OfferBottleThenGiveBottle",
        "GoToBottleThenOpenHand",
        "TuckArmThenGoToPatient",
    ]
    path = tmp_path / "twelve.omn"
    path.write_text(without(twelve_steps(), dropped), encoding="utf-8")
    said = [one.message for one in read_recipe(Actions(load(path))).diagnostics if one.code == "R042"]
    assert any(one.startswith("`GoToPatient` should probably come before `GiveBottle`") for one in said)
    assert not any(one.startswith("`GoToBottle` should probably come before `GiveBottle`") for one in said)


def test_a_fix_that_would_make_the_plan_worse_is_refused_with_what_to_write_instead(tmp_path: Path) -> None:
    path = tmp_path / "twelve.omn"
    text = without(twelve_steps(), ["GoToBottleThenOpenHand", "GoToPatientThenLookAtPatient"])
    path.write_text(text, encoding="utf-8")
    found, _ = fixed(path, "R040")
    ((fix, why),) = found.refused
    assert (fix.code, found.after) == ("R040", found.before)
    assert "`GiveBottle` needs holding(bottle1), which `CloseHand`" in str(why)
    assert why.advice == "order `CloseHand` before `GiveBottle`"


def test_a_fix_that_brings_a_new_error_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "twelve.omn"
    text = without(twelve_steps(), ["GoToBottleThenOpenHand", "ReachForBottleThenCloseHand"])
    path.write_text(text, encoding="utf-8")
    refused = fix_recipe(path, accepted=frozenset(ORDERS)).refused
    assert any("`CloseHand` needs reached" in str(why) for _, why in refused)


@pytest.mark.parametrize(("written", "defined"), [("LeftGripper", "RightGripper"), ("upperShelf", "lowerShelf")])
def test_a_side_is_never_guessed(tmp_path: Path, written: str, defined: str) -> None:
    path = tmp_path / "sides.omn"
    text = twelve_steps().replace("deviceUsed value gripper", f"deviceUsed value {written}")
    path.write_text(text.replace("Individual: gripper", f"Individual: {defined}"), encoding="utf-8")
    found, _ = fixed(path, "R033")
    assert (found.done, found.after) == ((), found.before)
    (said,) = (one for one in read_recipe(Actions(load(path))).diagnostics if one.code == "R033")
    assert defined not in str(said.help)


FLAT = {
    "Drive": "Translation-LocationChange, knowrob:toLocation value inReach",
    "Approach": "Reaching, knowrob:toLocation value beforeIt",
    "OpenHand": "OpeningAGripper",
    "Reach": "Reaching, knowrob:toLocation value atIt",
    "CloseHand": "ClosingAGripper",
    "Lift": "Reaching, knowrob:toLocation value carrying",
    "DriveOn": "Translation-LocationChange, knowrob:toLocation value inReachOfGuest",
    "Offer": "Reaching, knowrob:toLocation value inReachOfGuest",
    "Give": "HandingOverAnObject, knowrob:objectActedOn value cup, knowrob:recipient value guest",
}
"""Steps of a recipe that grasps, drives and hands over by itself, without a recipe for the grasp."""
PLACES = {"inReach": "inReachOf cup", "beforeIt": "inFrontOf-Generally cup", "atIt": "inCenterOf cup"}


def flat(*pairs: tuple[str, str]) -> str:
    """The recipe with some orders."""
    stated = "".join(f",\n    knowrob:orderingConstraints value {one}Then{other}" for one, other in pairs)
    parts = "".join(f",\n    knowrob:subAction some {name}" for name in FLAT)
    lines = [
        "Prefix: : <http://example.org/flat.owl#>\nPrefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>",
        "Ontology: <http://example.org/flat.owl>\n    Import: <http://knowrob.org/kb/knowrob.owl>",
        "Individual: cup\n    Types: knowrob:Cup\nIndividual: guest\n    Types: knowrob:Person",
        "Individual: carrying\n    Types: knowrob:Point3D",
        f"Class: Serve\n    SubClassOf: knowrob:ServingFoodOrDrink{parts}{stated}",
    ]
    for name, fact in {**PLACES, "inReachOfGuest": "inReachOf guest"}.items():
        lines.append(f"Individual: {name}\n    Types: knowrob:Point3D\n    Facts: knowrob:{fact}")
    for one, other in pairs:
        facts = f"knowrob:occursBeforeInOrdering {one}, knowrob:occursAfterInOrdering {other}"
        lines.append(f"Individual: {one}Then{other}\n    Types: knowrob:PartialOrdering-Strict\n    Facts: {facts}")
    lines += [f"Class: {name}\n    SubClassOf: knowrob:{text}" for name, text in FLAT.items()]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("stated", "proposed"),
    [((), ("OpenHand", "Reach")), ((("Approach", "Reach"),), ("OpenHand", "CloseHand"))],
    ids=["one sequence", "a sequence with a branch"],
)
def test_the_gripper_is_opened_for_the_grasp_where_handing_over_lets_go_by_itself(
    tmp_path: Path, stated: tuple[tuple[str, str], ...], proposed: tuple[str, str]
) -> None:
    path = tmp_path / "flat.omn"
    chain = [pair for pair in zip(FLAT, [*FLAT][1:], strict=False) if pair != ("OpenHand", "Reach")]
    path.write_text(flat(*chain, *stated), encoding="utf-8")
    found, result = fixed(path, *ORDERS)
    assert not found.refused
    assert is_ordered(result, *proposed)
    assert rehearse(result) == ((), "")
