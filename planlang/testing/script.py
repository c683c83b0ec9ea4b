"""Scripts: what process modules do in a test, so that plans run without a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from planlang.designators import Action, Object
from planlang.testing.belief import Base, Belief
from planlang.testing.faults import Fault, Raises

Does = Callable[[Belief, Action], Any]
"""A side effect; may be async, and what it returns other than None is the action's result."""


@dataclass(frozen=True)
class Rule:
    """What performing a step or class of actions does, as long as the rule applies."""

    step: str
    fails: Raises | None = None
    returns: Any = None
    does: Does | None = None
    after: float | None = None
    times: int | None = None
    since: float = 0.0
    until: float = math.inf

    def __str__(self) -> str:
        what = "" if self.fails is None else f" fails with {getattr(self.fails, '__name__', repr(self.fails))}"
        times = "" if self.times is None else f", {self.times} times"
        span = "" if (self.since, self.until) == (0.0, math.inf) else f", from {self.since:g} s until {self.until:g} s"
        return f"{self.step}{what}{times}{span}"


@dataclass
class Script:
    """What the robot of a test does.

    Without a rule an action succeeds after :attr:`takes` seconds and has the effect of its class on the belief: the
    base arrives, a gripper that closes around something holds it, one that opens lets it go, what is handed over is
    at its recipient. A script is a description: each run begins with its belief as it was described here.
    """

    takes: float = 1.0
    """How long an action takes without a rule that says so [s]."""
    ancestors: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Superclasses of classes of actions, nearest first; without, a class stands for itself."""
    classes: list[str] = field(default_factory=list)
    """Classes of actions that can be performed besides those of every robot."""
    rules: list[Rule] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    _beginning: list[Callable[[Belief], object]] = field(default_factory=list)

    def on(
        self,
        step: str,
        *,
        fails: Raises | None = None,
        returns: Any = None,
        does: Does | None = None,
        after: float | None = None,
        times: int | None = None,
        since: float = 0.0,
        until: float = math.inf,
    ) -> Script:
        """Say what performing does: ``script.on("Reaching", fails=ManipulationPoseUnreachable, times=2, after=1.5)``.

        ``step`` is the name of the step in the plan or the class of the action. ``after`` seconds it fails with
        ``fails`` (a class, a function that makes the failure, or an example), or succeeds with ``returns``.
        ``does(belief, action)`` is called just before that. A rule applies ``times`` times, to what begins at plan
        time ``since`` up to ``until`` [s]. Of several rules the first that applies counts. A class of actions that a
        rule names can be performed; see :meth:`performs`.
        """
        if after is not None and not after >= 0:
            raise ValueError(f"after is a number of seconds, at least 0, not {after!r}")
        if times is not None and times < 1:
            raise ValueError(f"times is a number of times, at least 1, not {times!r}")
        self.rules.append(Rule(step, fails, returns, does, after, times, since, until))
        return self

    def performs(self, *classes: str) -> Script:
        """Give the robot process modules for more classes of actions; each has its own."""
        self.classes.extend(classes)
        return self

    def fault(
        self, step: str, raises: Raises, *, attempt: int | None = 1, after: float | None = None, at: float | None = None
    ) -> Script:
        """Let any step of the plan fail, performed or not; see :class:`planlang.testing.Fault`."""
        self.faults.append(Fault(step, raises, None if at is not None else attempt, after, at))
        return self

    def holding(self, *things: str | Object) -> Script:
        """What the robot holds at the beginning."""
        names = [thing if isinstance(thing, str) else thing.name for thing in things]
        self._beginning.append(lambda belief: belief.holding.extend(names))
        return self

    def at(self, **places: Any) -> Script:
        """Where things are at the beginning."""
        self._beginning.append(lambda belief: belief.at.update(places))
        return self

    def fact(self, condition: str, holds: bool = True) -> Script:
        """What else is true at the beginning, by its text: ``script.fact("open(fridge1)")``."""
        self._beginning.append(lambda belief: belief.facts.update({condition: holds}))
        return self

    def places(self, location: str | Object, *bases: Base) -> Script:
        """Where the base can stand for a location, told by its name or the thing that it is about; none is nowhere."""
        name = location if isinstance(location, str) else location.name
        self._beginning.append(lambda belief: belief.places.update({name: bases}))
        return self

    def belief(self) -> Belief:
        """The belief at the beginning, made anew."""
        belief = Belief()
        for change in self._beginning:
            change(belief)
        return belief
