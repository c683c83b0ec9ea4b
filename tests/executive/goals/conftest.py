"""True worlds of bundled maps, in which goals are decided."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest

from executive.goals import Judge, Verdict
from executive.goals.reading import read_goals
from executive.maps import SemanticMap, read_map, scene_of
from executive.robots import Robot
from executive.runs.phrases import lexicon_of
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import load
from sim import PyBulletWorld, Scene


@dataclass
class World:
    """A map and the true world of its scene."""

    map: SemanticMap
    truth: PyBulletWorld
    radius: float

    @property
    def scene(self) -> Scene:
        """The scene of the map."""
        return self.truth.scene

    def judge(self, *phrases: str) -> Judge:
        """Read goals before something happens."""
        return Judge(self.read(*phrases), self.truth, self.map, self.radius)

    def read(self, *phrases: str) -> tuple[object, ...]:
        """Read goals. Raises BadInput."""
        substances = (one.type for body in self.scene.bodies for one in body.content)
        return read_goals(phrases, lexicon_of(self.map, substances), self.map, self.scene)

    def decide(self, phrase: str) -> Verdict:
        """Decide a goal in the world as it is."""
        return self.judge(phrase).verdicts()[0]

    def put(self, name: str, x: float, y: float, z: float) -> None:
        """Place a thing, which falls if nothing is below it."""
        self.truth.set_pose(name, Pose((x, y, z)))
        self.truth.gravity.begin(name, ())


MakeWorld = Callable[[str], World]


@pytest.fixture
def make_world(amigo: Robot) -> Iterator[MakeWorld]:
    """Make the world of a bundled map, with Amigo in it."""
    with ExitStack() as stack:

        def make(name: str) -> World:
            semantic_map = read_map(load(bundled("ontologies") / "environments" / f"{name}.omn"))
            truth = PyBulletWorld(scene_of(semantic_map), amigo.body())
            stack.callback(truth.close)
            return World(semantic_map, truth, amigo.base.radius)

        yield make
