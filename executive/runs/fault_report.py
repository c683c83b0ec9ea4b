"""What has become of the faults of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class FaultReport:
    """What has become of the faults of a run."""

    fired: tuple[Mapping[str, Any], ...]
    """Plan time [s], fault, kind and number of the opportunity of each that happened, in their order."""
    never: tuple[str, ...]
    """Stated faults that did not happen."""
    stated: int
    """Number of stated faults."""
    opportunities: int
    is_strict: bool = False
    """True if a file states faults, and an end: then both have to come true."""

    def as_json(self) -> dict[str, Any]:
        """The report as JSON."""
        return {
            "fired": [dict(one) for one in self.fired],
            "never": list(self.never),
            "stated": self.stated,
            "opportunities": self.opportunities,
        }

    def lines(self) -> Iterator[str]:
        """Yield a line of how many happened, and one for each."""
        number = f"{len(self.fired)} at {self.opportunities} opportunities"
        if self.stated:
            number += f"; of {self.stated} stated, {self.stated - len(self.never)} happened"
        yield f"faults: {number}"
        yield from (f"  {one['time']:.2f} s  {one['fault']}" for one in self.fired)
