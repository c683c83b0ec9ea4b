"""run: executes a plan on a host, with an executive."""

from __future__ import annotations

import contextvars
import functools
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from planlang.kernel import Host, PlanStructureError, Scheduler, run_plan
from planlang.kernel.hosts import LiveHost
from planlang.kernel.schedule import Schedule, described, source_of
from planlang.kernel.tracebacks import without_internals
from planlang.kernel.tree import Node, name_of, unbound
from planlang.language.budgets import charge
from planlang.language.executive import RecordedExecutive, current
from planlang.language.plans import Frame, frame
from planlang.misuse import Usage, WrongType, WrongValue, contrast, whole_number, written
from planlang.runs import Past, Trace, refuse_other
from planlang.runs.journal import Journal

if TYPE_CHECKING:
    from planlang.language.executive import Executive

P = ParamSpec("P")
V = TypeVar("V")
RUN = Usage(
    "run",
    {"plan": "serve", "host=": "VirtualHost()"},
    {
        "executive": "executive",
        "seed": "0",
        "schedule": "7",
        "trace": "Trace()",
        "max_steps": "240_000",
        "on_start": "print",
        "resumable": "True",
        "resume": "past",
    },
)
SCHEDULE = "None for first come, first served, the number >= 0 of a random stream, or a list of choices"
PARTS = ("modules", "ancestors", "revision", "record")
"""Attributes that every executive has; the others are needed only for locations and conditions."""


def _for_plan_authors(function: Callable[P, V]) -> Callable[P, V]:
    """Report a missing host, and remove planlang's own frames from the tracebacks of exceptions."""

    @functools.wraps(function)
    def run(*arguments: P.args, **named: P.kwargs) -> V:
        try:
            if "host" not in named:
                plan = written(arguments[0]) if arguments else "serve"
                message = "run needs a host, which advances plan time"
                raise WrongType(contrast(message, f"run({plan})", f"run({plan}, host=VirtualHost())"))
            return function(*arguments, **named)
        except BaseException as error:
            without_internals(error)
            raise

    return run


@_for_plan_authors
def run(
    plan: Callable[[], Awaitable[V]],
    *,
    host: Host,
    executive: Executive | None = None,
    seed: int = 0,
    schedule: Schedule = None,
    trace: Trace | None = None,
    max_steps: int | None = None,
    on_start: Callable[[Node], object] | None = None,
    resumable: bool = False,
    resume: Past | None = None,
) -> V:
    """Run a plan and return its result.

    ``seed`` seeds :func:`planlang.rng`. ``schedule`` orders the tasks that can run: None is first come, first served, a
    number seeds random choices, a list contains the choices. Equal plan, world, seed and schedule give equal traces,
    byte for byte. ``on_start`` is called, in the task, when a node of the tree begins; if it raises, the node fails
    with that error.

    With ``resumable`` the trace stores each completed step of the top-level plan, with its result and the state of the
    world after it, so that the run can be resumed. ``resume`` is the past of such a trace: completed steps return their
    recorded results instead of running, plan time continues from there, and the new trace begins with the records of
    the past. The world must be in the recorded state: see ``planlang.runs.restore``.

    Raises the failure or error of the plan; DeadlockError, StepLimit, NoProgress or StuckTask, with tasks and lines, if
    it cannot continue; KeyboardInterrupt after Ctrl-C, when all cleanups have run.
    """
    RUN.branch("plan", plan)
    for part in ("rate", "jumps", "advance"):
        if isinstance(host, type) or not hasattr(host, part):
            raise RUN.wrong("host", host, "a host, such as VirtualHost()")
    seed = RUN.whole("seed", seed, None, "random streams")
    max_steps = None if max_steps is None else RUN.whole("max_steps", max_steps, 1, "world steps")
    schedule = _schedule(schedule)
    _check(executive, trace, on_start)
    RUN.instance("resumable", resumable, bool, "True or False")
    if resume is not None:
        RUN.instance("resume", resume, Past, "the past of an earlier run")
    scheduler = Scheduler(host, seed=seed, choice=source_of(schedule), observer=trace, max_steps=max_steps)
    scheduler.on_start = on_start
    header = known(plan, host, seed, schedule)
    if resume is not None:
        refuse_other(resume, header)
    elif resumable or trace is not None:
        trace = trace or Trace([])
        trace.write_header(**header, **({"resumable": True} if resumable else {}))
    if not resumable and resume is None:
        return _inside(scheduler, plan, executive)  # type: ignore[no-any-return]
    journal = Journal(
        scheduler, trace or Trace([]), snapshot=getattr(executive, "snapshot", None), past=resume, charge=charge
    )
    scheduler.observer = scheduler.recorded = journal
    recording = None
    if executive is not None:
        recording = RecordedExecutive(executive, journal)
        recording.modules  # noqa: B018 - recorded as the first answer, so that a replay knows of the executive
    try:
        result: V = _inside(scheduler, plan, recording)
    except PlanStructureError:
        raise
    except Exception:
        journal.check_repeated()  # a deviation from the record is a better explanation than the error that it caused
        raise
    journal.check_repeated()
    return result


def _inside(scheduler: Scheduler, plan: Callable[[], Awaitable[Any]], executive: Executive | None) -> Any:
    return contextvars.copy_context().run(inside_of, scheduler, plan, executive)


def _schedule(schedule: Any) -> Schedule:
    """Check a schedule and convert numbers of any integer type to int; raises WrongType or WrongValue."""
    number = whole_number(schedule)
    if number is not None and number < 0:
        raise RUN.wrong("schedule", schedule, SCHEDULE, WrongValue)
    is_valid = schedule is None or isinstance(schedule, Sequence) or hasattr(schedule, "choose")
    if number is None and (isinstance(schedule, (str, type)) or not is_valid):
        raise RUN.wrong("schedule", schedule, SCHEDULE)
    return schedule if number is None else number


def _check(executive: object, trace: object, on_start: object) -> None:
    """Check the types of arguments of :func:`run`."""
    for part in PARTS if executive is not None else ():
        if isinstance(executive, type) or not hasattr(executive, part):
            raise RUN.wrong("executive", executive, "an executive: a robot's, or a scripted one")
    if trace is not None:
        RUN.instance("trace", trace, Trace, "a trace")
    if on_start is not None:
        RUN.plain("on_start", on_start, "a plain function of a node of the tree", arguments=1)


def known(plan: Callable[[], Awaitable[Any]], host: Host, seed: int, schedule: Schedule) -> dict[str, object]:
    """Header of a run's trace."""
    iri = getattr(unbound(plan), "iri", None)
    header = {"plan": name_of(plan), "iri": iri, "rate": host.rate, "seed": seed, "schedule": described(schedule)}
    return {**header, "real_time": True} if isinstance(host, LiveHost) else header


def inside_of(scheduler: Scheduler, plan: Callable[[], Awaitable[Any]], executive: Executive | None) -> Any:
    """Run a plan with its executive and top-level frame; call it in a context of its own."""
    current.set(executive)
    frame.set(Frame(None))
    if executive is not None:
        scheduler.revision = executive.revision

        def write(event: str, details: Mapping[str, Any]) -> None:
            if scheduler.observer is not None:
                scheduler.observer.write(scheduler.now, event, None, **details)

        executive.record(write)
    try:
        return run_plan(scheduler, plan)
    finally:
        if executive is not None:
            executive.record(_unrecorded)  # what is asked of it later is no part of the run


def _unrecorded(event: str, details: Mapping[str, Any]) -> None:
    """Record nothing, as no run is going on."""
