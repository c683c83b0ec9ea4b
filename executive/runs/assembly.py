"""Worlds, belief and robot, put together: what a run needs before it can begin."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from itertools import chain, islice

import numpy as np

from executive.belief import Belief, SemanticMap, default_starts
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations import Resolver
from executive.modules.platform import Platform
from executive.robots import Robot
from executive.robots.arms import arm_models, gaze_of
from planlang.diagnostics import BadInput, Span, error
from planlang.ontology import Ontology, expand, shorten
from planlang.protocols import World
from sim import PlanningWorld, Scene, perturb

MOST_STARTS = 5000
"""Free base poses that are tried for one where the arms have room, too; 5,000 are a disc of 2 m in the fine grid."""


def real_scene(scene: Scene, seed: int, robot_in: PlanningWorld) -> Scene:
    """Return the scene as it might really be, by a seed; ``robot_in`` is a world with the robot at its start."""
    bands = robot_in.silhouette()
    radius, height = max(radius for _, _, radius in bands), max(high for _, high, _ in bands)
    return perturb(scene, seed, radius=radius, height=height)


def world_at_start(scene: Scene, robot: Robot, start: BasePose | None, stack: ExitStack) -> PlanningWorld:
    """Return a world with the robot at its start: where the user says, else at a free pose near the middle.

    ``stack`` closes the world. Raises BadInput when there is no free pose, or the user's is not free.
    """
    places = default_starts(scene, robot.base.radius) if start is None else iter((start,))
    first = next(places, None)
    if first is None:
        raise _nowhere()
    world = PlanningWorld(replace(scene, start=first), robot.body())
    stack.callback(world.close)
    if not world.robot.solid:
        message = "no link has a shape (<collision> or <visual>): there is nothing to find room for"
        raise BadInput([error("B015", message, Span(str(robot.urdf)))])
    if start is not None:
        _check_start(world)
        return world
    now = world.configuration()
    for place in chain((first,), islice(places, MOST_STARTS)):
        if not world.contacts(replace(now, base=place), moving=("base",)):
            break
    else:
        raise _nowhere()
    if place == first:
        return world
    world = PlanningWorld(replace(scene, start=place), robot.body())
    stack.callback(world.close)
    return world


def _nowhere() -> BadInput:
    advice = "name a pose with --start x,y,yaw"
    return BadInput([error("X003", "there is no free pose for the robot to start at", help=advice)])


def _check_start(world: PlanningWorld) -> None:
    """Raise BadInput when the robot would stand in something, or off the map."""
    x, y, yaw = world.scene.start
    x_min, y_min, x_max, y_max = world.scene.bounds
    place = f"the robot cannot start at {x:g},{y:g},{yaw:g}"
    advice = f"--start x,y,yaw with x in {x_min:g}..{x_max:g}, y in {y_min:g}..{y_max:g}"
    if not (x_min < x < x_max and y_min < y < y_max):
        raise BadInput([error("X007", f"{place}: that is off the map", help=advice)])
    touched = sorted({contact.body for contact in world.contacts()})
    if touched:
        raise BadInput([error("X007", f"{place}: it would collide with {', '.join(touched)}", help=advice)])


def platform_of(
    robot: Robot,
    semantic_map: SemanticMap,
    truth: World,
    believed: PlanningWorld,
    seed: int,
    say: Callable[[str], None] = lambda line: None,
) -> Platform:
    """Return a robot in a true and a believed world; ``say`` is told of reachability maps that have to be built."""
    belief = Belief(semantic_map, believed)
    belief.sync(believed, truth.configuration())
    planning_scene = PlanningScene(believed, robot, belief, arm_models(robot, believed), gaze_of(robot))
    ontology = semantic_map.ontology

    @cache
    def ancestors(action_type: str) -> tuple[str, ...]:
        return tuple(map(shorten, ontology.ancestors(expand(action_type))))

    return Platform(
        truth,
        robot,
        belief,
        planning_scene,
        Resolver(planning_scene, say),
        ancestors,
        releasing(ontology),
        np.random.default_rng(seed),
    )


def releasing(ontology: Ontology) -> frozenset[str]:
    """Return the action classes whose primitive says that it releases something."""
    primitives = [iri for iri in ontology.individuals(expand("Primitive")) if ontology.values(iri, expand("releases"))]
    performed = (cls for iri in primitives for cls in ontology.values(iri, expand("performsAction")))
    return frozenset(shorten(cls) for cls in performed if isinstance(cls, str))
