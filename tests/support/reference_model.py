"""A small reference model of the plan language: what a tree of constructs does, computed without tasks or coroutines.

A :class:`Strand` stands for a task. It goes through one tree, whose nodes say with ``run()`` what they have come to:
an outcome, or None when they wait. Time passes only when nothing can happen any more (:meth:`World.advance`). What is
computed: who is held, evaporating or dead at each moment, and with what outcome each tree ends.

The model knows a decision only as "all below has come to rest": it is for trees whose branches share nothing, where
the order of tasks within a round makes no difference.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any

Outcome = tuple[str, Any]
"""A kind, "value", "failure", "error" or "evaporated", and the value, or a word for the failure."""

EVAPORATED: Outcome = ("evaporated", None)
ERROR: Outcome = ("error", None)
STATES = {"value": "succeeded", "failure": "failed", "error": "failed", "evaporated": "evaporated"}


@dataclass(frozen=True)
class Tree:
    """A plan without code. ``number`` is a duration, a fluent, a tag, a limit or a number of times, by kind."""

    kind: str
    children: tuple[Tree, ...] = ()
    number: int = 0
    end: str = "value"
    name: str = ""
    orderings: tuple[tuple[int, int], ...] = ()

    def walk(self) -> Iterator[Tree]:
        """This tree and all below it."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(eq=False)
class Strand:
    """A task."""

    world: World
    parent: Strand | None
    tree: Tree
    budgets: tuple[Budget, ...] = ()
    node: Node | None = None
    count: int = 0
    shields: int = 0
    cancelled: bool = False
    overrun: Shielded | None = None
    """The shield whose time is over, until that is raised or the shield has ended."""
    thrown: bool = False
    scope: Scope | None = None
    outcome: Outcome | None = None

    @property
    def depth(self) -> int:
        return 0 if self.parent is None else self.parent.depth + 1

    @property
    def held(self) -> bool:
        """Suspended, itself or above; what is being evaporated is never held."""
        strand: Strand | None = self
        while strand is not None and not strand.cancelled:
            if strand.count:
                return True
            strand = strand.parent
        return False

    @property
    def doomed(self) -> bool:
        """Return whether the next checkpoint raises."""
        return self.overrun is not None or (self.cancelled and not self.shields)

    @property
    def state(self) -> str:
        if self.parent is None and self is not self.world.root:
            return "created"  # known by its handle only
        if self.outcome is not None:
            return "evaporated" if self.thrown else STATES[self.outcome[0]]  # its error is raised all the same
        if self.cancelled:
            return "evaporating"
        return "suspended" if self.held else "created" if self.node is None else "running"

    def delivered(self) -> Outcome:
        """Return what a checkpoint of a doomed task raises."""
        if self.overrun is not None:
            self.overrun = None
            return ERROR
        self.thrown = True
        return EVAPORATED

    def run(self) -> None:
        """Go on until waiting or dead; what is held waits, but not what is being evaporated below it."""
        if self.outcome is not None or (self.held and self.node is None):
            return
        if self.node is None:
            self.node = make(self.tree, self, self.budgets)
        outcome = self.node.run()
        if outcome is not None:
            self.outcome = EVAPORATED if self.thrown and outcome[0] != "error" else outcome

    def subtree(self, *, cancelled: bool = False) -> Iterator[Strand]:
        """Yield what lives below, children first, and this; without what is being evaporated, unless asked for."""
        if self.scope is not None:
            for child in self.scope.live:
                if (cancelled or not child.cancelled) and child.outcome is None:
                    yield from child.subtree(cancelled=cancelled)
        yield self

    def suspend(self) -> bool:
        if self.outcome is not None or self.cancelled:
            return False
        held = [strand for strand in self.subtree() if not strand.held]
        self.count += 1
        for strand in held:
            if isinstance(strand.scope, Restarting) and strand.held:
                strand.scope.interrupt()
        return True

    def wake_up(self) -> bool:
        if self.outcome is not None or self.cancelled or not self.count:
            return False
        self.count -= 1
        return True

    def evaporate(self) -> bool:
        if self.outcome is not None or self.cancelled:
            return False
        for strand in [*self.subtree(cancelled=True)] if self.shields else [self]:
            strand.count = 0
        self.cancelled = self.world.stirred = True
        if self.node is None:
            self.outcome = EVAPORATED
        elif not self.shields and self.scope is not None:
            self.scope.over = True
            for child in self.scope.live:
                child.evaporate()
        return True


@dataclass(eq=False)
class World:
    """A tree at work, the fluents it looks at, and the handles of its tagged parts."""

    tree: Tree
    fluents: list[bool]
    now: int = 0
    tags: dict[int, Strand] = field(default_factory=dict)
    nodes: list[Timed | Waiting] = field(default_factory=list)
    stirred: bool = False
    """Something was evaporated that has not run since."""

    def __post_init__(self) -> None:
        self.root = Strand(self, None, self.tree)
        for part in self.tree.walk():
            if part.kind == "tag":
                self.tags[part.number] = Strand(self, None, part.children[0])
        self.rest()

    def rest(self) -> None:
        """Let all happen that happens in this step; deadlines come last, the most deeply nested first."""
        while True:
            self.stirred = False
            self.root.run()
            if self.stirred:  # what a budget has evaporated may stand before the one that used it up
                continue
            due = [node for node in self.timers() if isinstance(node, Deadline) and not node.left]
            if not due:
                return
            deepest = max(node.depth for node in due)
            for node in due:
                if node.depth == deepest and node.strand.outcome is None:
                    node.fire()

    def timers(self) -> list[Timed]:
        """Return what runs out with time, as things are."""
        self.nodes = [node for node in self.nodes if node.live]
        return [node for node in self.nodes if isinstance(node, Timed) and not node.strand.held]

    def advance(self, moment: int) -> None:
        """Let time pass up to a moment; nothing must be due then."""
        while self.root.outcome is None:
            steps = min([node.left for node in self.timers()], default=moment)
            if self.now + steps > moment:
                break
            self.pass_time(steps)
            self.rest()
        else:
            return
        self.pass_time(moment - self.now)

    def pass_time(self, steps: int) -> None:
        self.now += steps
        for node in self.timers():
            node.left -= steps

    def set(self, fluent: int, value: bool) -> None:
        """A fluent changes; who waits for it and is not held has seen it."""
        self.fluents[fluent] = value
        for node in self.nodes:
            if isinstance(node, Waiting) and node.fluent == fluent and node.live and not node.strand.held:
                node.seen = node.seen or value


class Node:
    """A tree at work in a strand."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        self.tree = tree
        self.strand = strand
        self.budgets = budgets
        self.place = 0

    def run(self) -> Outcome | None:
        raise NotImplementedError

    def below(self, number: int = 0) -> Node:
        """A child at work in the same strand."""
        return make(self.tree.children[number], self.strand, self.budgets)


class Timed(Node):
    """Something that takes time of its strand."""

    live = True

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...], steps: int) -> None:
        super().__init__(tree, strand, budgets)
        self.left = steps
        strand.world.nodes.append(self)


class Work(Timed):
    """Some steps, then an outcome."""

    def run(self) -> Outcome | None:
        strand = self.strand
        if strand.held or not (strand.doomed or not self.left):
            return None
        self.live = False
        if strand.doomed:
            return strand.delivered()
        return (self.tree.end, None if self.tree.end == "error" else self.tree.name)


class Waiting(Node):
    """The first true value of a fluent that is set while waiting counts."""

    live = True

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets)
        self.fluent = tree.number
        self.seen = False
        strand.world.nodes.append(self)

    def run(self) -> Outcome | None:
        strand = self.strand
        if strand.held:
            return None
        if strand.doomed:
            self.live = False
            return strand.delivered()
        self.seen = self.seen or strand.world.fluents[self.fluent]
        if not self.seen:
            return None
        self.live = False
        return ("value", True)


class Deadline(Timed):
    """Strikes when a step is at rest."""

    @property
    def depth(self) -> int:
        return self.strand.depth

    def fire(self) -> None:
        raise NotImplementedError


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
                return (self.goes_on, self.results)
            self.child = self.below(len(self.results))


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


class Step(Retry):
    """A step with a goal and recoveries, in one call."""

    def below(self, number: int = 0) -> Node:
        return Achieving(self.tree, self.strand, self.budgets)


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
            self.cleanup = Work(steps, self.strand, (), self.tree.number)
        ended = self.cleanup.run()
        if ended is None:
            return None
        self.strand.shields -= 1
        return self.outcome if ended[0] == "value" else ended


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


class Scope(Node):
    """A construct with strands of its own. It decides when all below is at rest and something has died."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets)
        self.live: dict[Strand, int] = {}
        self.begun = False
        self.over = False
        self.crash = False
        self.outcome: Outcome | None = None

    def start(self, number: int) -> Strand:
        child = Strand(self.strand.world, self.strand, self.tree.children[number], self.budgets)
        self.live[child] = number
        return child

    def begin(self) -> None:
        for number in range(len(self.tree.children)):
            self.start(number)

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        """Fix ``outcome``, if what died, in textual order, settles it."""
        raise NotImplementedError

    def close(self, outcome: Outcome | None = None) -> None:
        """Fix the outcome and evaporate what is live."""
        if not self.over:
            self.over = True
            self.outcome = outcome
            for child in self.live:
                child.evaporate()

    def run(self) -> Outcome | None:
        strand = self.strand
        if not self.begun:
            if strand.doomed:
                return strand.delivered()
            self.begun = True
            strand.scope = self
            self.begin()
        while True:
            for child in tuple(self.live):
                child.run()
            dead = [(number, child.outcome) for child, number in self.live.items() if child.outcome is not None]
            if isinstance(self, Budget) and self.used_up and not self.over:
                self.close(("failure", "budget"))
                continue
            if not dead:
                break
            dead.sort(key=itemgetter(0))
            self.live = {child: number for child, number in self.live.items() if child.outcome is None}
            self.crash = self.crash or any(outcome == ERROR for _, outcome in dead)
            if self.crash:
                self.close()
            elif not self.over:
                self.decide(dead)
        if self.live or strand.held:
            return None
        self.over = True
        strand.scope = None
        if self.crash:
            return ERROR
        return strand.delivered() if strand.doomed else self.outcome


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
        return ("value", [self.results[number] for number in range(len(self.tree.children))])


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


class First(Scope):
    """pursue and race: the first that ends counts, failures before successes of the same decision."""

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        for kind in ("failure", "value"):
            for _, outcome in dead:
                if outcome[0] == kind:
                    return self.close(outcome)


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


class Single(Scope):
    """A construct with one branch, whose outcome is its own."""

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        [(_, outcome)] = dead
        self.close(("failure", "gone") if outcome == EVAPORATED else outcome)


class Tag(Single):
    """A part with a handle, which may have been asked for before."""

    def begin(self) -> None:
        known = self.strand.world.tags[self.tree.number]
        if known.parent is None:
            known.parent, known.budgets = self.strand, self.budgets
            self.live[known] = 0
        else:
            self.strand.world.tags[self.tree.number] = self.start(0)


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


class Budget(Single):
    """budget with attempts: every retry inside takes one."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, (*budgets, self))
        self.left = tree.number
        self.used_up = False


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


KINDS: dict[str, type[Node]] = {
    "fluent": Waiting,
    "seq": InOrder,
    "try_in_order": InOrder,
    "retry": Retry,
    "step": Step,
    "protected": Protected,
    "shield": Shielded,
    "par": All,
    "par_each": ParEach,
    "partial_order": PartialOrder,
    "pursue": First,
    "race": First,
    "try_all": FirstSuccess,
    "tag": Tag,
    "retry_after_suspension": Restarting,
    "timeout": Limited,
    "budget_of_time": Limited,
    "budget": Budget,
    "policies": Policies,
}


def make(tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> Node:
    """A tree, begun."""
    if tree.kind == "work":
        return Work(tree, strand, budgets, tree.number)
    return KINDS[tree.kind](tree, strand, budgets)
