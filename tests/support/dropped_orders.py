"""Recipes from which orderings are dropped, as somebody forgets to write them."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

from planlang.ontology import load
from planlang.recipe import Actions, read_recipe
from planlang.recipe.order import recipe_order

CONSTRAINT = re.compile(r",\s*knowrob:orderingConstraints value (\S+?)(?=,|\s)")


def constraints(text: str) -> list[str]:
    """Return the names of the ordering constraints that the tasks of a recipe (Manchester syntax) state."""
    return CONSTRAINT.findall(text)


def without(text: str, dropped: Collection[str]) -> str:
    """Return a recipe without some of its ordering constraints."""
    return CONSTRAINT.sub(lambda found: "" if found[1] in dropped else found[0], text)


def ends(text: str, constraint: str) -> tuple[str, str]:
    """Return the two steps that a constraint orders."""
    found = re.search(
        rf"Individual: {constraint}\s.*?occursBeforeInOrdering (\w+),\s*knowrob:occursAfterInOrdering (\w+)",
        text,
        re.DOTALL,
    )
    assert found
    return found[1], found[2]


def is_ordered(path: Path, before: str, after: str) -> bool:
    """Return True if in some recipe of a file one step (local name) comes before another one."""
    recipes = read_recipe(Actions(load(path))).recipes
    assert recipes is not None
    for recipe in recipes.recipes.values():
        iris = {step.name: step.iri for step in recipe.steps}
        if before in iris and after in iris:
            return recipe_order(recipe).before(iris[before], iris[after])
    raise ValueError(f"no recipe has both {before} and {after}")


STEPS = {
    "GoToBottle": "Translation-LocationChange, knowrob:toLocation value bottlePlace",
    "OpenHand": "OpeningAGripper",
    "ApproachBottle": "Reaching, knowrob:toLocation value approachPose",
    "ReachForBottle": "Reaching, knowrob:toLocation value graspPose",
    "CloseHand": "ClosingAGripper",
    "LiftBottle": "Reaching, knowrob:toLocation value approachPose",
    "TuckArm": "Reaching, knowrob:toLocation value carrying",
    "GoToPatient": "Translation-LocationChange, knowrob:toLocation value patientPlace",
    "LookAtPatient": "LookingForSomething, knowrob:objectActedOn value patient1",
    "OfferBottle": "Reaching, knowrob:toLocation value offeringPose",
    "GiveBottle": "HandingOverAnObject, knowrob:objectActedOn value bottle1, knowrob:recipient value patient1",
    "TuckArmAgain": "Reaching, knowrob:toLocation value carrying",
}
"""The steps of a flat recipe in their order, each with its class and fillers."""

_PLACES = {
    "bottlePlace": "Point2D Facts: knowrob:inReachOf bottle1",
    "patientPlace": "Point2D Facts: knowrob:inReachOf patient1",
    "approachPose": "Point3D Facts: knowrob:inFrontOf-Generally bottle1",
    "graspPose": "Point3D Facts: knowrob:inCenterOf bottle1",
    "offeringPose": "Point3D Facts: knowrob:inReachOf patient1",
    "carrying": "Point3D",
    "bottle1": "DrinkingBottle",
    "patient1": "Patient",
    "gripper": "HolderGripper",
}


def twelve_steps() -> str:
    """Return a recipe of twelve flat steps, each ordered after the one before."""
    pairs = list(zip(STEPS, list(STEPS)[1:], strict=False))
    lines = [
        "Prefix: : <http://planlang.org/test#>",
        "Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>",
        "Ontology: <http://planlang.org/test>",
        "    Import: <http://knowrob.org/kb/knowrob.owl>",
    ]
    lines += [f"Individual: {name}\n    Types: knowrob:{what}" for name, what in _PLACES.items()]
    stated = [f"    knowrob:subAction some {name}" for name in sorted(STEPS)]
    stated += [f"    knowrob:orderingConstraints value {one}Then{other}" for one, other in pairs]
    lines.append("Class: Serve SubClassOf:\n    knowrob:PurposefulAction, knowrob:deviceUsed value gripper,")
    lines.append(",\n".join(stated))
    lines += [
        f"Individual: {one}Then{other}\n    Types: knowrob:PartialOrdering-Strict\n"
        f"    Facts: knowrob:occursBeforeInOrdering {one}, knowrob:occursAfterInOrdering {other}"
        for one, other in pairs
    ]
    lines += [f"Class: {name} SubClassOf: knowrob:{what}" for name, what in STEPS.items()]
    return "\n".join(lines) + "\n"
