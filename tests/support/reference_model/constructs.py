"""Constructs of the plan language in the reference model."""

from __future__ import annotations

from typing import Any

from reference_model.tasks import (
    EVAPORATED,
    Budget,
    Deadline,
    Node,
    Outcome,
    Scope,
    Single,
    Strand,
    Tree,
    Work,
    kind,
)


@kind("seq", "try_in_order")
class InOrder(Node):
    """seq and try_in_order: one child after another, in one strand."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets)
        self.goes_on = "value" if tree.kind == "seq" else "failure"
        self.results: list[Any] = []
        self.child = self.below()

    def run(self) -> Outcome | None:
        while True:
            outcome = self.child.run()
            stopped = self.goes_on == "failure" and self.strand.doomed  # no alternative in what is being evaporated
            if outcome is None or outcome[0] != self.goes_on or stopped:
                return outcome
            self.results.append(outcome[1])
            if len(self.results) == len(self.tree.children):
                return (self.goes_on, tuple(self.results) if self.goes_on == "value" else self.results)
            self.child = self.below(len(self.results))


@kind("retry")
class Retry(Node):
    """Failure handling that repeats the body, as often as its own allowance and all budgets around permit."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets)
        self.left = tree.number
        self.child = self.below()
        self.asking = False
        self.undecided: list[Budget] = []
        self.passed: list[Budget] = []

    def run(self) -> Outcome | None:
        while True:
            if self.asking:
                if not self.granted():
                    return self.strand.delivered() if self.strand.doomed else None
                self.child = self.below()
            outcome = self.child.run()
            if outcome is None or outcome[0] != "failure" or not self.left or self.strand.doomed:
                return outcome
            self.left -= 1
            self.asking = True

    def granted(self) -> bool:
        """Return whether no budget stops the next run any more; a used up one does until it has ended, for shields."""
        while True:
            if self.undecided:
                if self.strand.doomed or not all(budget.over for budget in self.undecided):
                    return False
                self.undecided = []
            empty = [budget for budget in reversed(self.budgets) if not budget.left and budget not in self.passed]
            if not empty:
                break
            if self.strand.doomed:
                return False
            self.passed += empty
            self.undecided = [budget for budget in empty if not budget.over]
            for budget in self.undecided:
                budget.used_up = True
        self.asking, self.passed = False, []
        for budget in self.budgets:
            budget.left = max(0, budget.left - 1)
        return True


class Achieving(Node):
    """A child unless a fluent is true, which it has to be after it; a skipped one is a checkpoint."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets)
        self.child = None if self.holds() else self.below()

    def holds(self) -> bool:
        return self.strand.world.fluents[self.tree.children[1].number]

    def run(self) -> Outcome | None:
        if self.child is None:
            if self.strand.held:
                return None
            return self.strand.delivered() if self.strand.doomed else ("value", None)
        outcome = self.child.run()
        return outcome if outcome is None or outcome[0] != "value" or self.holds() else ("failure", "goal")


@kind("step")
class Step(Retry):
    """A step with a goal and recoveries, in one call."""

    def below(self, number: int = 0) -> Node:
        return Achieving(self.tree, self.strand, self.budgets)


@kind("protected")
class Protected(Node):
    """A body, then a shielded cleanup of some steps in any case."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets)
        self.body = self.below()
        self.outcome: Outcome | None = None
        self.cleanup: Work | None = None

    def run(self) -> Outcome | None:
        if self.cleanup is None:
            self.outcome = self.body.run()
            if self.outcome is None:
                return None
            self.strand.shields += 1
            steps = Tree("work", (), self.tree.number, self.tree.end, self.tree.name)
            self.cleanup = Work(steps, self.strand, ())
        ended = self.cleanup.run()
        if ended is None:
            return None
        self.strand.shields -= 1
        return self.outcome if ended[0] == "value" else ended


@kind("shield")
class Shielded(Deadline):
    """A part that evaporation from outside does not reach, for so many steps at most."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets, tree.number)
        strand.shields += 1
        self.child = self.below()

    def run(self) -> Outcome | None:
        outcome = self.child.run()
        if outcome is not None:
            self.live = False
            self.strand.shields -= 1
            if self.strand.overrun is self:
                self.strand.overrun = None
        return outcome

    def fire(self) -> None:
        self.live = False
        self.strand.overrun = self
        if self.strand.scope is not None:
            self.strand.scope.close()


@kind("par")
class All(Scope):
    """par and its kin: the first failure counts."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets)
        self.results: dict[int, Any] = {}

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        for _, outcome in dead:
            if outcome[0] != "value":
                self.close(outcome if outcome[0] == "failure" else ("failure", "gone"))
                return
        self.results.update((number, outcome[1]) for number, outcome in dead)
        self.go_on()
        if not self.live:
            self.close(self.whole())

    def go_on(self) -> None:
        """Start what may start now."""

    def whole(self) -> Outcome:
        return ("value", tuple(self.results[number] for number in range(len(self.tree.children))))


@kind("par_each")
class ParEach(All):
    """No more than a number of values at a time."""

    def begin(self) -> None:
        self.begun_values = 0
        self.go_on()

    def go_on(self) -> None:
        limit = self.tree.number or len(self.tree.children)
        while len(self.live) < limit and self.begun_values < len(self.tree.children):
            self.start(self.begun_values)
            self.begun_values += 1

    def whole(self) -> Outcome:
        return ("value", list(super().whole()[1]))


@kind("partial_order")
class PartialOrder(All):
    """A step starts when those ordered before it have succeeded, and the limit allows it."""

    def begin(self) -> None:
        self.waiting = list(range(len(self.tree.children)))
        self.go_on()

    def go_on(self) -> None:
        limit = self.tree.number or len(self.tree.children)
        for step in tuple(self.waiting):
            before = [first for first, second in self.tree.orderings if second == step]
            if len(self.live) < limit and all(first in self.results for first in before):
                self.waiting.remove(step)
                self.start(step)

    def whole(self) -> Outcome:
        return ("value", {str(number): result for number, result in self.results.items()})


@kind("pursue", "race")
class First(Scope):
    """pursue and race: the first that ends counts, failures before successes of the same decision."""

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        for first in ("failure", "value"):
            for _, outcome in dead:
                if outcome[0] == first:
                    return self.close(outcome)


@kind("try_all")
class FirstSuccess(Scope):
    """try_all: the first success counts."""

    def begin(self) -> None:
        self.failures: dict[int, Any] = {}
        super().begin()

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        for number, outcome in dead:
            if outcome[0] == "value":
                return self.close(outcome)
            self.failures[number] = outcome[1]
        if not self.live:
            self.close(("failure", [self.failures[number] for number in sorted(self.failures)]))


@kind("tag")
class Tag(Single):
    """A part with a handle, which may have been asked for before."""

    def begin(self) -> None:
        known = self.strand.world.tags[self.tree.number]
        if known.parent is None:
            known.parent, known.budgets = self.strand, self.budgets
            self.live[known] = 0
        else:
            self.strand.world.tags[self.tree.number] = self.start(0)


@kind("retry_after_suspension")
class Restarting(Single):
    """retry_after_suspension: evaporated when held, and begun anew."""

    interrupted = False

    def interrupt(self) -> None:
        for child in self.live:
            self.interrupted = child.evaporate() or self.interrupted

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        if self.interrupted and dead[0][1] == EVAPORATED:
            self.interrupted = False
            self.start(0)
        else:
            super().decide(dead)


@kind("timeout", "budget_of_time")
class Limited(Single):
    """timeout, and budget with seconds."""

    def begin(self) -> None:
        super().begin()
        self.timer = _Expiry(self)

    def run(self) -> Outcome | None:
        outcome = super().run()
        if outcome is not None and self.begun:
            self.timer.live = False
        return outcome

    def expire(self) -> None:
        self.close(("failure", self.tree.kind))


class _Expiry(Deadline):
    def __init__(self, scope: Limited) -> None:
        super().__init__(scope.tree, scope.strand, (), scope.tree.number)
        self.scope = scope

    def fire(self) -> None:
        self.live = False
        self.scope.expire()


@kind("policies")
class Policies(Scope):
    """A body and, beside it, a watch over each of the fluents (the children after the first)."""

    def begin(self) -> None:
        watched = self.tree.children[1:]
        violated = [watch.number for watch in watched if self.strand.world.fluents[watch.number]]
        if violated:
            self.close(("failure", f"policy {violated[0]}"))
            return
        for number in range(1, len(self.tree.children)):
            self.start(number)
        self.start(0)

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        violated = [number for number, _ in dead if number]
        if violated:
            self.close(("failure", f"policy {self.tree.children[violated[0]].number}"))
        else:
            self.close(dead[0][1])
