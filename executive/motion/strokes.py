"""Strokes: a tool passes many places without stopping, as a spoon in a pot or a sponge on a table.

Each place has its constraints, and some hold throughout the stroke. Configurations at all places are optimised
together; every row of the timed motion is checked, as in a phase (:mod:`executive.motion.constrained_motion`).
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
"""Largest ratio of the cost of a joint's moves to the median. With the ratio of a phase, the PR2's torso (13 mm/s)
moved by 0.1 to 0.2 m in strokes that its arm alone wipes in 5 s."""


def ends_at(problem: MotionProblem, start: Array, places: Sequence[Place]) -> Ends:
    """Set up the search for configurations at all places from joint values (n,)."""
    return Ends.of(replace(problem, rates=replace(problem.rates, most_unequal=MOST_UNEQUAL)), start, places)


def solve_stroke(
    to_first: MotionProblem,
    problem: MotionProblem,
    start: Array,
    places: Sequence[Place],
    kept: Collection[MotionConstraint],
    *,
    closed: bool,
    guess: Array | None = None,
) -> tuple[Trajectory, Trajectory]:
    """Plan the motion from joint values (n,) to the first place, and that through all, if closed back to the first.

    ``kept`` holds throughout the second; ``to_first`` is the same problem with stricter collision rules. ``guess``
    (m, n): joint values near those at the places, the only ones to begin with. Raises :class:`ConstraintsContradict`,
    :class:`NoConstrainedPath`, and :class:`MotionError` for unknown features, tools or frames.
    """
    ends = ends_at(problem, start if guess is None else guess[0], places)  # a slow torso stays as guessed
    bounds = ends.functions.bounds
    kept_numbers = [number for number, bound in enumerate(bounds) if bound.constraint in kept]
    all_numbers, failures = range(len(bounds)), []
    for configurations in islice(ends.along() if guess is None else ends.near(guess), MOST_ENDS):
        rows = np.array(list(configurations.values()))
        if closed:
            rows = ends.rounded(rows)
            rows = np.vstack([rows, rows[:1]])
        try:
            approach = Way(to_first, ends.functions, start, rows[0], (), all_numbers, 0).timed()
            return approach, Way(problem, ends.functions, rows[0], rows[-1], kept_numbers, all_numbers, 0).through(rows)
        except NoConstrainedPath as failure:
            failures.append(failure)
    raise failures[0] if failures else ConstraintsContradict(0, [bound.constraint for bound in bounds])
