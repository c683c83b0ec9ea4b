"""partial_order: steps with orderings between them, everything else side by side."""

from __future__ import annotations

import heapq
import inspect
from collections.abc import Awaitable, Callable, Iterable, Mapping
from functools import partial
from typing import Any

from planlang.kernel import All, Task
from planlang.language.branches import check

Step = Callable[..., Awaitable[Any]]


class _PartialOrder(All):
    def __init__(
        self,
        steps: Mapping[str, Step],
        after: dict[str, list[str]],
        missing: dict[str, int],
        inputs: dict[str, list[str]],
        limit: int | None,
        name: str | None,
    ) -> None:
        super().__init__("partial_order", name)
        self.steps = steps
        self.names = list(steps)
        self.rank = {step: index for index, step in enumerate(self.names)}
        self.after = after
        self.missing = missing
        self.inputs = inputs
        self.limit = limit
        self.ready = [self.rank[step] for step in self.names if not missing[step]]
        self.results: dict[str, Any] = {}

    def begin(self) -> None:
        self._launch()

    def _launch(self) -> None:
        """Start what is ready, the textually first first, as far as there are free slots."""
        while self.ready and (self.limit is None or len(self.live) < self.limit):
            index = heapq.heappop(self.ready)
            name = self.names[index]
            step = self.steps[name]
            inputs = self.inputs.get(name)
            if inputs:
                step = partial(step, **{key: self.results[key] for key in inputs})
            self.start(step, name, index)

    def decide(self, dead: list[Task]) -> None:
        super().decide(dead)
        if self.over:
            return
        for task in dead:
            name = self.names[task.index]
            self.results[name] = task.result
            for later in self.after[name]:
                self.missing[later] -= 1
                if not self.missing[later]:
                    heapq.heappush(self.ready, self.rank[later])
        self._launch()

    def finish(self) -> dict[str, Any]:
        self.raise_failure()
        return {name: self.results[name] for name in self.names}


async def partial_order(
    steps: Mapping[str, Step],
    orderings: Iterable[tuple[str, str]],
    limit: int | None = None,
    *,
    name: str | None = None,
) -> dict[str, Any]:
    """Run steps, each as soon as all steps ordered before it have succeeded; returns step name -> result.

    ``orderings`` are pairs (before, after). A step with a parameter named like a step before it gets that step's
    result. At most ``limit`` run at a time; of those that are ready the textually first starts. Fails as ``par``.
    Raises ValueError for a cycle, an unknown name or a parameter that nothing fills, before anything starts.
    """
    check("partial_order", steps.values())
    if limit is not None and limit < 1:
        raise ValueError(f"limit is a number of steps, at least 1, not {limit!r}")
    before: dict[str, dict[str, None]] = {step: {} for step in steps}
    after: dict[str, list[str]] = {step: [] for step in steps}
    for first, second in orderings:
        for step in (first, second):
            if step not in before:
                raise ValueError(f"ordering ({first}, {second}): no step {step!r}; steps: {', '.join(steps)}")
        if first not in before[second]:
            before[second][first] = None
            after[first].append(second)
    missing = {step: len(earlier) for step, earlier in before.items()}
    _refuse_cycle(before, after, missing)
    inputs = {step: found for step, branch in steps.items() if (found := _inputs(step, branch, before))}
    scope = _PartialOrder(steps, after, missing, inputs, limit, name)
    result: dict[str, Any] = await scope.execute()
    return result


def _refuse_cycle(
    before: Mapping[str, Mapping[str, None]], after: Mapping[str, list[str]], missing: Mapping[str, int]
) -> None:
    left = dict(missing)
    free = [step for step, number in left.items() if not number]
    while free:
        step = free.pop()
        del left[step]
        for later in after[step]:
            left[later] -= 1
            if not left[later]:
                free.append(later)
    if not left:
        return
    # every step that is left has a predecessor that is left: walking backwards must come back
    step = next(iter(left))
    walked: dict[str, None] = {}
    while step not in walked:
        walked[step] = None
        step = next(earlier for earlier in before[step] if earlier in left)
    path = list(walked)
    cycle = [step, *reversed(path[path.index(step) :])]
    raise ValueError(f"cycle in orderings: {' < '.join(cycle)}")


def _inputs(step: str, branch: Step, before: Mapping[str, Mapping[str, None]]) -> list[str]:
    """Parameters of a step that are filled with results of steps before it."""
    code = getattr(branch, "__code__", None)
    if code is not None and not code.co_argcount and not code.co_kwonlyargcount:
        return []
    try:
        parameters = inspect.signature(branch).parameters.values()
    except (TypeError, ValueError):
        return []
    wanted = [p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    if not wanted:
        return []
    earlier = _all_before(step, before)
    for parameter in wanted:
        if parameter.default is parameter.empty and parameter.name not in earlier:
            raise ValueError(
                f"step {step!r} has a parameter {parameter.name!r}, and no step of that name is ordered before it"
            )
    return [parameter.name for parameter in wanted if parameter.name in earlier]


def _all_before(step: str, before: Mapping[str, Mapping[str, None]]) -> set[str]:
    found: set[str] = set()
    stack = list(before[step])
    while stack:
        one = stack.pop()
        if one not in found:
            found.add(one)
            stack.extend(before[one])
    return found
