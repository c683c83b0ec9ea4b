"""However long the names of a recipe are, a formatter leaves its plan as it is."""

import random
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.compiler.compile import canonical
from planlang.compiler.emit import emit
from planlang.compiler.layout import signature
from planlang.compiler.lowering import Lowering
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
        where = ((rng.choice(["above", "in_front_of"]), rng.choice(self.things)) for _ in range(rng.randrange(3)))
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
    """What ruff would change in the sources of a folder."""
    command = [sys.executable, "-m", "ruff", "format", "--diff", "--isolated", "--no-cache", str(folder)]
    return subprocess.run(command, capture_output=True, text=True).stdout


def test_formatter_leaves_plans_of_long_names_as_they_are(actions: tuple[Ontology, Actions], tmp_path: Path) -> None:
    @settings(max_examples=40)
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
@settings(max_examples=25)
def test_formatter_leaves_first_lines_as_they_are(
    name: str, parameters: list[str], keywords_only: bool, returns: str, depth: int
) -> None:
    given = ["*", *parameters] if keywords_only and parameters else parameters
    lines = [f"{'    ' * level}async def outer{level}() -> None:" for level in range(depth)]
    lines += [*signature(f"async def {name}", given, returns, depth=depth), "    " * (depth + 1) + "pass"]
    source = "\n".join(lines) + "\n"
    command = [sys.executable, "-m", "ruff", "format", "--isolated", "-"]
    assert subprocess.run(command, input=source, capture_output=True, text=True, check=True).stdout == source
