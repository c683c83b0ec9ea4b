"""Budgets of searches for base poses, used one after the other until something is found."""

from __future__ import annotations

from executive.locations.hand_predicates import Stage
from planlang.records import dataclass

ALL = 1_000_000
"""More than the rows of any map, and the base poses of any candidate."""


@dataclass(frozen=True, slots=True)
class SearchBudget:
    """Budget of one search."""

    stage: Stage
    least: float
    """Smallest score of map rows to use."""
    rows: int
    """Number of rows per height of the torso."""
    each: int
    """Base poses per candidate."""
    most: int
    """Base poses in total."""
    block: int
    """Base poses per call of inverse kinematics."""
    exact: int
    """Base poses to validate exactly."""
    then: SearchBudget | None = None
    """Budget for base poses off the maps' lattice, tried if those on it fail; the search ends there."""

    @property
    def fine(self) -> bool:
        """Whether more than natural candidates are considered."""
        return self.stage > Stage.NATURAL


BETWEEN = SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=12_000, block=128, exact=500)
BUDGETS = (
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=16, most=384, block=48, exact=40),
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=256, most=6_000, block=48, exact=80),
    SearchBudget(Stage.ALL, least=0.05, rows=400, each=128, most=12_000, block=128, exact=150),
    SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=40_000, block=128, exact=500, then=BETWEEN),
)
MOST_CHECKS = 250
"""Base poses that may fail when validated exactly, in all searches for a location, until one is found."""
MOST_SOLVED = 12_000
"""Base poses for which inverse kinematics is solved meanwhile: for a bowl in a drawer 4,000 are too few."""
EASY, EASY_CHECKS, EASY_SOLVED = 3, 100, 4_000
"""Number of budgets with which to test whether a change of the map would help, and these numbers for all changes."""
