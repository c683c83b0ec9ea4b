"""Rooms with one door or drawer in them, drawn by a seed, and robots that stand there."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from executive.maps import MapObject, SemanticMap, scene_of
from executive.modules.bundled import bundled_registry
from executive.modules.platform import Platform
from executive.robots import Robot, bind_robot
from executive.robots.arms import with_carrying
from executive.runs.assembly import RobotExecutive, platform_of, world_at_start
from planlang import SimulationHost, perform, run
from planlang.designators import Object, action
from planlang.faults.drawing import Draw
from planlang.faults.named import read_faults
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import Ontology, expand, load
from planlang.protocols import RobotInterface
from sim import PyBulletWorld, Scene
from sim.faults.faulty_robot import FaultyRobot
from sim.faults.faulty_world import FaultyWorld
from sim.faults.injection import Injection

PLACE = "http://example.org/leaves.owl#"
DRAWERS = 0.4
"""Share of drawers."""
KNOBS = 0.15
"""Share of leaves with a knob instead of a bar."""
START, BOUNDS = (-1.2, 0.0, 0.0), (-4.0, -4.0, 4.0, 4.0)


@cache
def vocabulary() -> Ontology:
    """The bundled classes and properties."""
    return load(bundled("ontologies") / "environments" / "hospital_room.omn")


@cache
def robot_of(name: str) -> Robot:
    """A bundled robot that has a posture to drive in."""
    return with_carrying(bind_robot(name))


def thing(name: str, cls: str, pose: Pose, size: tuple[float, float, float], *parts: str) -> MapObject:
    """A thing of a map."""
    return MapObject(PLACE + name, name, (expand(cls),), pose, size, tuple(PLACE + part for part in parts))


def drawn(seed: int) -> tuple[MapObject, ...]:
    """A cabinet whose front is at x = 0.6 and faces the robot, with a door or a drawer, by a seed."""
    rng = np.random.default_rng(seed)
    slides = rng.uniform() < DRAWERS
    width, height = rng.uniform(0.3, 0.6), rng.uniform(0.12, 0.3) if slides else rng.uniform(0.3, 0.8)
    depth, z, side = rng.uniform(0.35, 0.55), rng.uniform(0.55, 1.15), rng.choice((-1.0, 1.0))
    thick, gap, length = rng.uniform(0.008, 0.02), rng.uniform(0.02, 0.04), rng.uniform(0.1, min(0.25, 0.8 * width))
    knob = rng.uniform() < KNOBS
    back = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))  # the x axis of furniture points to its front

    def at(x: float, y: float, up: float) -> Pose:
        return Pose((x, y, up)) @ back

    y = 0.0 if slides else -side * (width / 2 - rng.uniform(0.03, 0.06))
    size = (0.03, 0.03, 0.03) if knob else (thick, length, thick) if slides else (thick, thick, length)
    grip = thing("grip", "ControlKnob" if knob else "Handle", at(0.58 - gap - size[0] / 2, y, z), size)
    if slides:
        leaf = thing("leaf", "Drawer", at(0.58 + depth / 2, 0.0, z), (depth, width, height), "grip")
    else:
        leaf = thing("leaf", "Door", at(0.6 - 0.01, 0.0, z), (0.02, width, height), "grip")
    tall = min(2 * z, z + height / 2 + 0.2)
    case = thing(
        "case", "Cabinet-PieceOfFurniture", at(0.6 + depth / 2, 0.0, tall / 2), (depth, 2 * width, tall), "leaf"
    )
    return (case, leaf, grip)


@dataclass(frozen=True, slots=True)
class Room:
    """A robot in a room: what is true, what it believes, and the executive."""

    truth: PyBulletWorld
    platform: Platform
    executive: RobotExecutive

    def designator(self, name: str) -> Object:
        """The designator of a thing."""
        return self.platform.scene.bodies.designator(name)

    def do(self, kind: str, name: str, *, steps: int = 30_000) -> None:
        """Perform an action about a thing; raises its failure."""

        self.run(lambda: perform(action(kind, object_acted_on=self.designator(name))), steps=steps)

    def run(self, plan: Callable[[], Awaitable[Any]], *, steps: int = 30_000) -> None:
        """Run a plan; raises its failure."""
        run(plan, host=SimulationHost(self.truth), executive=self.executive, max_steps=steps)


def room(
    stack: ExitStack,
    things: tuple[MapObject, ...],
    robot: str = "amigo",
    *,
    truth: tuple[MapObject, ...] | None = None,
    start: tuple[float, float, float] = START,
    trusts_map: bool = False,
    faults: tuple[str, ...] = (),
) -> Room:
    """A room with things in it, of which ``truth`` are there, in which ``faults`` happen; ``stack`` ends its worlds."""
    there = scene_of(SemanticMap(None, vocabulary(), truth or things, ()))
    believed = SemanticMap(None, vocabulary(), things, ())
    return staged(stack, believed, there, robot, start, trusts_map=trusts_map, faults=faults)


def staged(
    stack: ExitStack,
    semantic_map: SemanticMap,
    there: Scene,
    robot: str,
    start: tuple[float, float, float],
    *,
    trusts_map: bool = False,
    faults: tuple[str, ...] = (),
) -> Room:
    """A robot in a world that it believes to be as its map says; ``stack`` ends its worlds."""
    bound = robot_of(robot)
    low, high = np.minimum(BOUNDS[:2], there.bounds[:2]), np.maximum(BOUNDS[2:], there.bounds[2:])
    bounds = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    believed = world_at_start(replace(scene_of(semantic_map), bounds=bounds), bound, start, stack)
    scene = replace(there, bounds=bounds, start=start)
    real = FaultyWorld(scene, bound.body()) if faults else PyBulletWorld(scene, bound.body())
    interface: RobotInterface = real
    stack.callback(real.close)
    if isinstance(real, FaultyWorld):
        hands = {arm.tip: (arm.name,) for arm in bound.arms}
        interface = FaultyRobot(Injection(real, Draw(read_faults(faults), 0.0, 0)), hands)
    platform = platform_of(bound, semantic_map, interface, believed, 0, trusts_map=trusts_map)
    return Room(real, platform, RobotExecutive(platform, bundled_registry().resolve([]), real))
