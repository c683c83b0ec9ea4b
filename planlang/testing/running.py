"""run_plan: runs a plan in virtual time with a scripted robot, and returns its history."""

from __future__ import annotations

import functools
import os
from collections import deque
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from planlang.compiler import compile_recipe
from planlang.failures import PlanFailure
from planlang.faults.steps import Fault, Injector
from planlang.files import bundled
from planlang.kernel import VirtualHost
from planlang.kernel.schedule import Schedule
from planlang.kernel.tracebacks import without_internals
from planlang.kernel.tree import name_of
from planlang.language.loading import load_plan
from planlang.language.plans import Plan
from planlang.language.replaying import Replay
from planlang.language.replaying import replay as replay_recorded
from planlang.language.running import run
from planlang.language.source import PlanSource
from planlang.misuse import Usage, did_you_mean
from planlang.outputs import write_text
from planlang.runs import Past, RecordedRun, Trace, restore
from planlang.testing.history import History
from planlang.testing.script import Script
from planlang.testing.scripted import ScriptedExecutive

if TYPE_CHECKING:
    from planlang.language.executive import Executive
    from planlang.testing.script import Belief

V = TypeVar("V")

recent_runs: deque[PlanRun[Any]] = deque(maxlen=5)
"""The last runs, for ``pytest --plan-trace``."""


class PlanRun(History, Generic[V]):
    """A finished run: its value or failure, and its history.

    ``failure`` is the failure of the plan, ``error`` any other exception that ended the run; at most one is not None.
    """

    def __init__(self, plan: Callable[[], Awaitable[V]], trace: Trace, rate: int, schedule: Schedule) -> None:
        super().__init__(trace.events, rate)
        self.plan, self.name = plan, name_of(plan)
        self.trace = trace
        self.schedule = schedule
        self.failure: PlanFailure | None = None
        self.error: BaseException | None = None
        self.unused: tuple[str, ...] = ()
        """Rules and faults of the script that were never applied."""
        self.unmatched: Mapping[str, str] = {}
        """Those of them whose step did not occur, each with a suggestion for its name. For a failed plan, which may not
        have reached all steps, only those with a suggestion."""
        self._value: V | None = None
        self._belief: Belief | None = None

    @property
    def value(self) -> V:
        """The result of the plan; raises its failure if it failed."""
        raised = self.failure or self.error
        if raised is not None:
            raise without_internals(raised)
        return self._value  # type: ignore[return-value]

    @property
    def belief(self) -> Belief:
        """Belief of the scripted robot at the end; ValueError if the run had a different executive."""
        if self._belief is None:
            raise ValueError("only a scripted robot has a belief here; ask the executive of the run for its own")
        return self._belief

    @property
    def seconds(self) -> float:
        """Plan time of the run [s]."""
        return self.events[-1]["step"] / self.rate if self.events else 0.0

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write an HTML report of the run: tree, lanes, failures and story, without a world."""
        from planlang.report import Context, Told, model_of, page, sources  # few tests write a page

        function = self.plan.function if isinstance(self.plan, Plan) else self.plan
        schedule = "first come, first served" if self.schedule is None else str(self.schedule)
        context = Context(
            sources.source_of(function),
            facts={"schedule": schedule},
            missing=("The run was scripted: it had no world that could be shown.",),
        )
        write_text(Path(path), page(model_of(Told.of(self.events), context)))

    def tree(self) -> str:
        """Format the task tree as indented text, followed by the rules and faults that were never applied."""
        return "\n".join([super().tree(), *(f"never applied: {what}" for what in self.unused)])

    def __repr__(self) -> str:
        raised = self.failure or self.error
        how = f"returned {self._value!r}" if raised is None else f"raised {type(raised).__name__}"
        return f"<run of {self.name}: {how} after {self.seconds:g} s>"


class UnusedRule(AssertionError):
    """A script has rules or faults for steps that did not occur. An error, as their names may be misspelt."""

    def __init__(self, unmatched: Mapping[str, str], what: str) -> None:
        lines = "\n  ".join(f"{rule}{hint}" for rule, hint in unmatched.items())
        super().__init__(f"the script names steps that did not occur:\n  {lines}\n{what}; allow_unused=True permits it")


_RUN_PLAN = Usage("run_plan", {"plan": "serve"})


def run_plan(
    plan: Callable[[], Awaitable[V]],
    *,
    script: Script | None = None,
    executive: Executive | None = None,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
    schedule: Schedule = None,
    rate: int = 240,
    within: float = 86_400.0,
    resumable: bool = False,
    resume: PlanRun[Any] | Trace | RecordedRun | None = None,
    allow_unused: bool = False,
) -> PlanRun[V]:
    """Run a plan in virtual time and return the finished run.

    ``script`` describes the behaviour of the process modules (default: an empty script), unless an ``executive`` is
    given. ``faults`` are added to those of the script; a text states some, as ``step.grasp:fails=ObjectLost@2``.
    ``schedule`` is as in :func:`planlang.run`. A plan failure is part of the result; other errors are raised:
    programming errors, DeadlockError, NoProgress, StepLimit after ``within`` [s] of plan time. A rule or fault for a
    step that did not occur, or a fault in a text that did not happen, raises UnusedRule, unless ``allow_unused``.

    With ``resumable`` the trace stores the completed steps of the top-level plan; see :func:`planlang.run`. ``resume``
    is such a run, its trace, or one read from a file: its completed steps return their recorded results, and the belief
    of the scripted robot, or of an executive with ``restore``, is restored.
    """
    _RUN_PLAN.branch("plan", plan)
    ended = attempt(
        plan,
        script=script,
        executive=executive,
        faults=faults,
        seed=seed,
        schedule=schedule,
        rate=rate,
        within=within,
        resumable=resumable,
        resume=resume,
    )
    recent_runs.append(ended)
    if ended.error is not None:
        raise without_internals(ended.error)
    if ended.unmatched and not allow_unused and resume is None:
        raise UnusedRule(ended.unmatched, repr(ended))
    return ended


def attempt(
    plan: Callable[[], Awaitable[V]],
    *,
    script: Script | None = None,
    executive: Executive | None = None,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
    schedule: Schedule = None,
    rate: int = 240,
    within: float = 86_400.0,
    resumable: bool = False,
    resume: PlanRun[Any] | Trace | RecordedRun | None = None,
) -> PlanRun[V]:
    """Run a plan as :func:`run_plan` does, but return errors as part of the result."""
    scripted = None
    if executive is None:
        script = script or Script()
        executive = scripted = ScriptedExecutive(script)
        faults = (*script.faults, *faults)
    injector = Injector(faults)
    trace = Trace()
    ended: PlanRun[V] = PlanRun(plan, trace, rate, schedule)
    host = VirtualHost(rate)
    past = None if resume is None else Past(recorded_run(resume))
    if past is not None:
        restore(executive, past)
    try:
        ended._value = run(
            plan,
            host=host,
            executive=executive,
            seed=seed,
            schedule=schedule,
            trace=trace,
            max_steps=round(within * rate),
            on_start=injector if faults else None,
            resumable=resumable,
            resume=past,
        )
    except PlanFailure as failure:
        ended.failure = failure
    except Exception as error:
        ended.error = error
    ended._belief = None if scripted is None else scripted.belief
    _note_unused(ended, scripted, injector)
    return ended


def _note_unused(ended: PlanRun[Any], scripted: ScriptedExecutive | None, injector: Injector) -> None:
    """Store the rules and faults that were never applied, and those whose steps did not occur."""
    ended.unused = tuple(f"fault {fault}" for fault in injector.unused)
    missing = (*injector.unmatched, *(one for one in injector.unused if one.named is not None))
    hints = {f"fault {fault}": did_you_mean(fault.step, ended.names()) for fault in missing}
    if scripted is not None:
        ended.unused = (*(f"rule {rule}" for rule in scripted.unused), *ended.unused)
        hints = {f"rule {rule}": did_you_mean(rule.step, scripted.performed) for rule in scripted.unmatched} | hints
    # A plan that failed may not have reached all steps: only names that look misspelt count then.
    ended.unmatched = {what: hint for what, hint in hints.items() if hint or ended.failure is None}


def recorded_run(source: PlanRun[Any] | Trace | RecordedRun) -> RecordedRun:
    """Records of a run; raises DamagedTrace."""
    return source if isinstance(source, RecordedRun) else RecordedRun.of(source.events)


def replay(plan: Callable[[], Awaitable[Any]], source: PlanRun[Any] | Trace | RecordedRun) -> Replay:
    """Run a plan on the recorded inputs of a run with ``resumable=True``, up to the first difference.

    No script or executive is used: the plan gets the recorded answers. ``assert replay(plan, run).equal`` holds for a
    plan whose decisions depend on these answers alone.
    """
    return replay_recorded(plan, recorded_run(source))


@functools.cache
def compiled(recipe: str | os.PathLike[str], task: str | None = None) -> Plan[..., Any]:
    """Compile a recipe file, or a bundled recipe by name (``compiled("serve_a_drink")``), and return its plan.

    The names that the plan defines are in its module: ``plan.function.__globals__["BOTTLE"]``. Raises BadInput with the
    diagnostics if the recipe has errors.
    """
    path = Path(recipe)
    if not path.suffix and not path.exists():
        path = bundled("recipes") / f"{path}.omn"
    plan = compile_recipe(path, task=task)
    name = plan.functions[-1]
    function = getattr(load_plan(PlanSource(plan.source, f"<plan of {path.name}>"), name), name)
    assert isinstance(function, Plan)
    return function
