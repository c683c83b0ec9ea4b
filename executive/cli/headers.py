"""What the header of a trace says about the run, so that who resumes or replays it need not say it again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from executive.cli.inputs import names
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Span, error
from planlang.resources import bundled

if TYPE_CHECKING:
    from planlang.runs import RecordedRun


@dataclass(frozen=True, slots=True)
class Told:
    """What is known from a trace. Plan, robot and environment are told only if they are bundled things."""

    recipe: str | None = None
    name: str | None = None
    task: str | None = None
    robot: str | None = None
    environment: str | None = None
    start: tuple[float, float, float] | None = None
    seed: int = 0
    schedule: int | None = None

    @staticmethod
    def of(recorded: RecordedRun) -> Told:
        """From a header; raises BadInput for a damaged one."""
        header = recorded.header
        match header:
            case {"plan": str(plan), "seed": int(seed), "schedule": (int() | None) as schedule, "start": [x, y, yaw]}:
                start = (_number(x), _number(y), _number(yaw))
            case _:
                start = (math.nan, 0.0, 0.0)
        if not all(map(math.isfinite, start)) or seed < 0:
            raise BadInput([error("X020", "the header is damaged: plan, seed or start", Span(recorded.name))])
        iri, robot, environment = (_text(header.get(key)) for key in ("iri", "robot", "map"))
        stem = local_name(environment or "").partition(".")[0]
        return Told(
            plan if plan in names(bundled("recipes")) else None,
            plan,
            iri or plan,
            robot if robot in names(bundled("ontologies") / "robots") else None,
            stem if stem in names(bundled("ontologies") / "environments") else None,
            start,
            seed,
            schedule,
        )

    def plan(self, trace: str) -> str:
        """The bundled recipe; raises BadInput when it was another plan, which only the user can name."""
        if self.recipe is None:
            advice = f"planlang run FILE --resume {trace}, or planlang replay {trace} FILE"
            message = f"name the recipe or plan that was run: the trace tells only that it is {self.name}"
            raise BadInput([error("X020", message, Span(trace), advice)])
        return self.recipe


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) else None


def _number(value: Any) -> float:
    return float(value) if type(value) in (int, float) else math.nan
