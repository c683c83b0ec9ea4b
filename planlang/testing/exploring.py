"""explore: whether what a plan does depends on the order in which tasks that could run did run."""

from __future__ import annotations

import difflib
import heapq
import json
import math
from collections import Counter, deque
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from random import Random
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from planlang.failures import PlanFailure
from planlang.kernel.core import ChoiceSource
from planlang.kernel.schedule import ListedSchedule, RandomSchedule
from planlang.misuse import Usage
from planlang.records import dataclass
from planlang.runs import with_paths
from planlang.runs.codec import encode
from planlang.testing.faults import Fault
from planlang.testing.history import History
from planlang.testing.running import PlanRun, UnusedRule, attempt, made

if TYPE_CHECKING:
    from planlang.kernel import Task


class Recorder:
    """Passes choices on, first come first served without a source, and keeps them with what there was to choose."""

    def __init__(self, source: ChoiceSource | None = None) -> None:
        self._source = source
        self.choices: list[int] = []
        self.sizes: list[int] = []
        """Of how many tasks each choice was."""

    def choose(self, ready: Sequence[Task]) -> int:
        """Return what the source chooses, and keep it."""
        choice = 0 if self._source is None else self._source.choose(ready)
        self.choices.append(choice)
        self.sizes.append(len(ready))
        return choice

    def __str__(self) -> str:
        return "first come, first served" if self._source is None else str(self._source)


class Priorities:
    """Probabilistic concurrency testing: tasks have random priorities, which change at a few random moments.

    Where ``depth`` steps must come in a certain order for something to happen, one such schedule finds it with a
    probability of at least 1 / (tasks * length ** (depth - 1)) (Burckhardt et al., ASPLOS 2010). ``length`` is how
    many choices a run is expected to have.
    """

    def __init__(self, number: int, length: int, depth: int = 3) -> None:
        self._number = number
        self._random = Random(f"priorities {number}")
        self._priorities: dict[Task, float] = {}
        self._changes = {self._random.randrange(max(1, length)) for _ in range(depth - 1)}
        self._asked = 0
        self._lowest = 0.0

    def choose(self, ready: Sequence[Task]) -> int:
        """Choose the task of the highest priority; at a moment of change it becomes the lowest first."""
        priorities = self._priorities
        for task in ready:
            if task not in priorities:
                priorities[task] = self._random.random()
        best = self._best(ready)
        if self._asked in self._changes:
            self._lowest -= 1.0
            priorities[ready[best]] = self._lowest
            best = self._best(ready)
        self._asked += 1
        return best

    def _best(self, ready: Sequence[Task]) -> int:
        return max(range(len(ready)), key=lambda place: self._priorities[ready[place]])

    def __str__(self) -> str:
        return f"priorities {self._number}"


def trimmed(choices: Sequence[int]) -> tuple[int, ...]:
    """Return choices without the zeros at the end, which are implied."""
    end = len(choices)
    while end and choices[end - 1] == 0:
        end -= 1
    return tuple(choices[:end])


Choices = tuple[int, ...]


def continued(choices: Choices, sizes: Sequence[int]) -> Iterator[Choices]:
    """Yield the lists that go on from one, with one more choice other than zero; ``sizes`` are those of its run.

    Every list without zeros at its end comes from exactly one other, so that all are met once, beginning with ().
    """
    for place in range(len(choices), len(sizes)):
        for choice in range(1, sizes[place]):
            yield (*choices, *(0,) * (place - len(choices)), choice)


class Shrinker:
    """Looks for the shortest list, of the shortest the smallest, for which ``breaks`` holds.

    ``breaks`` runs the plan with a list and returns whether it still does it, and of how many tasks each choice of
    that run was. At most ``runs`` runs are made; ``proven`` is true if all shorter lists were tried.
    """

    def __init__(self, breaks: Callable[[Choices], tuple[bool, Sequence[int]]], runs: int) -> None:
        self._breaks = breaks
        self.left = runs
        self.proven = False
        self._known: dict[Choices, tuple[bool, Sequence[int]]] = {}

    def shrink(self, choices: Sequence[int]) -> Choices:
        """Return the best list found, from one that breaks."""
        best = trimmed(choices)
        while self.left > 0:
            better = self._once(best)
            if better == best:
                break
            best = better
        return self._search(best)

    def _run(self, choices: Choices) -> tuple[bool, Sequence[int]]:
        if choices not in self._known:
            if self.left <= 0:
                return False, ()
            self.left -= 1
            self._known[choices] = self._breaks(choices)
        return self._known[choices]

    def _once(self, best: Choices) -> Choices:
        """Make one pass: leave out pieces, large ones first, then set choices to zero, then lower them."""
        size = max(1, len(best) // 2)
        while True:
            place = 0
            while place < len(best):
                best, changed = self._better(best, (*best[:place], *best[place + size :]))
                place += 0 if changed else size
            if size == 1:
                break
            size //= 2
        for place in range(len(best)):
            if place < len(best) and best[place]:
                best, changed = self._better(best, (*best[:place], 0, *best[place + 1 :]))
                for lower in range(1, best[place] if not changed and place < len(best) else 0):
                    best, changed = self._better(best, (*best[:place], lower, *best[place + 1 :]))
                    if changed:
                        break
        return best

    def _better(self, best: Choices, other: Choices) -> tuple[Choices, bool]:
        other = trimmed(other)
        if (len(other), other) < (len(best), best) and self._run(other)[0]:
            return other, True
        return best, False

    def _search(self, best: Choices) -> Choices:
        """Try all lists that come before the best one, shortest first, as long as there are runs left."""
        queue: list[tuple[int, Choices]] = [(0, ())]
        while queue:
            length, choices = heapq.heappop(queue)
            if (length, choices) >= (len(best), best):
                self.proven = True
                return best
            if self.left <= 0 and choices not in self._known:
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

    ``usual`` is the run first come, first served, ``other`` the one with ``choices``, the shortest list found for
    which the outcome differs or an assertion does not hold.
    """

    def __init__(self, message: str, usual: PlanRun[Any], other: PlanRun[Any], choices: Choices) -> None:
        super().__init__(message)
        self.usual = usual
        self.other = other
        self.choices = choices


@dataclass(frozen=True)
class Exploration:
    """Schedules that all gave the same: how many were run, how many of them differed, whether these are all."""

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
    faults: Sequence[Fault] = (),
    seed: int = 0,
    within: float = 86_400.0,
    shrinking_runs: int = 1000,
    allow_unused: bool = False,
) -> Exploration:
    """Run a plan under all schedules if they are few, else under some.

    Of these half are random, half follow priorities that change now and then.

    With ``check`` an assertion about each run (``def check(run): assert ...``) has to hold under all of them; without
    it the outcome, value or failure, has to be the same. Otherwise raises :class:`ScheduleDependence`, whose message
    shows the shortest list of choices that does it and the two traces side by side; ``run_plan(plan, schedule=list)``
    repeats it. The plan has to make what it changes anew each time; ValueError if two equal runs differ. A rule or a
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
    made.append(other)
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
    """Runs of one plan under one schedule after the other, beside the usual one: first come, first served."""

    def __init__(self, run: Callable[[ChoiceSource], PlanRun[V]], check: Check | None) -> None:
        """Run as usual; raises what that does, and ValueError if it does another thing the second time."""
        self._run, self._check = run, check
        self.unmatched: Mapping[str, str] | None = None
        """Rules and faults of the script whose steps occurred in no run."""
        self.usual, self._first = self.run(None)
        made.append(self.usual)
        if self.usual.error is not None:
            raise self.usual.error
        if check is not None:
            check(self.usual)
        again, _ = self.run(None)
        if again.trace.text() != self.usual.trace.text():
            raise ValueError(
                "two runs with the same choices differ: the plan, or what it calls, keeps something between runs or "
                f"reads a clock or random numbers of its own\n{side_by_side(self.usual, again)}"
            )
        self.expected = outcome_of(self.usual)
        self.seen = Counter({trimmed(self._first.choices): 1})
        """The number of times that each list of choices was made."""
        self.complete = False
        """True once all schedules were tried."""

    def run(self, source: ChoiceSource | None) -> tuple[PlanRun[V], Recorder]:
        """Return a run under a schedule, and the choices that it asked for."""
        recorder = Recorder(source)
        ended = self._run(recorder)
        ended.schedule = trimmed(recorder.choices)
        known = ended.unmatched if self.unmatched is None else self.unmatched
        self.unmatched = {rule: hint for rule, hint in known.items() if rule in ended.unmatched}
        return ended, recorder

    def wrong(self, run: PlanRun[V]) -> str | None:
        """Return what is wrong with a run, or None."""
        if self._check is None:
            outcome = outcome_of(run)
            return None if outcome == self.expected else f"{outcome} instead of {self.expected}"
        if run.error is not None:
            return f"{type(run.error).__name__}: {run.error}"
        try:
            self._check(run)
        except AssertionError as broken:
            return str(broken) or "an assertion does not hold"
        except Exception as raised:
            return f"{type(raised).__name__}: {raised}"
        return None

    def breaks(self, choices: Choices) -> tuple[bool, Sequence[int]]:
        """Return whether something is wrong after some choices, and of how many tasks each one was."""
        run, recorder = self.run(ListedSchedule(choices))
        return self.wrong(run) is not None, recorder.sizes

    def broken(self, schedules: int) -> Choices | None:
        """Return choices after which something is wrong; None if there are none among so many schedules."""
        sizes = self._first.sizes
        left = deque(continued((), sizes) if math.prod(sizes) <= schedules else ())
        every = len(left) > 0 or not sizes
        number = 0
        while self.seen.total() < schedules and not (every and not left):
            if left:
                source: ChoiceSource = ListedSchedule(left.popleft())
            else:
                source = RandomSchedule(number) if number % 2 == 0 else Priorities(number, len(self._first.choices))
                number += 1
            run, recorder = self.run(source)
            choices = trimmed(recorder.choices)
            self.seen[choices] += 1
            if self.wrong(run) is not None:
                return choices
            if every:
                left.extend(continued(choices, recorder.sizes))
        self.complete = every and not left
        return None


def outcome_of(run: PlanRun[Any]) -> str:
    """Return a run's value or failure as text that can be compared."""
    if run.failure is not None:
        return f"{type(run.failure).__name__}: {run.failure}"
    if run.error is not None:
        return f"{type(run.error).__name__}: {str(run.error).splitlines()[0] if str(run.error) else ''}"
    value = run.value
    text = repr(value) if isinstance(value, PlanFailure) else json.dumps(encode(value), ensure_ascii=False)
    return f"returned {text}"


WIDTH = 58
"""Characters of a column: two of them fit on a screen."""
BEFORE = 3
"""Equal lines that are shown before the first difference."""
MOST_LINES = 60
"""Lines of a difference that are shown: as many as a screen has."""


def side_by_side(usual: History, other: History) -> str:
    """Return the traces of two runs in two columns, from a little before they differ; ``|`` marks what differs."""
    left, right = _lines(usual), _lines(other)
    rows: list[tuple[str, str, str]] = []
    matcher = difflib.SequenceMatcher(None, left, right, autojunk=False)
    for what, a, b, c, d in matcher.get_opcodes():
        ours, theirs = left[a:b], right[c:d]
        for number in range(max(len(ours), len(theirs))):
            one = ours[number] if number < len(ours) else ""
            two = theirs[number] if number < len(theirs) else ""
            rows.append((one, " " if what == "equal" else "|", two))
    first = next((number for number, row in enumerate(rows) if row[1] == "|"), len(rows))
    begin = max(0, first - BEFORE)
    shown = rows[begin : begin + MOST_LINES]
    lines = [f"{'first come, first served':{WIDTH}}   with these choices"]
    if begin:
        lines.append(f"... {begin} lines are the same")
    lines.extend(f"{_cut(one):{WIDTH}} {mark} {_cut(two)}".rstrip() for one, mark, two in shown)
    if begin + MOST_LINES < len(rows):
        lines.append(f"... {len(rows) - begin - MOST_LINES} more lines")
    return "\n".join(lines)


def _lines(run: History) -> list[str]:
    return [_line(event, run.rate) for event in with_paths(run.events) if event["event"] != "header"]


def _line(event: Mapping[str, Any], rate: int) -> str:
    known = ("step", "event", "path", "status", "failure")
    place = ("node", "parent", "kind", "name") if "node" in event else ()
    parts = [f"{event['step'] / rate:6.3f} s", _short(str(event.get("path", "")))]
    parts.append(event.get("status") or event["event"])
    if "failure" in event:
        parts.append(f"{event['failure']['type']}: {event['failure']['message']}")
    parts.extend(f"{key} {value}" for key, value in event.items() if key not in (*known, *place))
    return " ".join(part for part in parts if part)


def _short(path: str) -> str:
    names = path.split("/")
    return path if len(names) <= 3 else "../" + "/".join(names[-3:])


def _cut(text: str) -> str:
    return text if len(text) <= WIDTH else text[: WIDTH - 3] + "..."
