"""The steps of a run, read from its trace, and questions about them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from planlang.failures import PlanFailure
from planlang.language.tasktree import tree_of
from planlang.misuse import did_you_mean
from planlang.runs import RunTree, with_paths
from planlang.runs import TaskNode as Step
from planlang.runs.codec import links

Event = Mapping[str, Any]
What = str | Step
"""A step, given by its name, ``parent/name``, the class of its action, or as an object."""
LONGEST = 60
"""Maximum characters of a failure's message in a reason, as pytest shortens texts of more than 240 characters."""
SHOWN = 3
"""Maximum number of executions of a step listed in a reason."""


class History:
    """The events of a run, with queries for tests.

    A step is given by its name in the task tree (all executions of it), by ``parent/name``, by the class of a performed
    action, or as a :class:`Step` from :meth:`steps`. Queries about a step that never ran raise :class:`NoSuchStep`,
    except :meth:`attempts` and :meth:`never`.
    """

    def __init__(self, events: Sequence[Event], rate: int) -> None:
        self.events = events
        """The trace, one mapping per record; ``planlang.runs.with_paths`` adds the paths."""
        self.rate = rate
        self._tree = RunTree()

    def steps(self, what: What | None = None) -> list[Step]:
        """List the executions of a step in order of their start; without a name, those of all steps."""
        self._tree.go_on(self.events)
        steps = list(self._tree.numbered.values())
        if what is None:
            return steps
        if isinstance(what, Step):
            return [what]
        return [step for step in steps if step.called(what) and not _duplicates_parent(step, what)]

    def happened_before(self, first: What, second: What) -> Verdict:
        """Check whether the first execution of ``first`` ended before any execution of ``second`` started."""
        a, b = self._started(first)[0], self._started(second)[0]
        return Verdict(a.last < b.first, f"{_name(first)} ({_line(a)}); {_name(second)} ({_line(b)})")

    def overlapped(self, first: What, second: What) -> Verdict:
        """Check whether any executions of two steps overlapped in time."""
        firsts, seconds = self._started(first), self._started(second)
        for a in firsts:
            for b in seconds:
                if a is not b and a.first < b.last and b.first < a.last:
                    return Verdict(True, f"{_name(first)} ({_line(a)}), {_name(second)} ({_line(b)})")
        return Verdict(False, f"{_name(first)} ({_all(firsts)}), {_name(second)} ({_all(seconds)})")

    def attempts(self, what: What, *, inner: bool = False) -> Count:
        """Count the starts of a step; for with_failure_handling, the starts of its body.

        ``inner`` includes actions that process modules perform inside other actions.
        """
        steps = [step for step in self.steps(what) if step.start is not None and (inner or not step.inner)]
        lines = [
            line
            for step in steps
            for line in ([f"{time:g} s" for time in step.repeats] if step.repeats else [step.summary()])
        ]
        hint = self._did_you_mean(what) if not steps and isinstance(what, str) else ""
        return Count(_name(what), lines, hint)

    def evaporated(self, what: What) -> Verdict:
        """Check whether an execution of the step was evaporated."""
        return self._ended(what, "evaporated")

    def succeeded(self, what: What) -> Verdict:
        """Check whether an execution of the step succeeded."""
        return self._ended(what, "succeeded")

    def failed_with(
        self, what: What, kind: type[PlanFailure], *, because_of: type[PlanFailure] | None = None
    ) -> Verdict:
        """Check whether an execution of the step failed with a failure of a class, or a composite of such failures.

        With ``because_of``, a failure of that class must be among its causes.
        """
        steps = self._find(what)
        failures = [step.failure for step in steps if step.failure is not None and step.status == "failed"]
        holds = any(_is(failure, kind) and (because_of is None or _caused(failure, because_of)) for failure in failures)
        return Verdict(holds, f"{_name(what)} ({_all(steps)})")

    def never(
        self, what: What | type[PlanFailure] | Callable[[Event], object], *, during: What | None = None
    ) -> Verdict:
        """Check that a step did not run, a failure class did not occur, or a predicate was true for no record.

        The predicate gets each record of the trace, with the ``path`` of its node if it has one. With ``during``, only
        events that overlap an execution of that step count.
        """
        spans = [(0, len(self.events))] if during is None else [(s.first, s.last) for s in self._started(during)]
        when = "" if during is None else f" during {_name(during)}"
        if isinstance(what, (str, Step)):
            for step in self.steps(what):
                if step.start is not None and any(step.first < last and first < step.last for first, last in spans):
                    return Verdict(False, f"{_name(what)} ran{when}: {_line(step)}")
            return Verdict(True, f"{_name(what)} did not run{when}")
        for index, event in enumerate(with_paths(self.events)):
            if any(first <= index <= last for first, last in spans):
                if isinstance(what, type) and issubclass(what, PlanFailure):
                    failure = event.get("failure")
                    occurred = isinstance(failure, Mapping) and (_is(failure, what) or _caused(failure, what))
                else:
                    occurred = bool(what(event))  # type: ignore[call-arg]
                if occurred:
                    where = event.get("path", "the run")
                    return Verdict(False, f"{_word(what)}{when}: {event['step'] / self.rate:g} s, {where}")
        return Verdict(True, f"no {_word(what)}{when}")

    def tree(self) -> str:
        """Format the task tree as indented text."""
        return tree_of(self.steps())

    def _find(self, what: What) -> list[Step]:
        steps = self.steps(what)
        if not steps:
            assert isinstance(what, str)
            raise NoSuchStep(what, self.names(), self._did_you_mean(what))
        return steps

    def _did_you_mean(self, query: str) -> str:
        """Suggest the step whose path has the parts of a query and further levels between them, or a similar name."""
        *above, last = query.split("/")
        for step in self.steps(last) if above else ():
            path, wanted = step.path.split("/"), above.copy()
            first = len(path) - 1
            while wanted and first:
                first -= 1
                if wanted[-1] in (path[first], path[first].partition("#")[0]):
                    wanted.pop()
            if not wanted:
                return f"; did you mean {'/'.join((*path[first:-1], last))!r}?"
        return did_you_mean(query, self.names())

    def names(self) -> list[str]:
        """Names of the steps and classes of their actions, in order of their start."""
        return list(dict.fromkeys(name for step in self.steps() for name in (step.name, step.action) if name))

    def _started(self, what: What) -> list[Step]:
        steps = [step for step in self._find(what) if step.start is not None]
        if not steps:
            raise NoSuchStep(_name(what), [step.name for step in self.steps() if step.start is not None])
        return steps

    def _ended(self, what: What, status: str) -> Verdict:
        steps = self._find(what)
        return Verdict(any(step.status == status for step in steps), f"{_name(what)} ({_all(steps)})")


_ONCE = {("branch", "plan"), ("branch", "perform"), ("state", "plan"), ("state", "perform"), ("perform", "branch")}
"""Kinds of a node and its child that count as one step if they have the same name; the last is a module's own node."""


def _duplicates_parent(step: Step, query: str) -> bool:
    """Check whether a step is a plan or an action in a branch or state of the same name, with which it counts once.

    The same applies to its first attempt inside recoveries.
    """
    parent, kind = step.parent, step.kind
    while parent is not None and parent.kind == "with_failure_handling" and parent.children[0] is step:
        step, parent = parent, parent.parent
    return parent is not None and (parent.kind, kind) in _ONCE and parent.called(query)


def _name(what: What) -> str:
    return what if isinstance(what, str) else what.path


def _word(what: object) -> str:
    return getattr(what, "__name__", None) or str(what)


def _line(step: Step) -> str:
    return step.summary(LONGEST)


def _all(steps: Sequence[Step]) -> str:
    more = f"; and {len(steps) - SHOWN} more" if len(steps) > SHOWN else ""
    return "; ".join(map(_line, steps[:SHOWN])) + more


def _names(kind: type) -> set[str]:
    names: set[str] = set()
    stack = [kind]
    while stack:
        cls = stack.pop()
        names.add(cls.__name__)
        stack.extend(cls.__subclasses__())
    return names


def _is(failure: Event, kind: type[PlanFailure]) -> bool:
    names = _names(kind)
    members = [str(member).split(":", 1)[0] for member in failure.get("members", {}).values()]
    return failure["type"] in names or (bool(members) and all(member in names for member in members))


def _caused(failure: Event, kind: type[PlanFailure]) -> bool:
    return any(_is(one, kind) for one in links(failure.get("cause")))


class NoSuchStep(AssertionError):
    """A query names a step that did not run. An error, as the name may be misspelt."""

    def __init__(self, step: str, names: Iterable[str], hint: str = "") -> None:
        known = list(dict.fromkeys(names))
        hint = hint or did_you_mean(step, known) or f"; steps that did: {', '.join(known)}"
        super().__init__(f"no step {step!r} ran{hint}")


class Verdict:
    """Result of a query, with a reason that a failing ``assert run.happened_before("a", "b")`` shows."""

    def __init__(self, holds: bool, reason: str) -> None:
        self.holds = holds
        self.reason = reason

    def __bool__(self) -> bool:
        return self.holds

    def __repr__(self) -> str:
        return f"<{'yes' if self.holds else 'no'}: {self.reason}>"

    def __str__(self) -> str:
        return self.reason


class Count(int):
    """A number of attempts, with a description of each."""

    step: str
    attempts: Sequence[str]
    hint: str

    def __new__(cls, step: str, attempts: Sequence[str], hint: str = "") -> Count:
        """Make a count from one line for each attempt; ``hint`` is a suggestion for a step without any."""
        count = super().__new__(cls, len(attempts))
        count.step = step
        count.attempts = tuple(attempts)
        count.hint = hint
        return count

    def __repr__(self) -> str:
        return str(int(self))

    def __str__(self) -> str:
        return str(int(self))

    def explained(self) -> list[str]:
        """Format the attempts, one per line."""
        if not self.attempts:
            return [f"{self.step} never began{self.hint}"]
        return [f"{self.step}, attempt {number}: {line}" for number, line in enumerate(self.attempts, 1)]
