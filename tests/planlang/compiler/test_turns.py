"""Unordered steps with recipes that share an arm, the base, the torso or the head run one after the other."""

import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from planlang import Action, Condition, Location, Trace, VirtualHost, checkpoint, run
from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.layout import WIDTH
from planlang.failures import LocationUnresolvable
from planlang.language.loading import load_plan
from planlang.protocols import Solution
from planlang.runs import with_paths
from planlang.testing import PlanRun, Script, explore, run_plan

SCHEDULES = (None, *range(40))

HEAD = """
Prefix: : <http://planlang.org/test#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>
Import: <http://knowrob.org/kb/knowrob.owl>

Individual: gripper
    Types: k:HolderGripper
Individual: leftGripper
    Types: k:HolderGripper
Individual: rightGripper
    Types: k:HolderGripper
Individual: cup
    Types: k:Cup
Individual: there
    Types: k:Point3D
    Facts: k:inCenterOf cup
"""

MODULES = {
    "Reaching": ("right_arm", "torso"),
    "OpeningAGripper": ("right_arm",),
    "ClosingAGripper": ("right_arm",),
    "LookingForSomething": ("head",),
}


def composite(name: str, *steps: str, device: str | None = None, above: str = "k:PurposefulAction") -> str:
    """A step whose recipe has steps of primitive classes, or other recipes, one after another."""
    own = [step if step.startswith("!") else f"{name}{step}" for step in steps]
    own = [step.removeprefix("!") for step in own]
    parts = [above, *(f"k:subAction some {step}" for step in own)]
    parts += [f"k:deviceUsed value {device}"] if device else []
    parts += [f"k:orderingConstraints value {name}{index}" for index in range(1, len(own))]
    lines = [f"Class: {name}\n    SubClassOf: {', '.join(parts)}\n"]
    for index in range(1, len(own)):
        lines.append(
            f"Individual: {name}{index}\n    Types: k:PartialOrdering-Strict\n"
            f"    Facts: k:occursBeforeInOrdering {own[index - 1]}, k:occursAfterInOrdering {own[index]}\n"
        )
    for step in steps:
        if not step.startswith("!"):
            lines.append(primitive(f"{name}{step}", step))
    return "\n".join(lines)


def primitive(name: str, cls: str) -> str:
    where = ", k:toLocation value there" if cls == "Reaching" else ""
    return f"Class: {name}\n    SubClassOf: k:{cls}{where}\n"


def unordered(*steps: str) -> str:
    return f"Class: Serve\n    SubClassOf: k:PurposefulAction, {', '.join(f'k:subAction some {s}' for s in steps)}\n"


@dataclass(eq=False)
class Module:
    """Performs one class of actions in two rounds and notes where in the plan it was asked to."""

    name: str
    failures: tuple[type[Exception], ...] = ()

    @property
    def actions(self) -> tuple[str, ...]:
        return (self.name,)

    def resources(self, action: Action) -> tuple[str, ...]:
        return MODULES[self.name]

    async def execute(self, action: Action) -> None:
        await checkpoint()
        await checkpoint()


@dataclass
class Robot:
    """Does everything that it is asked to; has no place to go."""

    modules: Sequence[Any] = field(default_factory=lambda: [Module(name) for name in MODULES])

    def ancestors(self, action_type: str) -> Sequence[str]:
        return (action_type,)

    def revision(self) -> int:
        return 0

    def solutions(self, location: Location) -> Iterator[Solution]:
        raise LocationUnresolvable(designator=str(location))

    def move_to(self, solution: Solution) -> Action:
        raise AssertionError

    def is_at(self, solution: Solution) -> bool:
        return True

    def holds(self, condition: Condition) -> bool:
        return False

    def before_retry(self) -> Iterable[Action]:
        return ()

    def held(self) -> Sequence[str]:
        return ()

    def releases(self, action: Action) -> bool:
        return False

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Nothing of its own to write."""


@pytest.fixture
def compiled(tmp_path: Path) -> Callable[..., CompiledPlan]:
    """Compiles a recipe given as its parts; its task is Serve."""

    def compile_text(*parts: str) -> CompiledPlan:
        path = tmp_path / "test.omn"
        path.write_text("\n".join((HEAD, *parts)), encoding="utf-8")
        return compile_recipe(path, task="Serve")

    return compile_text


def imported(plan: CompiledPlan) -> Callable[[], Awaitable[Any]]:
    serve: Callable[[], Awaitable[Any]] = load_plan(plan.plan_source).serve
    return serve


def performed(serve: Callable[[], Awaitable[Any]], schedule: int | None) -> list[str]:
    """The branch of the task that each request to a module came from, in the order of the requests."""
    trace = Trace()
    run(serve, host=VirtualHost(), executive=Robot(), schedule=schedule, trace=trace)
    paths = [str(record["path"]) for record in with_paths(trace.events) if record["event"] == "request"]
    names = (path.lower().split("/") for path in paths)
    return [next(part for part in path if part.startswith(("grasp", "wipe", "look"))) for path in names]


def runs(names: list[str]) -> list[str]:
    """Each name once for each time that it begins after another one."""
    return [name for index, name in enumerate(names) if index == 0 or names[index - 1] != name]


GRASP = ("OpeningAGripper", "Reaching", "ClosingAGripper")


def test_unordered_grasps_never_interleave_and_may_come_in_any_order(compiled: Callable[..., CompiledPlan]) -> None:
    names = [f"Grasp{letter}" for letter in "ABC"]
    plan = compiled(unordered(*names), *(composite(name, *GRASP) for name in names))
    assert plan.source.count('async with using("torso", "arm", "gripper", "head"):') == 3
    serve = imported(plan)
    seen = set()
    for schedule in SCHEDULES:
        done = performed(serve, schedule)
        assert len(done) == 9
        assert len(runs(done)) == 3
        seen.add(tuple(runs(done)))
    assert len(seen) == 6


def test_without_turns_the_same_steps_would_interleave(
    compiled: Callable[..., CompiledPlan], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planlang.compiler.terms.Roles.held", lambda *_: frozenset())
    plan = compiled(unordered("GraspA", "GraspB"), composite("GraspA", *GRASP), composite("GraspB", *GRASP))
    serve = imported(plan)
    assert any(len(runs(performed(serve, schedule))) > 2 for schedule in SCHEDULES)


def test_a_primitive_waits_for_the_step_that_it_shares_the_arm_with(compiled: Callable[..., CompiledPlan]) -> None:
    plan = compiled(unordered("Grasp", "Wipe"), composite("Grasp", *GRASP), primitive("Wipe", "Reaching"))
    serve = imported(plan)
    assert {tuple(runs(performed(serve, schedule))) for schedule in SCHEDULES} == {("grasp", "wipe"), ("wipe", "grasp")}


def test_roles_of_nested_recipes_are_held(compiled: Callable[..., CompiledPlan]) -> None:
    plan = compiled(
        unordered("Grasp", "Wipe"),
        composite("Grasp", "ClosingAGripper", "!Inner"),
        composite("Inner", "LookingForSomething", "Reaching"),
        composite("Wipe", "Reaching", "OpeningAGripper"),
    )
    assert plan.source.count("async with using(") == 2
    serve = imported(plan)
    assert {len(runs(performed(serve, schedule))) for schedule in SCHEDULES} == {2}


def test_grippers_of_different_sides_are_different_roles(compiled: Callable[..., CompiledPlan]) -> None:
    def with_devices(first: str, second: str) -> str:
        return compiled(
            unordered("GraspA", "GraspB"),
            composite("GraspA", "OpeningAGripper", "ClosingAGripper", device=first),
            composite("GraspB", "OpeningAGripper", "ClosingAGripper", device=second),
        ).source

    assert "using" not in with_devices("leftGripper", "rightGripper")
    assert with_devices("leftGripper", "leftGripper").count('using("left_gripper")') == 2
    either = with_devices("gripper", "rightGripper")
    assert 'using("left_gripper", "right_gripper")' in either
    assert 'using("right_gripper")' in either


@pytest.mark.parametrize(
    "parts",
    [
        (unordered("Wipe", "Reach"), primitive("Wipe", "Reaching"), primitive("Reach", "Reaching")),
        (
            unordered("Grasp", "Look"),
            composite("Grasp", "OpeningAGripper", "ClosingAGripper"),
            composite("Look", "LookingForSomething"),
        ),
        (
            "Class: Serve\n    SubClassOf: k:PurposefulAction, k:subAction some GraspA, k:subAction some GraspB,"
            " k:orderingConstraints value first\n",
            "Individual: first\n    Types: k:PartialOrdering-Strict\n"
            "    Facts: k:occursBeforeInOrdering GraspA, k:occursAfterInOrdering GraspB\n",
            composite("GraspA", *GRASP),
            composite("GraspB", *GRASP),
        ),
    ],
    ids=["primitives", "different roles", "ordered"],
)
def test_nothing_is_held_without_need(compiled: Callable[..., CompiledPlan], parts: tuple[str, ...]) -> None:
    assert "using" not in compiled(*parts).source


def transport(thing: str, cls: str = "TransportingAnObject") -> str:
    return (
        f"Individual: {thing}\n    Types: k:Cup\n"
        f"Class: Bring{thing.title()}\n    SubClassOf: k:{cls}, k:objectActedOn value {thing},"
        " k:toLocation value table\n"
    )


TABLE = "Individual: table\n    Types: k:KitchenTable\n"


def test_unordered_transports_let_each_other_go_first_once_a_thing_is_in_the_hand(
    compiled: Callable[..., CompiledPlan],
) -> None:
    plan = compiled(unordered("BringRed", "BringBlue"), TABLE, transport("red"), transport("blue"))
    assert plan.source.count('async with using("base", "torso", "arm", "gripper", "head", in_turns=True):') == 2
    taken_again = "if await give_turn():\n        await fetch_thing()"
    assert plan.source.count(taken_again) == 2, "between fetching and bringing, and before stepping back"
    serve = imported(plan)

    def check(done: PlanRun[Any]) -> None:
        assert done.failure is None
        assert done.belief.at == {"red": "table", "blue": "table"}
        assert done.belief.holding == []

    explore(serve, schedules=60, check=check)
    order = [one.name for one in run_plan(serve).steps() if one.name in ("PickItUp", "PutItDown")]
    assert order == ["PickItUp", "PickItUp", "PutItDown", "PutItDown"]
    one_hand = run_plan(serve, script=Script().holding("something"))
    order = [one.name for one in one_hand.steps() if one.name in ("PickItUp", "PutItDown")]
    assert order == ["PickItUp", "PutItDown", "PickItUp", "PutItDown"]


def test_ordered_transports_and_steps_that_work_at_a_place_take_no_turns(compiled: Callable[..., CompiledPlan]) -> None:
    order = (
        "Individual: first\n    Types: k:PartialOrdering-Strict\n"
        "    Facts: k:occursBeforeInOrdering BringRed, k:occursAfterInOrdering BringBlue\n"
    )
    both = unordered("BringRed", "BringBlue").rstrip() + ", k:orderingConstraints value first\n"
    assert "turn" not in compiled(both, order, TABLE, transport("red"), transport("blue")).source
    pick = "PickingUpAnObject"
    assert (
        "turn"
        not in compiled(
            unordered("BringRed", "BringBlue"), TABLE, transport("red", pick), transport("blue", pick)
        ).source
    )


def test_a_step_that_needs_a_hand_for_a_second_thing_takes_no_turns(compiled: Callable[..., CompiledPlan]) -> None:
    def parts(name: str) -> Iterable[str]:
        yield composite(name, f"!Pick{name}Red", f"!Pick{name}Blue", f"!Put{name}Red", f"!Put{name}Blue")
        for what in ("red", "blue"):
            thing = f"k:objectActedOn value {what}"
            yield f"Class: Pick{name}{what.title()}\n    SubClassOf: k:PickingUpAnObject, {thing}\n"
            put = f"Put{name}{what.title()}"
            yield f"Class: {put}\n    SubClassOf: k:PuttingDownAnObject, {thing}, k:toLocation value table\n"

    cups = "Individual: red\n    Types: k:Cup\nIndividual: blue\n    Types: k:Cup\n"
    source = compiled(unordered("A", "B"), TABLE, cups, *parts("A"), *parts("B")).source
    assert source.count("async with using(") == 2
    assert "turn" not in source.partition("async def ")[2].replace("return", "")


def test_a_plan_with_turns_is_formatted_and_typed(compiled: Callable[..., CompiledPlan], tmp_path: Path) -> None:
    plan = compiled(
        unordered("GraspA", "GraspB"),
        composite("GraspA", *GRASP, above="k:GraspingSomething, k:objectActedOn value cup"),
        composite("GraspB", *GRASP),
    )
    path = tmp_path / "serve.py"
    path.write_text(plan.source, encoding="utf-8")
    for arguments in (["ruff", "format", "--check", "--isolated", f"--line-length={WIDTH}"], ["mypy", "--strict"]):
        done = subprocess.run(
            [sys.executable, "-m", *arguments, str(path)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + plan.source
