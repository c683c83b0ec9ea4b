"""Bounds of searches for base poses, one after the other until something is found."""

from __future__ import annotations

from executive.locations.hand_predicates import Stage
from planlang.records import dataclass

ALL = 1_000_000
"""More rows than a map has, more base poses than a candidate."""


@dataclass(frozen=True, slots=True)
class SearchBudget:
    """Bounds of one search."""

    stage: Stage
    least: float
    """Score of a map's rows that are used."""
    rows: int
    """So many of them for each height of the torso."""
    each: int
    """Base poses of one candidate."""
    most: int
    """Base poses in all."""
    block: int
    """Base poses whose inverse kinematics is solved at once."""
    exact: int
    """Base poses that are validated exactly."""
    then: SearchBudget | None = None
    """Bounds for base poses between those of the maps, when there is nothing at these: no more is looked for then."""

    @property
    def fine(self) -> bool:
        """Return True if not only natural candidates are looked at."""
        return self.stage > Stage.NATURAL


BETWEEN = SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=12_000, block=128, exact=500)
BUDGETS = (
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=16, most=384, block=48, exact=40),
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=256, most=6_000, block=48, exact=80),
    SearchBudget(Stage.ALL, least=0.05, rows=400, each=128, most=12_000, block=128, exact=150),
    SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=40_000, block=128, exact=500, then=BETWEEN),
)
EASY = 3
"""Number of the first of them that suffice to find out whether a change of the map would do."""
