"""The true world of a run where files state it: what is there, unlike what the robot believes of it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from executive.belief.obstacles import with_store
from executive.belief.scene_collisions import BasePose
from executive.maps import SemanticMap, scene_of
from executive.maps.in_hand import in_hands
from executive.modules.platform import Platform
from executive.robots import Robot
from executive.runs.assembly import platform_of, real_scene, take, world_at_start
from executive.runs.prepared import Inputs, RunFiles, read_maps
from planlang.advice import Change
from planlang.diagnostics import Diagnostic
from planlang.ontology import Ontology
from planlang.records import dataclass
from planlang.state import Hold
from sim import PlanningWorld, PyBulletWorld, Scene


@dataclass(frozen=True, slots=True)
class TrueWorld:
    """What is there: a map that the robot does not have, and its bodies."""

    map: SemanticMap
    scene: Scene
    changes: tuple[Change, ...] = ()
    """What its files change in the maps."""

    @staticmethod
    def read(
        files: RunFiles, recipes: tuple[Ontology, ...], inputs: Inputs, found: list[Diagnostic]
    ) -> TrueWorld | None:
        """Read it; None if the world is as the environment. Problems go to ``found``. Raises BadInput.

        What the run is to change in the environment is changed in the world, too, if that has the thing.
        """
        if files.world is None:
            return None
        assert files.environment is not None
        maps = files.world.maps or (files.environment, *files.additions)
        noted: list[Diagnostic] = []
        changes = files.world.changes()
        if files.changes:
            before = read_maps(maps, (), files.options, inputs, [])
            changes = (*(one for one in files.changes if before.find(str(one.thing)) is not None), *changes)
        there = replace(read_maps(maps, changes, files.options, inputs, noted), recipes=recipes)
        scene = scene_of(there, noted)
        found += [one for one in noted if one not in found]
        return TrueWorld(there, scene, changes)

    def in_hands(self, robot: Robot) -> Mapping[str, Hold]:
        """Find what the robot's hands hold at the start."""
        return in_hands(robot, self.map, self.scene)

    def as_json(self) -> dict[str, Any]:
        """What the header of a trace says of it."""
        documents = [document.sha256 for document in self.map.ontology.documents]
        changes = {"changes": [one.as_json() for one in self.changes]} if self.changes else {}
        return {"map": self.map.iri, "sha256": documents, **changes}


def worlds_at_start(
    scene: Scene,
    there: TrueWorld | None,
    robot: Robot,
    start: BasePose | None,
    seed: int,
    held: Mapping[str, Hold],
    stack: ExitStack,
) -> tuple[PlanningWorld, Scene]:
    """Make the believed world of a scene, with the robot at its start, and the true scene, displaced by the seed.

    ``held`` is believed in the hands; ``stack`` closes the world. Raises BadInput without a free start.
    """
    in_world = None if there is None else (there.scene, there.in_hands(robot))
    believed = world_at_start(scene, robot, start, stack, held, in_world)
    begins = believed.scene.start
    true_scene = believed.scene if there is None else replace(with_store(there.scene), start=begins)
    real = real_scene(true_scene, seed, believed)
    return believed, replace(real, start=begins) if robot.base.fixed else real


def take_in_hands(
    platform: Platform, truth: PyBulletWorld, held: Mapping[str, Hold], there: TrueWorld | None, stack: ExitStack
) -> None:
    """Put into the hands what the robot believes in them, and in the true world what is in them there.

    ``stack`` closes what is made for that.
    """
    if there is None:
        take(platform, truth, held)
        return
    robot = platform.robot
    if in_truth := there.in_hands(robot):
        shown = PlanningWorld(truth.scene, robot.body())
        stack.callback(shown.close)
        take(platform_of(robot, there.map, truth, shown, truth.seed), truth, in_truth)
    take(platform, None, held)
