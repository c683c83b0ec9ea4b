"""The protocols of an executive, which grounds what plans describe, and of its process modules."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Protocol

from planlang.designators import Action, Condition, Location
from planlang.kernel import PlanStructureError
from planlang.kernel.core import serving
from planlang.misuse import contrast

if TYPE_CHECKING:
    from planlang.protocols import Solution


class ProcessModule(Protocol):
    """Performs actions of some classes, one at a time, and raises typed failures."""

    @property
    def name(self) -> str:
        """Shown in the trace."""

    @property
    def actions(self) -> Sequence[str]:
        """Action classes (local names of the vocabulary) that it performs, descendants included."""

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that it may raise; any other exception is a programming error."""

    def resources(self, action: Action) -> tuple[str, ...]:
        """Names of what the action needs exclusively: "base", "head", "torso", "right_arm", ..."""

    async def execute(self, action: Action) -> Any:
        """Perform the action; on evaporation stop the robot."""


class Executive(Protocol):
    """Grounds what plans describe. One is current while a plan runs."""

    @property
    def modules(self) -> Sequence[ProcessModule]:
        """The registered process modules."""

    def ancestors(self, action_type: str) -> Sequence[str]:
        """Return the class itself and its superclasses, nearest first."""

    def revision(self) -> int:
        """Return how often the belief has changed."""

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Yield base poses, best first; raises LocationUnresolvable (with counts) when there are no more."""

    def move_to(self, solution: Solution) -> Action:
        """Return the base motion that goes to a solution."""

    def is_at(self, solution: Solution) -> bool:
        """Return True while the base is where the solution put it."""

    def holds(self, condition: Condition) -> bool:
        """Return True if the condition holds as far as the robot knows."""

    def before_retry(self) -> Iterable[Action]:
        """Return actions that bring the robot into a posture from which it can drive to another base pose."""

    def held(self) -> Sequence[str]:
        """Return the names of the objects that the robot holds."""

    def releases(self, action: Action) -> bool:
        """Return True if the action lets go of something: it is not repeated while that is still to be delivered."""

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Give the executive a way to write its own events (belief changes, solutions) into the trace."""


current: ContextVar[Executive | None] = ContextVar("executive", default=None)


def executive_for(construct: str) -> Executive:
    """Return the current executive; raises PlanStructureError when the plan runs without one."""
    executive = current.get()
    if executive is None:
        serving()  # without a plan there is more to say
        raise PlanStructureError(
            contrast(
                f"{construct} needs an executive: run(plan, host=..., executive=...)",
                "run(serve, host=host)",
                "run(serve, host=host, executive=executive)",
            )
        )
    return executive
