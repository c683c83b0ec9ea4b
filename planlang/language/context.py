"""What surrounds a running plan: the executive."""

from __future__ import annotations

from contextvars import ContextVar
from typing import TYPE_CHECKING

from planlang.kernel import PlanStructureError
from planlang.kernel.park import serving
from planlang.misuse import contrast

if TYPE_CHECKING:
    from planlang.language.executive import Executive

current: ContextVar[Executive | None] = ContextVar("executive", default=None)


def executive_for(construct: str) -> Executive:
    """The current executive; PlanStructureError when the plan runs without one."""
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
