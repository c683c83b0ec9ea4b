"""partial_order: runs steps concurrently except where orderings relate them."""

from __future__ import annotations

import heapq
import inspect
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence, Set
from functools import partial
from itertools import pairwise
from types import FunctionType
from typing import Any, TypeVar, overload

from planlang.designators import Location, Object, snake_case
from planlang.kernel import All, Task
from planlang.misuse import Usage, WrongType, WrongValue, contrast

T = TypeVar("T")

_PARTIAL_ORDER = Usage(
    "await partial_order",
    {"steps": '{"look": look, "grasp": grasp}', "orderings": '[("look", "grasp")]'},
    {"limit": "2", "name": '"fetch"'},
)
Step = Callable[..., Awaitable[Any]]


class _PartialOrder(All):
    def __init__(
        self,
        steps: Mapping[str, Step],
        after: list[list[int]],
        missing: list[int],
        inputs: dict[int, list[tuple[str, int]]],
        limit: int | None,
        name: str | None,
    ) -> None:
        super().__init__("partial_order", name)
        self.steps = list(steps.items())
        self.after = after
        self.missing = missing
        self.inputs = inputs
        self.limit = limit
        self.ready = [number for number, left in enumerate(missing) if not left]
        self.results: list[Any] = [None] * len(missing)

    def begin(self) -> None:
        self._launch()

    def _launch(self) -> None:
        """Start ready steps in textual order, up to the limit."""
        ready, limit, live, inputs, pop = self.ready, self.limit, self.live, self.inputs, heapq.heappop
        while ready and (limit is None or len(live) < limit):
            number = pop(ready)
            name, step = self.steps[number]
            if number in inputs:
                step = partial(step, **{key: self.results[earlier] for key, earlier in inputs[number]})
            self.start(step, name, number)

    def decide(self, dead: list[Task]) -> None:
        super().decide(dead)
        if self.over:
            return
        missing, ready, results = self.missing, self.ready, self.results
        for task in dead:
            number = task.index
            results[number] = task.result
            for later in self.after[number]:
                left = missing[later] = missing[later] - 1
                if not left:
                    heapq.heappush(ready, later)
        self._launch()

    def finish(self) -> dict[str, Any]:
        self.raise_failure()
        return {name: result for (name, _), result in zip(self.steps, self.results, strict=True)}


@overload
async def partial_order(
    steps: Mapping[str, Callable[..., Awaitable[T]]],
    orderings: Iterable[tuple[str, str]],
    limit: int | None = None,
    *,
    name: str | None = None,
) -> dict[str, T]: ...
@overload
async def partial_order(
    steps: Mapping[str, Step],
    orderings: Iterable[tuple[str, str]],
    limit: int | None = None,
    *,
    name: str | None = None,
) -> dict[str, Any]: ...
async def partial_order(
    steps: Mapping[str, Step],
    orderings: Iterable[tuple[str, str]],
    limit: int | None = None,
    *,
    name: str | None = None,
) -> dict[str, Any]:
    """Run each step as soon as all steps ordered before it have succeeded; return step name -> result.

    ``orderings`` are pairs (before, after). A parameter of a step that is named like an earlier step, verbatim or in
    snake case (``step_a`` or ``step_a_`` for ``StepA``), receives that step's result. At most ``limit`` steps run at a
    time; of several ready steps the textually first starts. A failure is handled as in ``par``.
    Raises ValueError for a cycle, an unknown name or a parameter without a value, before any step starts.
    """
    _PARTIAL_ORDER.mapping("steps", steps)
    _PARTIAL_ORDER.iterable("orderings", orderings, "pairs (before, after) of names")
    if limit is not None:
        limit = _PARTIAL_ORDER.whole("limit", limit, 1, "steps")
    if name is not None:
        _PARTIAL_ORDER.text("name", name)
    names = list(steps)
    rank = {step: number for number, step in enumerate(names)}
    after: list[list[int]] = [[] for _ in names]
    missing = [0] * len(names)
    forward = True
    for pair in orderings:
        try:
            first, second = pair
            earlier, later = rank[first], rank[second]
        except (KeyError, TypeError, ValueError):
            raise _wrong_pair(pair, steps) from None
        if pair.__class__ is not tuple and isinstance(pair, (str, Set, Mapping)):
            raise _wrong_pair(pair, steps)
        after[earlier].append(later)
        missing[later] += 1
        if earlier >= later:
            forward = False
    if not forward:  # else there cannot be a cycle
        _refuse_cycle(names, after, missing)
    inputs: dict[int, list[tuple[str, int]]] = {}
    before: list[list[int]] | None = None
    by_parameter: dict[str, int] = {}
    for number, (step, branch) in enumerate(steps.items()):
        code = branch.__code__ if branch.__class__ is FunctionType else None
        if code is None or code.co_argcount or code.co_kwonlyargcount:
            before = before or _predecessors(after)
            by_parameter = by_parameter or _by_parameter(rank)
            if step_inputs := _inputs(number, step, branch, by_parameter, before):
                inputs[number] = step_inputs
    scope = _PartialOrder(steps, after, missing, inputs, limit, name)
    result: dict[str, Any] = await scope.execute()
    return result


def _wrong_pair(pair: object, steps: Mapping[str, Step]) -> WrongType | WrongValue:
    """Error for an ordering that is not a pair of step names."""
    if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
        return _PARTIAL_ORDER.wrong("orderings", [pair], "pairs (before, after) of names")
    unknown = next(name for name in pair if not isinstance(name, str) or name not in steps)
    message = f"ordering ({pair[0]}, {pair[1]}): no step {unknown!r}; steps: {', '.join(steps)}"
    return _PARTIAL_ORDER.refused("orderings", message, [pair])


def _predecessors(after: list[list[int]]) -> list[list[int]]:
    """Invert the lists of successors to lists of predecessors."""
    before: list[list[int]] = [[] for _ in after]
    for step, successors in enumerate(after):
        for successor in successors:
            before[successor].append(step)
    return before


def _refuse_cycle(names: list[str], after: list[list[int]], missing: list[int]) -> None:
    # Topological sort by Kahn's algorithm: remove steps without predecessors until none is left.
    left = list(missing)
    free = [step for step, number in enumerate(left) if not number]
    removed = 0
    while free:
        removed += 1
        for later in after[free.pop()]:
            left[later] -= 1
            if not left[later]:
                free.append(later)
    if removed == len(names):
        return
    # Each remaining step has a remaining predecessor, so walking backwards must come to a step for the second time.
    before = _predecessors(after)
    step = next(step for step, number in enumerate(left) if number)
    walked: dict[int, None] = {}
    while step not in walked:
        walked[step] = None
        step = next(earlier for earlier in before[step] if left[earlier])
    path = list(walked)
    cycle = [names[number] for number in (step, *reversed(path[path.index(step) :]))]
    text = f"cycle in orderings: {' < '.join(cycle)}"
    raise _PARTIAL_ORDER.refused("orderings", text, [*pairwise(cycle)])


def _by_parameter(rank: dict[str, int]) -> dict[str, int]:
    """Map the parameter names that receive a step's result to the number of the step."""
    snake = {snake_case(step): number for step, number in reversed(rank.items())}
    return {**{f"{name}_": number for name, number in snake.items()}, **snake, **rank}


def _inputs(own: int, step: str, branch: Step, rank: dict[str, int], before: list[list[int]]) -> list[tuple[str, int]]:
    """Find the parameters of a step that receive results, with the numbers of the earlier steps."""
    try:
        parameters = inspect.signature(branch).parameters.values()
    except (TypeError, ValueError):
        return []
    bound: Mapping[str, Any] = branch.keywords if isinstance(branch, partial) else {}
    free = [p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and p.name not in bound]
    earlier = _ordered_before(own, {rank[p.name] for p in free if p.name in rank}, before)
    for parameter in free:
        if parameter.default is parameter.empty and rank.get(parameter.name) not in earlier:
            message = f"step {step!r} has a parameter {parameter.name!r}, and no step of that name is ordered before it"
            right = f'[("{parameter.name}", "{step}")]'
            raise WrongValue(
                contrast(message, _PARTIAL_ORDER.shown("orderings", "[]"), _PARTIAL_ORDER.shown("orderings", right))
            )
    return [(parameter.name, rank[parameter.name]) for parameter in free if rank.get(parameter.name) in earlier]


def _ordered_before(step: int, candidates: set[int], before: list[list[int]]) -> set[int]:
    """Select the candidates that are ordered before ``step``; breadth-first, as most are near."""
    visited: set[int] = set()
    missing = set(candidates)
    layer = [step]
    while layer and missing:
        layer = list(dict.fromkeys(earlier for later in layer for earlier in before[later] if earlier not in visited))
        visited.update(layer)
        missing.difference_update(layer)
    return candidates - missing


def given(result: Any, otherwise: T) -> T:
    """Choose the designator for a step: the result of an earlier step if it has a suitable type, else ``otherwise``.

    A suitable result has the type of ``otherwise``: an Object from a module may describe more than the plan knew. For a
    plain name, any Object or Location will do. A step that makes several things may return a mapping from their names
    (``{"EggYolk": yolk, "EggShell": shell}``). Other results, such as a pose or None, are ignored.
    """
    if isinstance(result, Mapping):
        result = result.get(otherwise if isinstance(otherwise, str) else getattr(otherwise, "name", None))
    is_named = isinstance(otherwise, str) and isinstance(result, (Object, Location))
    is_place = isinstance(otherwise, Location) and isinstance(result, Location)
    return result if is_named or is_place or isinstance(result, type(otherwise)) else otherwise
