"""What goes wrong at each opportunity of a run: faults that were named, and those of a rate, drawn by counter.

The n-th opportunity of a run with a seed has its own random numbers, a hash of both: what is drawn there depends
neither on what was drawn before nor on what else is asked.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from hashlib import blake2b

from planlang.faults.kinds import KINDS, Kind, Opportunity
from planlang.faults.named import NamedFault
from planlang.records import dataclass


def share(seed: int, number: int, what: str = "") -> float:
    """Draw a number from 0 to 1 for an opportunity of a run, by a hash."""
    digest = blake2b(f"{seed} {number} {what}".encode("utf-8", "surrogatepass"), digest_size=8).digest()
    return int.from_bytes(digest, "big") / 2**64


@dataclass(frozen=True, slots=True)
class Drawn:
    """A fault that begins at an opportunity."""

    kind: Kind
    of: str
    """What it happens to."""
    number: int
    """Number of the opportunity in the run."""
    seed: int
    value: str | None = None
    named: NamedFault | None = None
    """The stated fault that it is; None if it is drawn by a rate."""

    def __str__(self) -> str:
        return f"{self.kind.part}.{self.of}:{self.kind.name}" if self.of else str(self.kind)

    def share(self, what: str) -> float:
        """Draw a number from 0 to 1 that belongs to this fault, for example for how much."""
        return share(self.seed, self.number, what)

    def between(self, least: float, most: float, what: str = "how much") -> float:
        """Return the stated value, or draw one."""
        return least + self.share(what) * (most - least) if self.value is None else float(self.value)


@dataclass(frozen=True, slots=True)
class Fired:
    """A fault that has happened."""

    time: float
    """Plan time [s]."""
    fault: Drawn


class Draw:
    """Decides what goes wrong in one run."""

    def __init__(self, named: Sequence[NamedFault], rate: float, seed: int) -> None:
        """``rate`` is the share of opportunities, from 0 to 1, at which something goes wrong by chance."""
        self._named, self._rate, self.seed = tuple(named), rate, seed
        self._counts = [0] * len(self._named)
        """Opportunities at which each named fault could have happened."""
        self.opportunities = 0
        self.fired: list[Fired] = []

    def at(
        self,
        opportunity: Opportunity,
        names: Sequence[str],
        time: float,
        can: Callable[[Kind, str | None, str | None], bool],
    ) -> Drawn | None:
        """Decide what goes wrong at an opportunity that begins at a plan time [s]; None: nothing.

        ``names`` are what the arm, person, thing or door is called, ``can`` checks whether a kind can happen here, to
        what the fault names, with its value.
        """
        self.opportunities += 1
        number, of = self.opportunities, names[0] if names else ""
        chosen: NamedFault | None = None
        for place, one in enumerate(self._named):
            is_such = one.kind.opportunity is opportunity and _is_of(one, names)
            if not (is_such and can(one.kind, one.of, one.value)):
                continue
            self._counts[place] += 1
            if chosen is None and one.when.is_now(self._timed_count(place, one, time), time):
                chosen = one
        if chosen is not None:
            return Drawn(chosen.kind, of, number, self.seed, chosen.value, chosen)
        if self._rate <= 0 or share(self.seed, number) >= self._rate:
            return None
        kinds = [one for one in KINDS if one.opportunity is opportunity and one.recovers and can(one, None, None)]
        if not kinds:
            return None
        kind = kinds[int(share(self.seed, number, "kind") * len(kinds))]
        return Drawn(kind, of, number, self.seed)

    def _timed_count(self, place: int, fault: NamedFault, time: float) -> int:
        """Count the opportunities of a fault; of one with a plan time only those since then."""
        if fault.when.since is not None and time < fault.when.since:
            self._counts[place] = 0
        return self._counts[place]

    def happened(self, fault: Drawn, time: float) -> None:
        """Record that a fault has happened at a plan time [s]."""
        self.fired.append(Fired(time, fault))

    def never(self) -> Sequence[NamedFault]:
        """List the stated faults that have not happened."""
        happened = {one.fault.named for one in self.fired}
        return tuple(one for one in self._named if one not in happened)


def _is_of(fault: NamedFault, names: Collection[str]) -> bool:
    """Check whether a fault may happen to what has these names; as the base moves, it does to other things."""
    return fault.of is None or fault.of in names or fault.kind.opportunity is Opportunity.BASE
