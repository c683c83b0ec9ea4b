"""Which thing a designator by class means in a performance of a step: another one each time that the step is performed.

Steps that follow each other mean the same thing: what one grasps, the next puts down. A designator is bound anew when a
step is performed again, when a step wants the same as an earlier one, and when what the step wants holds already of the
thing. Then things of which it holds are left out, as far as the declared effects of the action tell. What a recovery
repeats is the same performance again, for which nothing is chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from itertools import takewhile

from executive.belief.memory import Meaning
from executive.belief.purposes import Purpose
from planlang.designators import Object
from planlang.failures import ObjectUnresolvable
from planlang.language.performances import Performance
from planlang.records import dataclass


@dataclass(frozen=True)
class Choice:
    """The choice of a thing of a class for one performance."""

    what: Object
    performance: Performance
    purpose: Purpose | None
    """What its outermost action is for, as far as that is known."""
    serves: bool
    """True if what one of its actions is for lasts."""
    had: Sequence[Meaning]
    """What the designator meant in earlier performances."""
    last: str | None
    """What it means at present."""
    is_done: Callable[[str], bool]
    """Checks whether what the step wants holds already of a thing."""

    @property
    def aim(self) -> str:
        """What tells steps that want different things from those that want the same of different things."""
        return self.purpose.text if self.lasts and self.purpose is not None else self.performance.step

    @property
    def lasts(self) -> bool:
        """True if the step is known to bring about something that lasts."""
        return self.purpose is not None and not self.purpose.passes

    def is_same(self) -> bool:
        """Check whether this performance is about the thing that the steps before it were about."""
        if self.last is None or self.last in self._had_in_group():
            return False
        with_it = takewhile(lambda one: one.name == self.last, reversed(self.had))
        if any(one.aim == self.aim for one in with_it):
            return False
        return not (self.lasts and self.is_done(self.last))

    def _had_in_group(self) -> set[str]:
        """Collect what performances were about that all have to be about different things, this one included."""
        group, step = self.performance.group, self.performance.step
        together = (one for one in self.had if one.step == step and one.occasion.rpartition("/")[0] == group)
        return {one.name for one in together}

    def among(self, things: Sequence[str], held: Collection[str]) -> list[str]:
        """Select the best of the things of a class: not done, not had by others, in the hand, not had before.

        Raises ObjectUnresolvable if the step wants something of each thing, and all have been had.
        """
        mine = {one.name for one in self.had if one.aim == self.aim}
        by_others = {one.name for one in self.had if one.aim == self.aim and one.step != self.performance.step}
        in_group = self._had_in_group()
        undone = [name for name in things if name not in in_group and not self.is_done(name)]
        # what another step had, but of which that holds no more, is there to be had again
        free = [name for name in undone if name not in by_others] or undone
        if not free and things and mine:
            step = self.performance.step.rpartition("/")[2].partition(" ")[0]
            told = f"no {self.what} is left for {step}: done already with {', '.join(things)}"
            if self.performance.is_round:
                told = f"{told}; repeat it less often, or say in the loop's condition where a {self.what} has to be"
            raise ObjectUnresolvable(told, designator=str(self.what))
        best = free or [name for name in things if name not in in_group]
        if self.lasts and (carried := [name for name in best if name in held]):
            return carried
        avoided = mine if self.purpose is not None or self.performance.is_round else set[str]()
        if not self.lasts and self.last is not None:
            # what a step before has put somewhere, say, stays there as long as there are others
            avoided = avoided.union(one.name for one in self.had if one.served)
        return [name for name in best if name not in avoided] or best

    def of(self, name: str) -> Meaning:
        """Make the record of what was chosen."""
        return Meaning(self.performance.occasion, self.performance.step, self.aim, name, self.serves)
