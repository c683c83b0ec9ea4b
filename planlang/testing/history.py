"""The steps of a run, read from its trace, and questions about them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from planlang.failures import PlanFailure
from planlang.language.tasktree import tree_of
from planlang.misuse import did_you_mean
from planlang.runs import RunTree, with_paths
from planlang.runs import TaskNode as Step

Event = Mapping[str, Any]
What = str | Step
"""A step given by its name, ``parent/name``, its action's class, or itself."""
LONGEST = 60
"""Reasons show as much of a failure's message: pytest cuts what is longer than 240 characters in the middle."""
SHOWN = 3
"""Runs of a step that a reason shows."""


class History:
    """The events of a run, and questions about them.

    A step is given by its name in the task tree (all runs of it), by ``parent/name``, by the class of a performed
    action, or is a :class:`Step` from :meth:`steps`. Asking about a step that never ran raises :class:`NoSuchStep`;
    :meth:`attempts` and :meth:`never` may be asked about anything.
    """

    def __init__(self, events: Sequence[Event], rate: int) -> None:
        self.events = events
        """The trace, one mapping per record; ``planlang.runs.with_paths`` adds the paths."""
        self.rate = rate
        self._tree = RunTree()

    def steps(self, what: What | None = None) -> list[Step]:
        """Return the runs of a step, in the order in which they began; all steps without a name."""
        self._tree.go_on(self.events)
        steps = list(self._tree.numbered.values())
        if what is None:
            return steps
        if isinstance(what, Step):
            return [what]
        found = [step for step in steps if step.called(what)]
        return [step for step in found if not _stands_for_its_branch(step, what)]

    def happened_before(self, first: What, second: What) -> Verdict:
        """Answer whether the first run of one step had ended before any run of the other began."""
        one, other = self._begun(first)[0], self._begun(second)[0]
        holds = one.last < other.first
        return Verdict(holds, f"{_name(first)} ({_line(one)}); {_name(second)} ({_line(other)})")

    def overlapped(self, first: What, second: What) -> Verdict:
        """Answer whether a run of one step was open when a run of the other one began."""
        ones, others = self._begun(first), self._begun(second)
        for one in ones:
            for other in others:
                if one is not other and one.first < other.last and other.first < one.last:
                    return Verdict(True, f"{_name(first)} ({_line(one)}), {_name(second)} ({_line(other)})")
        return Verdict(False, f"{_name(first)} ({_all(ones)}), {_name(second)} ({_all(others)})")

    def attempts(self, what: What, *, inner: bool = False) -> Count:
        """Count how often a step of the plan began; for with_failure_handling, how often it ran its body.

        With ``inner`` what process modules perform themselves inside of an action counts, too.
        """
        steps = [step for step in self.steps(what) if step.start is not None and (inner or not step.inner)]
        lines = [
            line
            for step in steps
            for line in ([f"{time:g} s" for time in step.repeats] if step.repeats else [step.summary()])
        ]
        return Count(_name(what), lines)

    def evaporated(self, what: What) -> Verdict:
        """Answer whether a run of the step was evaporated."""
        return self._ended(what, "evaporated")

    def succeeded(self, what: What) -> Verdict:
        """Answer whether a run of the step succeeded."""
        return self._ended(what, "succeeded")

    def failed_with(
        self, what: What, kind: type[PlanFailure], *, because_of: type[PlanFailure] | None = None
    ) -> Verdict:
        """Answer whether a run of the step failed with a failure of a class, or of several all of that class.

        With ``because_of`` a failure of that class has to be among its causes.
        """
        steps = self._of(what)
        failures = [step.failure for step in steps if step.failure is not None and step.status == "failed"]
        holds = any(_is(failure, kind) and (because_of is None or _caused(failure, because_of)) for failure in failures)
        return Verdict(holds, f"{_name(what)} ({_all(steps)})")

    def never(
        self, what: What | type[PlanFailure] | Callable[[Event], object], *, during: What | None = None
    ) -> Verdict:
        """Answer whether something did not happen: a step, a failure of a class, a record for which a test holds.

        The test gets each record of the trace with the ``path`` of its node, if it has one.
        With ``during`` only what overlapped a run of that step counts.
        """
        spans = [(0, len(self.events))] if during is None else [(s.first, s.last) for s in self._begun(during)]
        when = "" if during is None else f" during {_name(during)}"
        if isinstance(what, (str, Step)):
            for step in self.steps(what):
                if step.start is not None and any(step.first < last and first < step.last for first, last in spans):
                    return Verdict(False, f"{_name(what)} ran{when}: {_line(step)}")
            return Verdict(True, f"{_name(what)} did not run{when}")
        for place, event in enumerate(with_paths(self.events)):
            if any(first <= place <= last for first, last in spans):
                if isinstance(what, type) and issubclass(what, PlanFailure):
                    failure = event.get("failure")
                    found = isinstance(failure, Mapping) and (_is(failure, what) or _caused(failure, what))
                else:
                    found = bool(what(event))  # type: ignore[call-arg]
                if found:
                    where = event.get("path", "the run")
                    return Verdict(False, f"{_word(what)}{when}: {event['step'] / self.rate:g} s, {where}")
        return Verdict(True, f"no {_word(what)}{when}")

    def tree(self) -> str:
        """Return the task tree as indented text."""
        return tree_of(self.steps())

    def _of(self, what: What) -> list[Step]:
        found = self.steps(what)
        if not found:
            assert isinstance(what, str)
            raise NoSuchStep(what, self.names())
        return found

    def names(self) -> list[str]:
        """Return the names of the steps and the classes of the actions that were performed, in order of beginning."""
        return list(dict.fromkeys(name for step in self.steps() for name in (step.name, step.action) if name))

    def _begun(self, what: What) -> list[Step]:
        found = [step for step in self._of(what) if step.start is not None]
        if not found:
            raise NoSuchStep(_name(what), [step.name for step in self.steps() if step.start is not None])
        return found

    def _ended(self, what: What, status: str) -> Verdict:
        steps = self._of(what)
        return Verdict(any(step.status == status for step in steps), f"{_name(what)} ({_all(steps)})")


_ONCE = {("branch", "plan"), ("branch", "perform"), ("state", "plan"), ("state", "perform"), ("perform", "branch")}
"""Kinds of a node and of one inside it that are one step if they have one name; the last is a module's own node."""


def _stands_for_its_branch(step: Step, query: str) -> bool:
    """Return True for a plan or an action that is a branch or a state of the same name: it counts once.

    So does the first attempt of one with recoveries around it.
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
    found: set[str] = set()
    stack = [kind]
    while stack:
        one = stack.pop()
        found.add(one.__name__)
        stack.extend(one.__subclasses__())
    return found


def _is(failure: Event, kind: type[PlanFailure]) -> bool:
    names = _names(kind)
    members = [str(member).split(":", 1)[0] for member in failure.get("members", {}).values()]
    return failure["type"] in names or (bool(members) and all(member in names for member in members))


def _caused(failure: Event, kind: type[PlanFailure]) -> bool:
    cause = failure.get("cause")
    while cause is not None:
        if _is(cause, kind):
            return True
        cause = cause.get("cause")
    return False


class NoSuchStep(AssertionError):
    """A question names a step that did not run, so that a misspelt name does not pass for an answer."""

    def __init__(self, step: str, names: Iterable[str]) -> None:
        known = list(dict.fromkeys(names))
        hint = did_you_mean(step, known) or f"; steps that did: {', '.join(known)}"
        super().__init__(f"no step {step!r} ran{hint}")


class Verdict:
    """Yes or no, and why: ``assert run.happened_before("a", "b")`` shows the reason when it fails."""

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
    """A number of attempts, with how each of them went."""

    step: str
    attempts: Sequence[str]

    def __new__(cls, step: str, attempts: Sequence[str]) -> Count:
        """Make the number of ``attempts``, each of which is a line."""
        count = super().__new__(cls, len(attempts))
        count.step = step
        count.attempts = tuple(attempts)
        return count

    def __repr__(self) -> str:
        return str(int(self))

    def __str__(self) -> str:
        return str(int(self))

    def explained(self) -> list[str]:
        """Return one line per attempt."""
        if not self.attempts:
            return [f"{self.step} never began"]
        return [f"{self.step}, attempt {number}: {line}" for number, line in enumerate(self.attempts, 1)]
