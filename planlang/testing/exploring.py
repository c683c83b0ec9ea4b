"""explore: searches for schedules of the tasks that change the outcome of a plan."""

from __future__ import annotations

import difflib
import heapq
import json
import math
from collections import Counter, deque
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from itertools import zip_longest
from random import Random
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from planlang.failures import PlanFailure
from planlang.faults.steps import Fault
from planlang.kernel.core import ChoiceSource
from planlang.kernel.schedule import ListedSchedule, RandomSchedule
from planlang.misuse import Usage
from planlang.records import dataclass
from planlang.runs import with_paths
from planlang.runs.codec import encode
from planlang.testing.history import History
from planlang.testing.running import PlanRun, UnusedRule, attempt, recent_runs

if TYPE_CHECKING:
    from planlang.kernel import Task


class Recorder:
    """Schedule that records the choices of another one, by default first come, first served."""

    def __init__(self, source: ChoiceSource | None = None) -> None:
        self._source = source
        self.choices: list[int] = []
        self.sizes: list[int] = []
        """Number of tasks at each choice."""

    def choose(self, ready: Sequence[Task]) -> int:
        """Let the source choose, and record the choice."""
        choice = 0 if self._source is None else self._source.choose(ready)
        self.choices.append(choice)
        self.sizes.append(len(ready))
        return choice

    def __str__(self) -> str:
        return "first come, first served" if self._source is None else str(self._source)


class Priorities:
    """Probabilistic concurrency testing: tasks have random priorities, which change at a few random choices.

    A bug that needs ``depth`` steps in a certain order is found by one such schedule with a probability of at least
    1 / (tasks * length ** (depth - 1)) (Burckhardt et al., ASPLOS 2010). ``length`` is the expected number of choices
    of a run.
    """

    def __init__(self, number: int, length: int, depth: int = 3) -> None:
        self._number = number
        self._random = Random(f"priorities {number}")
        self._priorities: dict[Task, float] = {}
        self._changes = {self._random.randrange(max(1, length)) for _ in range(depth - 1)}
        self._choices_made = 0
        self._lowest = 0.0

    def choose(self, ready: Sequence[Task]) -> int:
        """Choose the task with the highest priority; at a change, this task first gets the lowest one."""
        priorities = self._priorities
        for task in ready:
            if task not in priorities:
                priorities[task] = self._random.random()
        best = self._best(ready)
        if self._choices_made in self._changes:
            self._lowest -= 1.0
            priorities[ready[best]] = self._lowest
            best = self._best(ready)
        self._choices_made += 1
        return best

    def _best(self, ready: Sequence[Task]) -> int:
        return max(range(len(ready)), key=lambda index: self._priorities[ready[index]])

    def __str__(self) -> str:
        return f"priorities {self._number}"


def trimmed(choices: Sequence[int]) -> tuple[int, ...]:
    """Remove the zeros at the end, which are implied."""
    end = len(choices)
    while end and choices[end - 1] == 0:
        end -= 1
    return tuple(choices[:end])


Choices = tuple[int, ...]


def continued(choices: Choices, sizes: Sequence[int]) -> Iterator[Choices]:
    """Yield the lists with one further choice other than zero; ``sizes`` has the number of tasks at each choice.

    Every list without trailing zeros continues exactly one other, so that starting from () all are found once.
    """
    for index in range(len(choices), len(sizes)):
        for choice in range(1, sizes[index]):
            yield (*choices, *(0,) * (index - len(choices)), choice)


class Shrinker:
    """Search for the shortest list of choices, and the smallest of these, that breaks a plan.

    ``breaks`` runs the plan with a list, and returns whether it breaks and the number of tasks at each choice. At most
    ``runs`` runs are made; ``proven`` is true if all shorter lists were tried.
    """

    def __init__(self, breaks: Callable[[Choices], tuple[bool, Sequence[int]]], runs: int) -> None:
        self._breaks = breaks
        self.left = runs
        self.proven = False
        self._results: dict[Choices, tuple[bool, Sequence[int]]] = {}

    def shrink(self, choices: Sequence[int]) -> Choices:
        """Find the best list, starting from one that breaks the plan."""
        best = trimmed(choices)
        while self.left > 0:
            better = self._once(best)
            if better == best:
                break
            best = better
        return self._search(best)

    def _run(self, choices: Choices) -> tuple[bool, Sequence[int]]:
        if choices not in self._results:
            if self.left <= 0:
                return False, ()
            self.left -= 1
            self._results[choices] = self._breaks(choices)
        return self._results[choices]

    def _once(self, best: Choices) -> Choices:
        """Make one pass: remove pieces, large ones first, then set choices to zero, then lower them."""
        # Pieces are halved as in delta debugging (Zeller and Hildebrandt, IEEE TSE 2002).
        size = max(1, len(best) // 2)
        while True:
            index = 0
            while index < len(best):
                best, changed = self._better(best, (*best[:index], *best[index + size :]))
                index += 0 if changed else size
            if size == 1:
                break
            size //= 2
        for index in range(len(best)):
            if index < len(best) and best[index]:
                best, changed = self._better(best, (*best[:index], 0, *best[index + 1 :]))
                for lower in range(1, best[index] if not changed and index < len(best) else 0):
                    best, changed = self._better(best, (*best[:index], lower, *best[index + 1 :]))
                    if changed:
                        break
        return best

    def _better(self, best: Choices, other: Choices) -> tuple[Choices, bool]:
        other = trimmed(other)
        if (len(other), other) < (len(best), best) and self._run(other)[0]:
            return other, True
        return best, False

    def _search(self, best: Choices) -> Choices:
        """Try all lists smaller than the best one, shortest first, while runs are left."""
        queue: list[tuple[int, Choices]] = [(0, ())]
        while queue:
            length, choices = heapq.heappop(queue)
            if (length, choices) >= (len(best), best):
                self.proven = True
                return best
            if self.left <= 0 and choices not in self._results:
                return best
            broken, sizes = self._run(choices)
            if broken:
                self.proven = True
                return choices
            for longer in continued(choices, sizes[: len(best)]):
                heapq.heappush(queue, (len(longer), longer))
        self.proven = True
        return best


if TYPE_CHECKING:
    from planlang.testing.script import Script

V = TypeVar("V")

Check = Callable[[PlanRun[Any]], object]


class ScheduleDependence(AssertionError):
    """The outcome of a plan depends on the schedule.

    ``usual`` is the run with first come, first served; ``other`` the run with ``choices``, the shortest list found for
    which the outcome differs or an assertion fails.
    """

    def __init__(self, message: str, usual: PlanRun[Any], other: PlanRun[Any], choices: Choices) -> None:
        super().__init__(message)
        self.usual = usual
        self.other = other
        self.choices = choices


@dataclass(frozen=True)
class Exploration:
    """Result of an exploration in which all schedules had the same outcome.

    ``different`` is the number of different schedules among the ``runs``; ``complete`` is true if these are all.
    """

    outcome: str
    runs: int
    different: int
    complete: bool

    def __str__(self) -> str:
        if self.complete:
            which = "the only schedule" if self.different == 1 else f"all {self.different} schedules"
            return f"{self.outcome}, under {which}"
        return f"{self.outcome}, in {self.runs} runs with {self.different} different schedules"


_EXPLORE = Usage("explore", {"plan": "serve"})


def explore(
    plan: Callable[[], Awaitable[V]],
    schedules: int = 200,
    *,
    check: Check | None = None,
    script: Script | None = None,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
    within: float = 86_400.0,
    shrinking_runs: int = 1000,
    allow_unused: bool = False,
) -> Exploration:
    """Run a plan under all schedules if there are at most ``schedules``, otherwise under a sample of that size.

    Half of the sample is random, and half consists of :class:`Priorities`.

    The outcome of all runs, value or failure, must be the same; or with ``check`` (``def check(run): assert ...``), its
    assertions must hold for each run. Otherwise raises :class:`ScheduleDependence`, whose message shows the shortest
    list of choices with a different outcome, and the two traces side by side; ``run_plan(plan, schedule=list)`` repeats
    it. Mutable state must be created inside the plan: ValueError if two runs with the same choices differ. A rule or
    fault of the script for a step that occurred in no run raises UnusedRule, unless ``allow_unused``.
    """
    _EXPLORE.branch("plan", plan)

    def run(schedule: ChoiceSource) -> PlanRun[V]:
        return attempt(plan, script=script, faults=faults, seed=seed, schedule=schedule, within=within)

    explorer = _Explorer(run, check)
    broken = explorer.broken(schedules)
    if broken is None:
        runs, complete = explorer.seen.total(), explorer.complete
        if explorer.unmatched and not allow_unused:
            raise UnusedRule(explorer.unmatched, f"{runs} runs of {explorer.usual.name}")
        return Exploration(explorer.expected, runs, len(explorer.seen), complete)
    shrinker = Shrinker(explorer.breaks, shrinking_runs)
    choices = shrinker.shrink(broken)
    other, _ = explorer.run(ListedSchedule(choices))
    recent_runs.append(other)
    shortest = "the shortest list of choices" if shrinker.proven else "a short list of choices"
    raise ScheduleDependence(
        f"the outcome depends on the schedule: {explorer.wrong(other)}\n"
        f"found in run {explorer.seen.total()} of {schedules}; {shortest} is {list(choices)}; "
        f"repeat it with run_plan({explorer.usual.name}, schedule={list(choices)})\n"
        f"{side_by_side(explorer.usual, other)}",
        explorer.usual,
        other,
        choices,
    )


class _Explorer(Generic[V]):
    """Runs of a plan under different schedules, compared with the usual one, first come, first served."""

    def __init__(self, run: Callable[[ChoiceSource], PlanRun[V]], check: Check | None) -> None:
        """Run the plan as usual, twice; raises its error, and ValueError if the two runs differ."""
        self._run, self._check = run, check
        self.unmatched: Mapping[str, str] | None = None
        """Rules and faults of the script whose steps occurred in no run."""
        self.usual, self._first = self.run(None)
        recent_runs.append(self.usual)
        if self.usual.error is not None:
            raise self.usual.error
        if check is not None:
            check(self.usual)
        again, _ = self.run(None)
        if again.trace.text() != self.usual.trace.text():
            raise ValueError(
                "two runs with the same choices differ: the plan, or a function that it calls, keeps state between "
                f"runs, or reads a clock or its own random numbers\n{side_by_side(self.usual, again)}"
            )
        self.expected = outcome_of(self.usual)
        self.seen = Counter({trimmed(self._first.choices): 1})
        """Number of runs with each list of choices."""
        self.complete = False
        """True once all schedules were tried."""

    def run(self, source: ChoiceSource | None) -> tuple[PlanRun[V], Recorder]:
        """Run the plan under a schedule; return the run and its choices."""
        recorder = Recorder(source)
        ended = self._run(recorder)
        ended.schedule = trimmed(recorder.choices)
        unmatched = ended.unmatched if self.unmatched is None else self.unmatched
        self.unmatched = {rule: hint for rule, hint in unmatched.items() if rule in ended.unmatched}
        return ended, recorder

    def wrong(self, run: PlanRun[V]) -> str | None:
        """Describe what is wrong with a run; None if nothing is."""
        if self._check is None:
            outcome = outcome_of(run)
            return None if outcome == self.expected else f"{outcome} instead of {self.expected}"
        if run.error is not None:
            return f"{type(run.error).__name__}: {run.error}"
        try:
            self._check(run)
        except AssertionError as broken:
            return str(broken) or "an assertion failed"
        except Exception as raised:
            return f"{type(raised).__name__}: {raised}"
        return None

    def breaks(self, choices: Choices) -> tuple[bool, Sequence[int]]:
        """Check whether choices break the plan; return this and the number of tasks at each choice."""
        run, recorder = self.run(ListedSchedule(choices))
        return self.wrong(run) is not None, recorder.sizes

    def broken(self, schedules: int) -> Choices | None:
        """Find choices that break the plan, in at most this number of runs; None if there are none."""
        sizes = self._first.sizes
        remaining = deque(continued((), sizes) if math.prod(sizes) <= schedules else ())
        exhaustive = len(remaining) > 0 or not sizes
        number = 0
        while self.seen.total() < schedules and not (exhaustive and not remaining):
            if remaining:
                source: ChoiceSource = ListedSchedule(remaining.popleft())
            else:
                source = RandomSchedule(number) if number % 2 == 0 else Priorities(number, len(self._first.choices))
                number += 1
            run, recorder = self.run(source)
            choices = trimmed(recorder.choices)
            self.seen[choices] += 1
            if self.wrong(run) is not None:
                return choices
            if exhaustive:
                remaining.extend(continued(choices, recorder.sizes))
        self.complete = exhaustive and not remaining
        return None


def outcome_of(run: PlanRun[Any]) -> str:
    """Format the value or failure of a run as text, for comparison."""
    if run.failure is not None:
        return f"{type(run.failure).__name__}: {run.failure}"
    if run.error is not None:
        return f"{type(run.error).__name__}: {str(run.error).splitlines()[0] if str(run.error) else ''}"
    value = run.value
    text = repr(value) if isinstance(value, PlanFailure) else json.dumps(encode(value), ensure_ascii=False)
    return f"returned {text}"


WIDTH = 58
"""Width of a column [characters]: two of them fit on a screen."""
BEFORE = 3
"""Number of equal lines shown before the first difference."""
MAX_LINES = 60
"""Maximum number of lines shown of a difference: about a screen."""


def side_by_side(usual: History, other: History) -> str:
    """Format the traces of two runs in two columns, from shortly before their first difference; ``|`` marks it."""
    left, right = _lines(usual), _lines(other)
    rows: list[tuple[str, str, str]] = []
    matcher = difflib.SequenceMatcher(None, left, right, autojunk=False)
    for what, a, b, c, d in matcher.get_opcodes():
        ours, theirs = left[a:b], right[c:d]
        mark = " " if what == "equal" else "|"
        rows.extend((our, mark, their) for our, their in zip_longest(ours, theirs, fillvalue=""))
    first = next((number for number, row in enumerate(rows) if row[1] == "|"), len(rows))
    begin = max(0, first - BEFORE)
    shown = rows[begin : begin + MAX_LINES]
    lines = [f"{'first come, first served':{WIDTH}}   with these choices"]
    if begin:
        lines.append(f"... {begin} lines are the same")
    lines.extend(f"{_cut(our):{WIDTH}} {mark} {_cut(their)}".rstrip() for our, mark, their in shown)
    if begin + MAX_LINES < len(rows):
        lines.append(f"... {len(rows) - begin - MAX_LINES} more lines")
    return "\n".join(lines)


def _lines(run: History) -> list[str]:
    return [_line(event, run.rate) for event in with_paths(run.events) if event["event"] != "header"]


def _line(event: Mapping[str, Any], rate: int) -> str:
    formatted = ("step", "event", "path", "status", "failure")
    frame = ("node", "parent", "kind", "name") if "node" in event else ()
    names = str(event.get("path", "")).split("/")
    path = "/".join(names if len(names) <= 3 else ["..", *names[-3:]])
    parts = [f"{event['step'] / rate:6.3f} s", path]
    parts.append(event.get("status") or event["event"])
    if "failure" in event:
        parts.append(f"{event['failure']['type']}: {event['failure']['message']}")
    parts.extend(f"{key} {value}" for key, value in event.items() if key not in (*formatted, *frame))
    return " ".join(part for part in parts if part)


def _cut(text: str) -> str:
    return text if len(text) <= WIDTH else text[: WIDTH - 3] + "..."
