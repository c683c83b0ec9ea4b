"""The compiled plans of the bundled and of a real recipe run with a robot that does what the test says."""

import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from loaded_plans import loaded

from planlang import Action, Condition, Location, VirtualHost, action, checkpoint, run
from planlang.compiler import compile_recipe
from planlang.failures import GraspMissed, LocationUnresolvable, ObjectNotFound, ObjectUnfetchable, PlanFailure
from planlang.protocols import Solution

PRIMITIVES = (
    "Translation-LocationChange",
    "Reaching",
    "OpeningAGripper",
    "ClosingAGripper",
    "LookingForSomething",
    "HandingOverAnObject",
)


@dataclass(eq=False)
class Module:
    """Performs one class of actions and notes it."""

    robot: "Robot"
    name: str
    actions: tuple[str, ...]
    failures: tuple[type[Exception], ...] = (PlanFailure,)

    def resources(self, action: Action) -> tuple[str, ...]:
        return ("base",) if self.name == "Translation-LocationChange" else ()

    async def execute(self, action: Action) -> Any:
        await checkpoint()
        self.robot.log.append(self.name)
        await self.robot.does.get(self.name, self.robot.nothing)(action)


@dataclass(eq=False)
class Robot:
    """Goes anywhere at once; closing the gripper holds the bottle, unless the test says otherwise."""

    does: dict[str, Callable[[Action], Awaitable[None]]] = field(default_factory=dict)
    log: list[str] = field(default_factory=list)
    wanted: list[Location] = field(default_factory=list)
    holding: bool = False
    base: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        self.modules: Sequence[Any] = [Module(self, name, (name,)) for name in PRIMITIVES]
        self.does.setdefault("ClosingAGripper", self.grasp)
        self.does.setdefault("Translation-LocationChange", self.drive)

    async def nothing(self, action: Action) -> None:
        """Done."""

    async def grasp(self, action: Action) -> None:
        self.holding = True

    async def drive(self, action: Action) -> None:
        x = action.get("x")
        assert isinstance(x, float)
        self.base = (x, 0.0, 0.0)

    def ancestors(self, action_type: str) -> Sequence[str]:
        return (action_type,)

    def revision(self) -> int:
        return 0

    def solutions(self, location: Location) -> Iterator[Solution]:
        self.wanted.append(location)
        start = float(len(self.wanted) * 10)
        yield from (Solution((start + number, 0.0, 0.0), 0, {}) for number in range(3))
        raise LocationUnresolvable(designator=str(location))

    def move_to(self, solution: Solution) -> Action:
        return action("Translation-LocationChange", x=solution.base[0])

    def is_at(self, solution: Solution) -> bool:
        return self.base == solution.base

    def holds(self, condition: Condition) -> bool:
        return condition.predicate == "holding" and self.holding

    def before_retry(self) -> Iterable[Action]:
        return ()

    def held(self) -> Sequence[str]:
        return ["bottle1"] if self.holding else []

    def releases(self, action: Action) -> bool:
        return action.type in ("OpeningAGripper", "HandingOverAnObject")

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Nothing of its own to write."""


@pytest.fixture(scope="module")
def golden() -> ModuleType:
    return loaded(Path(__file__).parent / "golden" / "serve_a_drink.py")


GRASP = ["Reaching", "OpeningAGripper", "Reaching", "ClosingAGripper", "Reaching", "Reaching"]
DRIVE, LOOK = "Translation-LocationChange", "LookingForSomething"


def test_golden_plan_fetches_then_hands_over(golden: ModuleType) -> None:
    robot = Robot()
    run(golden.serve_a_drink, host=VirtualHost(), executive=robot)
    assert robot.log == [DRIVE, *GRASP, DRIVE, "Reaching", "HandingOverAnObject"]
    fetching, giving = robot.wanted
    assert {relation.name for relation in fetching.relations} == {"in_reach_of"}
    assert str(fetching.relations[0].references[0]) == "bottle1"
    assert str(giving.relations[0].references[0]) == "patient1"


def test_missed_grasp_is_repeated_after_a_look_without_driving(golden: ModuleType) -> None:
    robot = Robot()
    misses = iter([True, False])

    async def close(wanted: Action) -> None:
        if next(misses):
            raise GraspMissed()
        robot.holding = True

    robot.does["ClosingAGripper"] = close
    run(golden.serve_a_drink, host=VirtualHost(), executive=robot)
    assert robot.log[:11] == [DRIVE, *GRASP[:4], "LookingForSomething", *GRASP[:5]]
    assert robot.log.count(DRIVE) == 2


def test_grasp_that_is_always_missed_ends_as_an_unfetchable_object(golden: ModuleType) -> None:
    robot = Robot()

    async def close(wanted: Action) -> None:
        raise GraspMissed()

    robot.does["ClosingAGripper"] = close
    with pytest.raises(ObjectUnfetchable) as found:
        run(golden.serve_a_drink, host=VirtualHost(), executive=robot)
    assert isinstance(found.value.__cause__, GraspMissed)
    assert robot.log.count("ClosingAGripper") == 3


def test_bottle_that_is_not_seen_is_looked_for_from_elsewhere(golden: ModuleType) -> None:
    robot = Robot()
    unseen, unseen_again = iter([True]), iter([True])

    async def reach(wanted: Action) -> None:
        if next(unseen, False):
            raise ObjectNotFound()

    async def look(wanted: Action) -> None:
        if next(unseen_again, False):
            raise ObjectNotFound()

    robot.does["Reaching"], robot.does["LookingForSomething"] = reach, look
    run(golden.serve_a_drink, host=VirtualHost(), executive=robot)
    assert robot.log[:6] == [DRIVE, "Reaching", LOOK, DRIVE, LOOK, DRIVE]
    assert robot.wanted[1].relations[0].name == "visible_from"


def test_parameters_bind_other_objects(golden: ModuleType) -> None:
    robot = Robot()
    cup = golden.BOTTLE.__class__("Cup", "http://planlang.org/test#cup1")

    async def serve() -> None:
        await golden.serve_a_drink(bottle=cup)

    run(serve, host=VirtualHost(), executive=robot)
    assert str(robot.wanted[0].relations[0].references[0]) == "cup1"


def test_plan_of_the_real_recipe_runs_to_its_end(corpus: Path, tmp_path: Path) -> None:
    source = compile_recipe(corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl").source
    path = tmp_path / "serve_drink.py"
    path.write_text(source, encoding="utf-8")
    robot = Robot()
    run(loaded(path).serve_a_drink, host=VirtualHost(), executive=robot)
    assert robot.log == [DRIVE, *GRASP, DRIVE, "Reaching", "OpeningAGripper"]


def test_a_recipe_without_cycles_states_and_overlaps_is_compiled_without_networkx() -> None:
    """Importing it took a third of a compilation."""
    code = "import sys; from planlang.compiler import compile_recipe; from planlang.files import bundled; "
    code += "compile_recipe(bundled('recipes') / 'serve_a_drink.omn'); sys.exit('networkx' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
