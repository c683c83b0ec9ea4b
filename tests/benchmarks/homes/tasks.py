"""Tasks of everyday, each with the home that it needs, drawn by a seed: what a user would write, and when it is done.

A template draws a home and says the steps, the goal in the simulator's truth, and what has to be possible for it (for
the witness). Homes hold more than a task needs: other furniture, other things on it, other doors beside the one meant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.furnishing import Home, NoRoom
from tests.benchmarks.homes.goals import Goal, all_of
from tests.benchmarks.homes.written import Step
from tests.support.scenarios import Watched

REDRAWN = 40
"""Homes that are drawn for one task before its seed is given up."""
KEPT = 0.2
"""Share of tasks that stay in although a robot's hand is too small or too weak for a thing of theirs."""


@dataclass(frozen=True)
class Need:
    """Something that has to be possible.

    ``kind``: "grasp", "place", "open", "close", "hand over", "press", "wipe", "see", "pour", "pass" (a doorway), or
    "hold" (while another hand holds something).
    """

    kind: str
    thing: str
    at: str = ""
    either: bool = False
    """Another door of the same furniture will do as well."""


@dataclass(frozen=True)
class Task:
    """A task in a home."""

    template: str
    home: Home
    steps: tuple[Step, ...]
    wanted: Goal
    """What the user wants."""
    unharmed: Goal
    """What must hold in any case: nothing else was moved, nothing fell or was spilled."""
    needs: tuple[Need, ...]
    unknown: tuple[str, ...] = ()
    """Things of which the robot does not know where they are."""
    watchers: tuple[Callable[[Watched], None], ...] = field(default=())
    recipe: str = ""
    """The recipe, if it is not the steps one after the other."""

    @property
    def goal(self) -> Goal:
        """The task is done: what the user wants, and no harm."""
        return all_of(self.wanted, self.unharmed)


LATER = ("more_tasks", "flat_tasks", "further_tasks", "door_tasks")
"""Modules of templates that were written later, in their order: their numbers follow, so that earlier homes stay."""

Template = Callable[[Home], Task]
TEMPLATES: dict[str, Template] = {}


def template(draw: Template) -> Template:
    """Register a template by the name of its function."""
    TEMPLATES[draw.__name__] = draw
    return draw


def drawn(name: str, seed: int, suits: Callable[[Task], bool] = lambda task: True) -> Task:
    """Return the task of a template and a seed; homes that are too full are drawn anew.

    So are most of those that do not suit a robot: its user has things that its hand can hold. One in five is kept, to
    see that the robot says so.
    """
    number = _number(name)
    is_kept = np.random.default_rng([seed, number, REDRAWN]).uniform() < KEPT
    task = None
    for again in range(REDRAWN):
        home = Home(np.random.default_rng([seed, number, again]))
        try:
            task = TEMPLATES[name](home)
            _others(home)
        except NoRoom:
            continue
        if is_kept or suits(task):
            return task
    if task is None:
        raise NoRoom(f"{name} {seed}: {REDRAWN} homes are too full")
    return task


def module_of(name: str) -> str:
    """Return the module of a template, such as "flat_tasks"."""
    return TEMPLATES[name].__module__.rpartition(".")[2]


def _number(name: str) -> int:
    """Return the number of a template, from which its homes are drawn."""

    def rank(one: str) -> tuple[int, str]:
        return LATER.index(module_of(one)) if module_of(one) in LATER else -1, one

    return sorted(TEMPLATES, key=rank).index(name)


def _others(home: Home) -> None:
    """Add furniture and things that the task does not need, as far as there is room."""
    for _ in range(int(home.rng.integers(0, 3))):
        if home.rooms:
            home.enter(home.one_of([room for room in home.rooms if home.things[room].cls != "Hall"]))
        kind = home.one_of(("side_table", "sideboard", "sofa", "bedside_table", "desk"))
        try:
            home.clutter(home.furniture(kind, corner=home.chance(0.5)), 3)
        except NoRoom:
            continue


def task_of(
    home: Home,
    name: str,
    steps: Sequence[Step],
    wanted: Goal,
    moved: Sequence[str],
    needs: Sequence[Need],
    *,
    poured: Sequence[str] = (),
    unknown: Sequence[str] = (),
    watchers: Sequence[Callable[[Watched], None]] = (),
) -> Task:
    """Return a task; beside its goal, nothing else may have been moved, dropped or spilled."""
    unharmed = all_of(goals.undisturbed(*moved), goals.level(*poured))
    return Task(name, home, tuple(steps), wanted, unharmed, tuple(needs), tuple(unknown), tuple(watchers))


def step(cls: str, **facts: str) -> Step:
    names = {
        "what": "objectActedOn",
        "to": "toLocation",
        "who": "recipient",
        "device": "deviceUsed",
        "amount": "amount",
    }
    return Step(cls, tuple((names[key], value) for key, value in facts.items()))


def some_table(home: Home, kinds: Sequence[str] = ("kitchen_table", "dining_table", "counter", "sideboard")) -> str:
    """Put a table or worktop somewhere, cluttered or not."""
    kind = home.one_of(kinds)
    wall = True if kind in ("counter", "sideboard") else None
    return home.furniture(kind, wall=wall, corner=home.chance(0.3))


def somewhere(home: Home) -> str:
    return home.one_of(("front", "anywhere", "anywhere", "back"))


def something(home: Home) -> str:
    return home.one_of(("cup", "mug", "glass", "bottle", "can", "box", "book"))


def moves(things: Sequence[str], to: str) -> tuple[Step, ...]:
    return tuple(step("TransportingAnObject", what=one, to=to) for one in things)


def takes_and_puts(things: Sequence[str], at: str) -> list[Need]:
    return [need for one in things for need in (Need("grasp", one), Need("place", one, at))]


def all_tasks(seeds: Sequence[int]) -> Iterator[tuple[str, int]]:
    """Yield template and seed of each task, templates in turn."""
    for seed in seeds:
        for name in sorted(TEMPLATES):
            yield name, seed
