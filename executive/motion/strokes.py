"""Strokes: a tool goes through many places without a stop, as a spoon in a pot or a sponge on a table.

At each place constraints hold, and some throughout the stroke. Configurations at all places are optimised together;
every row of the timed motion is checked, as those of a phase are (:mod:`executive.motion.constrained_motion`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from executive.motion.constrained_ends import Ends, MotionProblem
from executive.motion.constrained_motion import MOST_ENDS, Way
from executive.motion.errors import ConstraintsContradict, NoConstrainedPath
from planlang.geometry import Array
from planlang.motion_constraints import MotionConstraint
from planlang.protocols import Trajectory

Place = Sequence[MotionConstraint]

MOST_UNEQUAL = 5000.0
"""Largest ratio of the price of a joint's moves to the median: with that of a phase the torso of the PR2, at 13 mm/s,
moved by 0.1 to 0.2 m on lanes that its arm wipes in 5 s without."""


def ends_at(problem: MotionProblem, start: Array, places: Sequence[Place]) -> Ends:
    """Return the search for configurations at all places from joint values (n,)."""
    return Ends.of(replace(problem, rates=replace(problem.rates, most_unequal=MOST_UNEQUAL)), start, places)


def solve_stroke(
    to_first: MotionProblem,
    problem: MotionProblem,
    start: Array,
    places: Sequence[Place],
    kept: Collection[MotionConstraint],
    *,
    closed: bool,
) -> tuple[Trajectory, Trajectory]:
    """Return the way from joint values (n,) to the first place, and that through all, if closed back to the first.

    ``kept`` holds throughout the second; ``to_first`` is the same problem, where more may not be touched. Raises
    :class:`ConstraintsContradict`, :class:`NoConstrainedPath`, and :class:`MotionError` for features, tools or frames
    of which nothing is known.
    """
    ends = ends_at(problem, start, places)
    bounds = ends.functions.bounds
    keeping = [number for number, bound in enumerate(bounds) if bound.constraint in kept]
    every, tried = range(len(bounds)), []
    for found in islice(ends.along(), MOST_ENDS):
        rows = np.array(list(found.values()))
        if closed:
            rows = ends.rounded(rows)
            rows = np.vstack([rows, rows[:1]])
        try:
            begun = Way(to_first, ends.functions, start, rows[0], (), every, 0).timed()
            return begun, Way(problem, ends.functions, rows[0], rows[-1], keeping, every, 0).through(rows)
        except NoConstrainedPath as failure:
            tried.append(failure)
    raise tried[0] if tried else ConstraintsContradict(0, [bound.constraint for bound in bounds])
