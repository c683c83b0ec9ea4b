"""A scripted executive: a base that jumps, an arm and eyes that do what the test says."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest

from planlang import *
from planlang.failures import LocationUnresolvable, NavigationFailure
from planlang.protocols import Solution


@dataclass(eq=False)
class ScriptedModule:
    """Performs classes of actions by a function of the action."""

    name: str
    actions: tuple[str, ...]
    does: Callable[[Action], Awaitable[Any]]
    failures: tuple[type[Exception], ...] = (PlanFailure,)
    needs: tuple[str, ...] = ()

    def resources(self, action: Action) -> tuple[str, ...]:
        return self.needs

    async def execute(self, action: Action) -> Any:
        return await self.does(action)


@dataclass(eq=False)
class ScriptedExecutive:
    """Grounds everything to what the test put into it; ``log`` holds what was done, with the place of the base."""

    places: list[tuple[float, float, float]] = field(default_factory=lambda: [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    base: tuple[float, float, float] = (0.0, 0.0, 0.0)
    holding: list[str] = field(default_factory=list)
    facts: dict[str, bool] = field(default_factory=dict)
    parents: dict[str, tuple[str, ...]] = field(default_factory=dict)
    log: list[str] = field(default_factory=list)
    belief: int = 0
    drive_time: float = 0.5
    retry_actions: tuple[Action, ...] = ()
    releasing: tuple[str, ...] = ("OpeningAGripper",)
    asked: list[Location] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.navigation = ScriptedModule(
            "navigation", ("Translation-LocationChange",), self._drive, (NavigationFailure,), ("base",)
        )
        self.extra: list[ScriptedModule] = []
        self.write: Callable[[str, Mapping[str, Any]], None] | None = None

    async def _drive(self, wanted: Action) -> None:
        await sleep(self.drive_time)
        x = wanted.get("x")
        assert isinstance(x, float)
        self.base = (x, 0.0, 0.0)
        self.log.append(f"at {x:g}")

    @property
    def modules(self) -> Sequence[ScriptedModule]:
        return [self.navigation, *self.extra]

    def ancestors(self, action_type: str) -> Sequence[str]:
        return (action_type, *self.parents.get(action_type, ()))

    def revision(self) -> int:
        return self.belief

    def solutions(self, location: Location) -> Iterator[Solution]:
        self.asked.append(location)
        for place in self.places:
            yield Solution(place, self.belief, {"arm": "right"})
        raise LocationUnresolvable(designator=str(location), counts={"out of reach": len(self.places)})

    def move_to(self, solution: Solution) -> Action:
        return action("Translation-LocationChange", x=solution.base[0])

    def is_at(self, solution: Solution) -> bool:
        return self.base == solution.base

    def holds(self, condition: Condition) -> bool:
        return self.facts.get(str(condition), False)

    def before_retry(self) -> Iterable[Action]:
        return self.retry_actions

    def held(self) -> Sequence[str]:
        return self.holding

    def releases(self, action: Action) -> bool:
        return action.type in self.releasing

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        self.write = write


@pytest.fixture
def executive() -> ScriptedExecutive:
    """An executive with a base and nothing else; tests add modules to ``extra``."""
    return ScriptedExecutive()


@pytest.fixture
def module() -> type[ScriptedModule]:
    """The class of scripted process modules."""
    return ScriptedModule
