"""Amigo in rooms that tests furnish: a true world, a belief about it, and the executive between them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest

from executive.belief import Belief
from executive.belief.obstacles import with_store
from executive.belief.planning_scene import PlanningScene
from executive.locations import Resolver
from executive.maps import MapObject, SemanticMap
from executive.modules.bundled import bundled_registry
from executive.modules.platform import Platform
from executive.robots import Robot, bind_robot
from executive.robots.arms import RobotHandle, RobotModel
from executive.runs.assembly import RobotExecutive
from executive.runs.options import Outcome, RunOptions, RunResult
from executive.runs.plan_run import run_plan_file
from planlang import SimulationHost, Trace, run
from planlang.designators import an_object
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import Ontology, expand, load, shorten
from planlang.protocols import Configuration
from sim import Body, PlanningWorld, PyBulletWorld, Scene
from sim.kinematic import KinematicScene

PLACE = "http://example.org/place.owl#"
BOUNDS = (-6.0, -6.0, 6.0, 6.0)

CABINET = Body("cabinet", Pose((1.6, 0.0, 0.4)), (0.4, 0.8, 0.8), type="Cabinet-PieceOfFurniture")
BOTTLE = Body("bottle", Pose((1.5, 0.0, 0.9)), (0.065, 0.065, 0.2), "cylinder", type="DrinkingBottle", movable=True)
BED = Body("bed", Pose((-2.5, 0.0, 0.275), (0.0, 0.0, 1.0, 0.0)), (2.0, 0.92, 0.55), type="Bed-PieceOfFurniture")
PATIENT = Body("patient", Pose((-2.7, 0.0, 0.925)), (1.5, 0.5, 0.75), "person", type="Patient")
WARD = (CABINET, BOTTLE, BED, PATIENT)
"""A bottle on a cabinet ahead of the robot, a patient in a bed behind it, nothing else far around."""

RELEASING = frozenset({"OpeningAGripper", "HandingOverAnObject"})
"""Action classes that let go of something."""

THE_BOTTLE = an_object("DrinkingBottle", PLACE + "bottle")
"""The designator of the bottle."""


@dataclass(frozen=True, slots=True)
class Stage:
    """A true world, what the robot believes of it, and the executive."""

    truth: PyBulletWorld
    platform: Platform
    executive: RobotExecutive

    @property
    def planning(self) -> PlanningWorld:
        """The world in which the robot plans."""
        return self.platform.scene.world

    @property
    def belief(self) -> Belief:
        """Return what the robot believes."""
        return self.platform.belief

    @property
    def resolver(self) -> Resolver:
        """Return what turns locations into places."""
        return self.platform.resolver

    def run(self, plan: Callable[[], Awaitable[Any]], *, steps: int = 6000, trace: Trace | None = None) -> Any:
        """Run a plan in the true world; its result."""
        return run(plan, host=SimulationHost(self.truth), executive=self.executive, max_steps=steps, trace=trace)


class MakeStage(Protocol):
    """Furnishes a room."""

    def __call__(
        self,
        *bodies: Body,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        truth: Sequence[Body] | None = None,
        bounds: tuple[float, float, float, float] = BOUNDS,
    ) -> Stage:
        """The map has ``bodies``; the truth has others of these names at other places, if it is given."""


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Yield what ends the worlds of a test."""
    with ExitStack() as stack:
        yield stack


@pytest.fixture(scope="session")
def amigo() -> Robot:
    """The bundled robot."""
    return bind_robot("amigo")


@dataclass(frozen=True, slots=True)
class Served:
    """The bundled recipe, run once: its result, its lines of progress, and its folder.

    In the folder are run.jsonl, poses.jsonl and scene.png, to be read only: all tests of the session share them.
    """

    result: RunResult
    folder: Path
    progress: Sequence[str]

    @property
    def trace(self) -> Path:
        """The trace."""
        return self.folder / "run.jsonl"


BUNDLED = RunOptions(
    recipe=bundled("recipes") / "serve_a_drink.omn",
    robot=bundled("ontologies") / "robots" / "amigo.omn",
    environment=bundled("ontologies") / "environments" / "hospital_room.omn",
)
"""What runs the bundled recipe."""


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Served:
    """A run in a world that differs from its map, and in which a first grasp is in collision."""
    folder, lines = tmp_path_factory.mktemp("served"), list[str]()
    files = {"trace": folder / "run.jsonl", "poses": folder / "poses.jsonl", "picture": folder / "scene.png"}
    result = run_plan_file(replace(BUNDLED, seed=3, progress=lines.append, **files))
    assert result.outcome is Outcome.DONE, result.message
    return Served(result, folder, lines)


@pytest.fixture(scope="session")
def vocabulary() -> Ontology:
    """The bundled classes and properties."""
    return load(bundled("ontologies") / "environments" / "hospital_room.omn")


def model_of(robot: Robot) -> RobotModel:
    """Model a robot; its arms and neck do not depend on the room."""
    world = PlanningWorld(Scene(()), robot.body())
    model = RobotModel.of(robot, world)
    world.close()
    return model


@pytest.fixture(scope="session")
def model(amigo: Robot) -> RobotModel:
    """Amigo's model."""
    return model_of(amigo)


@pytest.fixture(scope="session")
def furnish(model: RobotModel, vocabulary: Ontology) -> Iterator[MakeStage]:
    """Furnishes rooms that stay until the end of the session."""
    yield from furnisher(model, vocabulary)


@pytest.fixture
def make_stage(model: RobotModel, vocabulary: Ontology) -> Iterator[MakeStage]:
    """Furnishes rooms for one test."""
    yield from furnisher(model, vocabulary)


@pytest.fixture
def make_blind(model: RobotModel, vocabulary: Ontology) -> Iterator[MakeStage]:
    """Furnishes rooms for a robot without camera."""
    yield from furnisher(replace(model, robot=replace(model.robot, camera=None), gaze=None), vocabulary)


@pytest.fixture
def ward(make_stage: MakeStage) -> Stage:
    """A bottle on a cabinet ahead of the robot, a patient in a bed behind it."""
    return make_stage(*WARD)


def stand(stage: Stage, base: tuple[float, float, float]) -> None:
    """Put the robot somewhere, in truth and in belief."""
    now = stage.truth.configuration()
    stage.truth.set_configuration(Configuration(base, now.joints))
    stage.platform.observe()


def hold_bottle(stage: Stage, arm: str = "right", turned: float = 0.0, name: str = "bottle") -> None:
    """Put a bottle into a hand, upright with the hand in the carrying posture, and let the belief know."""
    tip = stage.platform.robot.arm(arm).tip
    there = stage.truth.link_pose(tip)
    stage.truth.set_pose(name, Pose.planar(there.position[0], there.position[1], turned, there.position[2]))
    _close(stage, arm)
    stage.truth.attach(tip, name)
    offset = there.inverse() @ stage.truth.pose(name)
    stage.belief.grasped(name, arm, tip, offset)
    stage.platform.observe()


def _close(stage: Stage, arm: str) -> None:
    """Close the fingers of a hand, in truth, as far as they feel what is between them."""
    gripper = stage.platform.robot.arm(arm).gripper
    assert gripper is not None
    for share in np.linspace(0.0, 1.0, 100):
        fingers = {name: (1 - share) * gripper.opened[name] + share * gripper.closed[name] for name in gripper.joints}
        stage.truth.set_configuration(Configuration(stage.truth.configuration().base, fingers))
        if stage.platform.between_fingers(arm) is not None:
            return


def furnisher(model: RobotModel, vocabulary: Ontology) -> Iterator[MakeStage]:
    """Yields what furnishes rooms for a robot, and ends their worlds when it is asked for more."""
    worlds: list[KinematicScene] = []

    def make(
        *bodies: Body,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        truth: Sequence[Body] | None = None,
        bounds: tuple[float, float, float, float] = BOUNDS,
    ) -> Stage:
        real = PyBulletWorld(Scene(tuple(truth or bodies), bounds, start), model.robot.body())
        believed = PlanningWorld(with_store(Scene(bodies, bounds, start)), model.robot.body())
        worlds.extend((real, believed))
        belief = Belief(SemanticMap(None, vocabulary, tuple(map(_thing, bodies)), ()), believed)
        scene = PlanningScene(believed, model, belief)
        platform = Platform(
            RobotHandle(model.robot.name, real, model),
            belief=belief,
            scene=scene,
            resolver=Resolver(scene),
            ancestors=lambda cls: tuple(map(shorten, vocabulary.ancestors(expand(cls)))),
            releasing=RELEASING,
            rng=np.random.default_rng(0),
        )
        return Stage(real, platform, RobotExecutive(platform, bundled_registry().resolve([]), real))

    yield make
    for world in worlds:
        world.close()


def _thing(body: Body) -> MapObject:
    return MapObject(PLACE + body.name, body.name, (expand(body.type),), body.pose, body.size)
