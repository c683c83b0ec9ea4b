"""The text of a plan: the golden one, Python names for OWL names, and lines that a formatter leaves as they are."""

import keyword
import random
import subprocess
import sys
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.compile import emit
from planlang.compiler.expressions import Names, snake_case, without_digits
from planlang.compiler.layout import WIDTH, Call, Display, Expression, Remark, Text, signature, statement
from planlang.compiler.lowering import Lowering
from planlang.diagnostics import Severity
from planlang.files import bundled
from planlang.ontology import Ontology, load
from planlang.recipe import (
    Actions,
    Allen,
    Ending,
    Flow,
    Kind,
    Ordering,
    Overlap,
    Parameter,
    Place,
    Reason,
    Recipe,
    RecipeSet,
    Source,
    StateMachine,
    Step,
    Thing,
    Transition,
)
from planlang.recipe.canonical import canonical
from tests.support.examples import examples


def formatted(source: str) -> str:
    """Return what ruff makes of a source."""
    command = [sys.executable, "-m", "ruff", "format", "--isolated", f"--line-length={WIDTH}", "-"]
    return subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout


def remarked(rng: random.Random, expression: Expression) -> Expression:
    """The expression, seldom with a comment on it."""
    return Remark(expression, "why " * rng.randrange(1, 40)) if rng.random() < 0.05 else expression


def some_expression(rng: random.Random, depth: int) -> Expression:
    name = "x" + "abcdefgh"[rng.randrange(8)] * rng.randrange(1, 30)
    inside = [remarked(rng, some_expression(rng, depth - 1)) for _ in range(rng.randrange(5))] if depth else []
    match rng.randrange(4) if inside else 0:
        case 0:
            return Text(name)
        case 1:
            return Display(rng.choice(["()", "[]"]), tuple(inside))
        case 2:
            return Display("{}", tuple(inside), tuple(Text(f'"{name}{index}"') for index in range(len(inside))))
        case _:
            split = rng.randrange(len(inside) + 1)
            positional = [(None, item) for item in inside[:split]]
            keywords = [(f"k{index}", item) for index, item in enumerate(inside[split:])]
            return Call(name, (*positional, *keywords))


def test_formatter_leaves_any_call_as_it_was_laid_out() -> None:
    rng = random.Random(7)
    lines = ["async def plan():"]
    for _ in range(1500):
        arguments = tuple((None, some_expression(rng, 3)) for _ in range(rng.randrange(4)))
        lines += statement(Call("perform", arguments), depth=rng.choice([1, 1, 1]), before="await ")
    source = "\n".join(lines) + "\n"
    assert formatted(source) == source


def test_arguments_share_a_line_before_they_get_one_each() -> None:
    arguments = tuple((None, Text("a" * 26)) for _ in range(3))
    assert len(statement(Call("f" * 40, arguments), depth=0)) == 3


def test_items_of_a_display_never_share_a_line_once_it_is_broken() -> None:
    items = tuple(Text("a" * 30) for _ in range(5))
    assert len(statement(Display("[]", items), depth=0)) == 7


def test_tuple_of_one_keeps_its_comma() -> None:
    assert statement(Display("()", (Text("a"),)), depth=0) == ["(a,)"]


BASE = "http://planlang.org/test#"
KNOWROB = "http://knowrob.org/kb/knowrob.owl#"
TASK, INNER, LOOP, END = (BASE + name for name in ("Task", "Inner", "Loop", "End"))


@pytest.fixture(scope="module")
def actions() -> tuple[Ontology, Actions]:
    ontology = load(bundled("recipes") / "serve_a_drink.omn")
    return ontology, Actions(ontology)


class Writer:
    """Writes recipes of every construct, whose names have any length."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.number = 0
        self.things = [Thing(Kind.OBJECT, "Cup", self.iri(), KNOWROB + "Cup") for _ in range(3)]
        where = ((rng.choice(["above", "in_front_of"]), (rng.choice(self.things),)) for _ in range(rng.randrange(3)))
        self.place = Place(self.iri(), tuple(where))

    def iri(self) -> str:
        self.number += 1
        length = self.rng.choice([3, self.rng.randrange(20, 110)])
        return BASE + "A" + "bcdefghij"[self.rng.randrange(9)] * length + str(self.number)

    def step(self, iri: str | None = None, recipes: tuple[str, ...] = ()) -> Step:
        """A step about the first thing, and maybe others; primitive unless it has recipes."""
        rng, iri = self.rng, iri or self.iri()
        about = [Parameter("objectActedOn", thing) for thing in self.things[: rng.randrange(1, 4)]]
        about += [Parameter("toLocation", self.place)] * rng.randrange(2)
        primitive = None if recipes else KNOWROB + rng.choice(["LookingForSomething", "Reaching"])
        return Step(iri, iri, tuple(about), recipes, primitive)

    def ordered(self, iri: str) -> Recipe:
        """Steps in a random order, some with recipes of their own, handing things on and overlapping."""
        rng = self.rng
        steps = [self.step() for _ in range(rng.randrange(2, 8))]
        if iri == TASK:
            steps += [self.step(recipes=(INNER,)), self.step(recipes=(INNER, LOOP))]
        pairs = list(combinations([step.iri for step in steps], 2))
        flows = tuple(Flow(a, b, None, "objectActedOn") for a, b in pairs if rng.random() < 0.3)
        orderings = [Ordering(a, b) for a, b in pairs if rng.random() < 0.3]
        orderings += [Ordering(flow.producer, flow.consumer, reason=Reason.DATA_FLOW) for flow in flows]
        beside = [self.step(), self.step()] if rng.random() < 0.5 else []
        overlaps = (Overlap(beside[0].iri, rng.choice(list(Allen)), beside[1].iri),) if beside else ()
        return Recipe(iri, "PurposefulAction", (*steps, *beside), tuple(orderings), overlaps=overlaps, flows=flows)

    def states(self, iri: str) -> Recipe:
        """States in a loop."""
        looking, going, end = self.step(), self.step(), self.step(END)
        transitions = (
            Transition(looking.iri, end.iri, Ending.TRUE, self.iri()),
            Transition(looking.iri, going.iri, Ending.FALSE, self.iri()),
            Transition(going.iri, looking.iri, Ending.DONE, None),
            Transition(going.iri, end.iri, Ending.OTHER, self.iri()),
        )
        machine = StateMachine(looking.iri, (end.iri,), transitions)
        return Recipe(iri, "PurposefulAction", (looking, going, end), machine=machine)

    def recipes(self) -> RecipeSet:
        found = [self.ordered(TASK), self.ordered(INNER), self.states(LOOP)]
        return RecipeSet(TASK, {one.iri: one for one in found}, Source("test.omn", "0" * 64))


def changes(folder: Path) -> str:
    """Return what ruff would change in the sources of a folder."""
    command = [
        sys.executable,
        "-m",
        "ruff",
        "format",
        "--diff",
        "--isolated",
        f"--line-length={WIDTH}",
        "--no-cache",
        str(folder),
    ]
    return subprocess.run(command, capture_output=True, text=True).stdout


def test_formatter_leaves_plans_of_long_names_as_they_are(actions: tuple[Ontology, Actions], tmp_path: Path) -> None:
    @settings(max_examples=examples(40))
    @given(st.integers(0, 1_000_000))
    def write(seed: int) -> None:
        recipes = canonical(Writer(random.Random(seed)).recipes())
        source, _ = emit(Lowering(actions[0], recipes, actions[1]).tree(), recipes, "0")
        (tmp_path / f"plan{seed}.py").write_text(source, encoding="utf-8")

    write()
    assert changes(tmp_path) == ""


NAMES = st.integers(1, 100).map(lambda length: "n" * length)


@given(
    name=NAMES,
    parameters=st.lists(NAMES.map(lambda name: f"{name}: Any"), max_size=20, unique=True),
    keywords_only=st.booleans(),
    returns=st.sampled_from(["None", "str", "Location", "tuple[Any, Any]", "tuple[Any, Any, Any]", "tuple[Any, ...]"]),
    depth=st.integers(0, 4),
)
@settings(max_examples=examples(50))
def test_formatter_leaves_first_lines_as_they_are(
    name: str, parameters: list[str], keywords_only: bool, returns: str, depth: int
) -> None:
    given = ["*", *parameters] if keywords_only and parameters else parameters
    lines = [f"{'    ' * level}async def outer{level}() -> None:" for level in range(depth)]
    lines += [*signature(f"async def {name}", given, returns, depth=depth), "    " * (depth + 1) + "pass"]
    source = "\n".join(lines) + "\n"
    command = [sys.executable, "-m", "ruff", "format", "--isolated", f"--line-length={WIDTH}", "-"]
    assert subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout == source


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("MoveBaseToGraspPose", "move_base_to_grasp_pose"),
        ("robotPose-grasping1", "robot_pose_grasping1"),
        ("Bed-PieceOfFurniture", "bed_piece_of_furniture"),
        ("toLocation", "to_location"),
        ("in-ContGeneric", "in_cont_generic"),
        ("ADTPipetting", "adt_pipetting"),
        ("3DPose", "_3_d_pose"),
        ("Küche", "küche"),
        ("---", "_"),
    ],
)
def test_camel_case_becomes_snake_case(name: str, expected: str) -> None:
    assert snake_case(name) == expected


@given(st.text(min_size=1, max_size=30))
def test_every_claimed_name_is_an_identifier_and_no_keyword(name: str) -> None:
    claimed = Names().claim(snake_case(name))
    assert claimed.isidentifier()
    assert not keyword.iskeyword(claimed)


@given(st.lists(st.sampled_from(["bottle", "bottle_2", "class", "print", "x"]), max_size=12))
def test_no_name_is_given_out_twice(wanted: list[str]) -> None:
    names = Names({"x"})
    claimed = [names.claim(name) for name in wanted]
    assert len(set(claimed)) == len(claimed)
    assert "x" not in claimed


def test_second_bottle_is_bottle_2() -> None:
    names = Names()
    assert [names.claim("bottle"), names.claim("bottle")] == ["bottle", "bottle_2"]


@pytest.mark.parametrize(("name", "expected"), [("bottle1", "bottle"), ("pose_2", "pose"), ("12", "12"), ("a", "a")])
def test_trailing_digits_are_dropped(name: str, expected: str) -> None:
    assert without_digits(name) == expected


RECIPE = bundled("recipes") / "serve_a_drink.omn"
GOLDEN = Path(__file__).parent / "golden" / "serve_a_drink.py"


@pytest.fixture(scope="module")
def plan() -> CompiledPlan:
    return compile_recipe(RECIPE)


def test_bundled_recipe_compiles_to_the_golden_plan(plan: CompiledPlan) -> None:
    assert plan.source == GOLDEN.read_text(encoding="utf-8"), "see the docstring of this file for how to re-create it"


def test_bundled_recipe_has_neither_errors_nor_warnings(plan: CompiledPlan) -> None:
    assert [str(d) for d in plan.diagnostics if d.severity is not Severity.NOTE] == []


def test_functions_are_told_with_the_task_last(plan: CompiledPlan) -> None:
    assert plan.functions == ("grasp_bottle", "serve_a_drink")
    assert plan.task == "ServeADrink"


def test_steps_come_in_the_order_of_the_constraints_not_of_the_file(plan: CompiledPlan, read_plan: type[Any]) -> None:
    assert read_plan(plan.source).orders("serve_a_drink").steps == [
        "at grasping_place",
        "ApproachBottle",
        "OpenGripper",
        "ReachForBottle",
        "CloseGripper",
        "LiftBottle",
        "ParkArm",
        "at handover_place",
        "ReachToHandoverPose",
        "HandOverBottle",
    ]


def test_source_does_not_depend_on_the_hash_seed(plan: CompiledPlan) -> None:
    script = f"from planlang.compiler import compile_recipe as c; print(c(__import__('pathlib').Path({str(RECIPE)!r}))"
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", script + ".source, end='')"],
            capture_output=True,
            text=True,
            check=True,
            env={"PYTHONHASHSEED": seed, "PATH": ""},
        )
        assert done.stdout == plan.source


@pytest.mark.long
def test_golden_plan_is_formatted_linted_and_strictly_typed() -> None:
    for arguments in (
        ["ruff", "format", "--check", "--isolated", f"--line-length={WIDTH}"],
        ["ruff", "check", "--isolated", f"--line-length={WIDTH}", "--select", "E,F,W,I,B,UP,N,RUF"],
        ["mypy", "--strict", "--no-error-summary"],
    ):
        done = subprocess.run([sys.executable, "-m", *arguments, str(GOLDEN)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


def test_golden_plan_imports_planlang_only(plan: CompiledPlan) -> None:
    lines = [line for line in plan.source.splitlines() if line.startswith(("import ", "from "))]
    known = ("functools", "planlang", "planlang.designators", "planlang.failures", "planlang.recoveries")
    assert all(line.split()[1] in known for line in lines)


def test_no_iri_stands_inside_a_function(plan: CompiledPlan) -> None:
    inside = [line for line in plan.source.splitlines() if line.startswith("    ")]
    assert not any("http://" in line for line in inside)
