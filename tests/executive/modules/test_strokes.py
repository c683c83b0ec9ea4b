"""Strokes: how slowly they are made."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from executive.modules.tools.strokes import slowed
from planlang.protocols import Trajectory


@given(st.floats(1.0, 20.0), st.integers(2, 40))
def test_a_slowed_motion_goes_the_same_way_and_takes_so_many_times_as_long(factor: float, count: int) -> None:
    rows = np.stack([np.linspace(0.0, 1.0, count), np.linspace(1.0, -1.0, count)], axis=1)
    slow = slowed(Trajectory(("a", "b"), rows), factor).positions
    assert abs((len(slow) - 1) - factor * (count - 1)) <= 0.5 + 1e-9
    assert np.allclose(slow[[0, -1]], rows[[0, -1]])
    assert np.all(np.diff(slow[:, 0]) > 0)
    assert np.allclose(slow[:, 1], 1.0 - 2.0 * slow[:, 0])
