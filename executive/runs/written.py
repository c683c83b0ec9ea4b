"""What follows a run: listeners and watchers, the files that they write beside its trace, and its progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any

from executive.robots.arms import called
from executive.runs.identity import Identities
from executive.runs.options import Tilts
from executive.runs.parameters import Bound, things_of
from executive.runs.prepared import RunFiles
from executive.runs.traces import action_line, lines_of
from planlang.failures import PlanFailure
from planlang.kernel.tree import Node
from planlang.language.performing import is_inner
from planlang.runs.trace import Listener
from sim import PyBulletWorld
from sim.truth import Truth

if TYPE_CHECKING:
    from executive.modules.platform import Platform


MOST_DONE = 5
"""Number of actions that are named as done when a run is interrupted."""


class Written:
    """What follows a run that writes no more than its trace; ``listeners`` get its records, ``watchers`` see the world.

    :class:`executive.runs.outputs.Outputs` writes files, too.
    """

    def __init__(self, files: RunFiles, tilts: Tilts, truth: PyBulletWorld) -> None:
        """Report progress and measure tilts."""
        self._options, self._truth = files.options, truth
        self._is_new = False
        """False while a repeated run catches up with its trace."""
        self._actions: dict[int, str] = {}
        """The actions that are being performed, by node."""
        self._done: list[Node] = []
        """Performed actions, without those inside the last one."""
        self.interrupted = "interrupted"
        """What is said of a run that was interrupted: where, and what had been done."""
        self._at_work = ExitStack()
        """Shows on what the run works if no line is printed for long."""
        self._at_work.enter_context(self._options.waiting(self._doing))
        self.watchers: list[Callable[[Truth], None]] = [tilts, *self._options.watchers]
        self.listeners: list[Listener] = [
            self._note,
            lines_of(self._progress, inner=self._options.inner_actions),
            *self._options.listeners,
        ]

    def _progress(self, step: int, line: str) -> None:
        if self._is_new:
            self._options.progress(f"{step / self._truth.rate:7.2f} s  {line}")
            # the time that is shown is that since the last line
            self._at_work.close()
            self._at_work.enter_context(self._options.waiting(self._doing))

    def _note(self, record: Mapping[str, Any], node: Node | None) -> None:
        match record:
            case {"event": "started", "kind": "perform", "node": number, "action": action}:
                self._actions[number] = action_line(str(action))
            case {"event": "ended", "kind": "perform", "node": number, "status": status}:
                self._actions.pop(number, None)
                if status == "succeeded" and node is not None and not is_inner(node):
                    while self._done and node in _around(self._done[-1]):
                        self._done.pop()
                    self._done.append(node)
            case {"event": "interrupted", "step": step}:
                self.interrupted = self._where(step / self._truth.rate)

    def _where(self, time: float) -> str:
        """Say at which action the run was interrupted, at a plan time [s], and the last actions that were done."""
        action = next(reversed([*self._actions.values()]), "no action")
        names = [one.name.partition("#")[0] for one in self._done[-MOST_DONE:]]
        more = ["..."] if len(self._done) > MOST_DONE else []
        done = f"done: {', '.join([*more, *names])}" if names else "nothing done"
        return f"interrupted at {action}, {time:.1f} s; {done}"

    def _doing(self) -> str:
        """Name the action that began last; the thread that shows it calls this at any time."""
        action = next(reversed([*self._actions.values()]), None)
        return "the run is at work" if action is None else f"still at {action}"

    def begin(self) -> None:
        """Start writing: the run has caught up with the trace that it repeats."""
        self._is_new = True

    def save(self, outcome: str, message: str, failure: PlanFailure | None, seconds: float) -> None:
        """End the display of work, and write the files after the run, each atomically; poses are written already.

        ``outcome``, ``message`` and ``seconds`` of plan time are those of the result, ``failure`` is that of the plan,
        if it failed.
        """
        self._at_work.close()


class WatchedWorld:
    """World whose watchers are called before the first step and after each one."""

    def __init__(self, world: PyBulletWorld, watchers: Sequence[Callable[[Truth], None]]) -> None:
        self.world, self.watchers, self.rate = world, watchers, world.rate
        self._show()

    def step(self) -> None:
        self.world.step()
        self._show()

    def _show(self) -> None:
        for watcher in self.watchers:
            watcher(self.world)


def _around(node: Node) -> Iterator[Node]:
    """Yield the nodes around a node, from inside out."""
    while node.parent is not None:
        node = node.parent
        yield node


def bodies_of(bound: Mapping[str, Bound], platform: Platform, truth: PyBulletWorld) -> Iterator[str]:
    """Yield the true bodies of the plan's parameters, all that one by class has meant, and what is in a hand."""
    belief, identities = platform.belief, Identities(truth, platform.scene)
    for what in (one for value in bound.values() for one in things_of(value)):
        names = [one.name for one in belief.memory.meanings.get(what, ())]
        with suppress(PlanFailure):
            names = names or [belief.bind(what, truth.configuration().base)]
        yield from (name for name in map(identities.of, names) if name in truth.names())
    yield from truth.attached()


def still_held(platform: Platform, truth: PyBulletWorld) -> dict[str, str]:
    """Say for each thing that the robot holds where a plan has failed in which of several hands it still is."""
    arms, identities = platform.robot.arms, Identities(truth, platform.scene)
    sides = {arm.name: f"in the {arm.side} hand" if arm.side else f"by {called(arm.name)}" for arm in arms}
    held = platform.belief.held.items() if len(arms) > 1 else ()
    return {identities.of(name): sides[grip.arm] if len(grip.arms) == 1 else "in both hands" for name, grip in held}
