"""Strands of the reference model, the world in which they run, and the constructs that have strands of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any, TypeVar

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
    overrun: Deadline | None = None
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
            if strand.scope is not None and strand.held:
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


N = TypeVar("N", bound=Node)
_kinds: dict[str, type[Node]] = {}


def kind(*names: str) -> Callable[[type[N]], type[N]]:
    """Register a class as what trees of these kinds become at work."""

    def register(cls: type[N]) -> type[N]:
        _kinds.update(dict.fromkeys(names, cls))
        return cls

    return register


def make(tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> Node:
    """Begin a tree."""
    return _kinds[tree.kind](tree, strand, budgets)


class Timed(Node):
    """Something that takes time of its strand."""

    live = True

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...], steps: int) -> None:
        super().__init__(tree, strand, budgets)
        self.left = steps
        strand.world.nodes.append(self)


@kind("work")
class Work(Timed):
    """Some steps, then an outcome."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, budgets, tree.number)

    def run(self) -> Outcome | None:
        strand = self.strand
        if strand.held or not (strand.doomed or not self.left):
            return None
        self.live = False
        if strand.doomed:
            return strand.delivered()
        return (self.tree.end, None if self.tree.end == "error" else self.tree.name)


@kind("fluent")
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


class Scope(Node):
    """A construct with strands of its own. It decides when all below is at rest and something has died."""

    used_up = False
    """An allowance is at its end, so that the construct fails."""

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

    def interrupt(self) -> None:
        """Take notice of being held."""

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
            if self.used_up and not self.over:
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


class Single(Scope):
    """A construct with one branch, whose outcome is its own."""

    def decide(self, dead: list[tuple[int, Outcome]]) -> None:
        [(_, outcome)] = dead
        self.close(("failure", "gone") if outcome == EVAPORATED else outcome)


@kind("budget")
class Budget(Single):
    """budget with attempts: every retry inside takes one."""

    def __init__(self, tree: Tree, strand: Strand, budgets: tuple[Budget, ...]) -> None:
        super().__init__(tree, strand, (*budgets, self))
        self.left = tree.number
