"""Motions under constraints: what holds at the end of each phase, evaluated anew, and what the motions bring about."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from planlang import Feature, MotionConstraint
from planlang.compiler import compile_recipe
from planlang.designators import Device
from planlang.language.loading import load_plan
from planlang.motion_constraints import a_feature
from planlang.protocols import MotionState
from planlang.state.questions import amount_of
from planlang.testing import Script, run_plan
from sim.truth import held_by, tilt
from tests.support.constraint_evaluation import beyond, value_of
from tests.support.scenarios import CORPUS, Scenario, Watched

MODELS = ("--ontologies", "corpus/ontologies", "--ontologies", "corpus/objects")
POURING, FLIPPING = "corpus/recipes/pouring@hydro.owl", "corpus/recipes/pancake-making-constr@hydro.owl"
UP = (0.0, 0.0, 1.0)
Placed = tuple[str, Feature]
"""Name of a thing, and its feature, as a file of its model states it."""


def watch_phases(watched: Watched) -> None:
    """Note the poses of all things whenever arms have come to rest, also after a motion of a single step."""
    world = watched.world
    for group in ("right", "left", "right and left"):
        motion = world._motions.get(group)
        if motion is not watched.notes.get(group) and world.motion(group).state is MotionState.DONE:
            ends = watched.notes.setdefault("ends", [])
            assert isinstance(ends, list)
            yaw = world.configuration().base[2]
            ends.append(({name: world.pose(name).matrix() for name in world.names()}, yaw))
            watched.notes[group] = motion


def watch_leaning(watched: Watched) -> None:
    """Note how far the bottle leaned before the first motion under constraints had ended [rad]."""
    if "ends" not in watched.notes:
        watched.notes["leaned"] = watched.tilts.get(BOTTLE, 0.0)


@cache
def phases_of(recipe: str) -> tuple[tuple[MotionConstraint, ...], ...]:
    """Return the constraints of each step of a recipe, as its plan has them."""
    folders = [CORPUS / "ontologies", CORPUS / "objects"]
    found: list[tuple[MotionConstraint, ...]] = []
    script = Script().performs("ITaSCMotion")
    script.on("ITaSCMotion", does=lambda belief, action: found.append(action.get("constrained_by")))
    made = compile_recipe(CORPUS / Path(recipe).relative_to("corpus"), folders=folders)
    run_plan(getattr(load_plan(made.plan_source), made.functions[-1]), script=script)
    return tuple(found)


def not_inside(watched: Watched, recipe: str, placed: Callable[[Feature], Placed]) -> Iterator[str]:
    """Yield the active constraints of a recipe that are outside at the end of a phase, by poses of the world alone."""
    phases = [phase for phase in phases_of(recipe) if any(one.weight > 0 for one in phase)]
    ends = watched.notes.get("ends", [])
    assert isinstance(ends, list)
    if len(ends) != len(phases):
        yield f"{len(ends)} motions of {len(phases)}"
    for number, (phase, (poses, yaw)) in enumerate(zip(phases, ends, strict=False), 1):
        c, s = math.cos(yaw), math.sin(yaw)
        ahead = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        for one in (one for one in phase if one.weight > 0):
            (tool, of_tool), (thing, of_thing) = placed(one.tool), placed(one.world)

            there = replace(one, tool=of_tool, world=of_thing)
            value = value_of(there, poses[tool], watched.start[thing].matrix(), ahead)
            if beyond(one, value) > 1.0:
                yield f"phase {number}: {one.name} is {value:.4f}"


# Pouring

BOTTLE, MAKER = "mondamin-pancake-mix_obt15qOO", "pancake-maker_zvH1ax5o"


def of_pouring(feature: Feature) -> Placed:
    """Return the features that repertoire.md expects."""
    if feature.path[-1] == "SupportingPlane":
        return MAKER, a_feature("PLANE", of=feature.of, position=(0.0, 0.0, 0.0), direction=(-0.0082, -0.0047, 1.0))
    assert feature.path[0] == "BottleCap"
    if feature.path[-1] == "CenterOfObject":
        return BOTTLE, a_feature("POINT", of=feature.of, position=(0.0, 0.0, 0.097))
    return BOTTLE, a_feature("LINE", of=feature.of, position=(0.0, 0.0, 0.097), direction=(0.0, 0.0, 0.009))


def poured(watched: Watched) -> Iterator[str]:
    """At least 50 ml on the maker, at most 5 % elsewhere, the bottle upright in the hand, all constraints inside."""
    state, queries = watched.world.world_state(), watched.world.queries
    there = (name for name in state.matter.origins if queries.under(state, name) == MAKER)
    on = sum(amount_of(state, name, "PancakeMix", queries) for name in there)
    content = watched.world.scene.body(BOTTLE).content
    gone = sum(one.amount for one in content) - state.matter.total(BOTTLE)
    if on < 50.0:
        yield f"{on:.0f} ml are on {MAKER}"
    if gone - on > 0.05 * gone:
        yield f"{gone - on:.0f} ml of {gone:.0f} are elsewhere"
    if held_by(watched.world, BOTTLE) != "robot":
        yield f"{BOTTLE} is held by {held_by(watched.world, BOTTLE)}"
    if (angle := math.degrees(tilt(watched.world.pose(BOTTLE)))) > 18.2:
        yield f"{BOTTLE} is tilted by {angle:.1f} degrees"
    leaned = watched.notes["leaned"]
    assert isinstance(leaned, float)
    if math.cos(leaned) < math.cos(math.radians(15.0)) - 0.005:
        yield f"{BOTTLE} leaned by {math.degrees(leaned):.1f} degrees before it was tilted"
    yield from not_inside(watched, POURING, of_pouring)


# Flipping

SPATULAS = {"LeftArm": "Spatula_LvaYsvy6", "RightArm": "Spatula_Rkpqmqf1"}
PANCAKE = "Pancake_PjkWnkr1"
FEATURES: dict[tuple[str, ...], tuple[str, Sequence[float], Sequence[float]]] = {
    ("Handle",): ("LINE", (0.0, 0.0, 0.0), (0.0, 0.0, 0.125)),
    ("BladeOfADevice",): ("PLANE", (0.0, 0.0, 0.0), (0.1, 0.0, 0.0)),
    ("BladeOfADevice", "FrontSide"): ("LINE", (0.0, 0.0, 0.0475), (0.0, 0.125, 0.0)),
    ("FlatPhysicalSurface",): ("PLANE", (0.0, 0.0, 0.0), UP),
    ("FlatPhysicalSurface", "RightSide"): ("PLANE", (0.0, -0.07, 0.0), UP),
}


def of_flipping(feature: Feature) -> Placed:
    """Return the features of the object models of spatulas and pancake."""
    kind, position, direction = FEATURES[feature.path]
    name = SPATULAS[feature.held_by.type] if isinstance(feature.held_by, Device) else PANCAKE
    return name, a_feature(kind, of=feature.of, position=position, direction=direction)


def flipped(watched: Watched) -> Iterator[str]:
    """The pancake on the maker, with its other side up, all constraints inside."""
    before, after = (watched.start[PANCAKE].rotation[:, 2], watched.world.pose(PANCAKE).rotation[:, 2])
    if float(before @ after) >= -0.9:
        yield f"{PANCAKE} was not turned: {float(before @ after):.2f}"
    if (below := watched.world.gravity.under(PANCAKE)) != MAKER:
        yield f"{PANCAKE} lies on {below}"
    yield from not_inside(watched, FLIPPING, of_flipping)


SCENARIOS = [
    Scenario(
        "pouring",
        (POURING, "--robot", "pr2", "--environment", "pouring_table", *MODELS),
        poured,
        (watch_phases, watch_leaning),
        seconds=4.0,
    ),
    Scenario(
        "flipping",
        (FLIPPING, "--robot", "pr2", "--environment", "flipping_table", *MODELS),
        flipped,
        (watch_phases,),
        seconds=15.0,
    ),
]
