"""Views: what depth pictures show of points of the map."""

from __future__ import annotations

import numpy as np

from executive.locations.views import hiding, passed

EYE = np.zeros(3)
ENDS = np.array([[3.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
"""Ends of two lines of sight: one goes on for 3 m, the other ends on a surface."""


def test_a_line_of_sight_that_goes_on_behind_a_point_shows_that_nothing_is_there() -> None:
    points = np.array([[1.0, 0.0, 0.0], [1.0, 0.02, 0.0], [1.0, 0.05, 0.0]])
    shown, empty = passed(EYE, points, ENDS, 0.03)
    assert shown.tolist() == empty.tolist() == [True, True, False], "the last is too far from the line"


def test_a_surface_at_a_point_or_before_it_shows_nothing_of_what_is_behind() -> None:
    points = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.97, 0.97, 0.0]])
    shown, empty = passed(EYE, points, ENDS, 0.03)
    assert (shown.tolist(), empty.any()) == ([True, False, True], False)
    assert hiding(EYE, points, ENDS, np.array([False, True]))[0].tolist() == [False, True, False]
