"""Wiping: what of a surface stays due, and how far the base drives for it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from executive.modules.tools.lane_reach import Run
from executive.modules.tools.lanes import Room, lifted
from executive.modules.tools.wiping import Lane, Wipe
from planlang.geometry import Array
from planlang.motion_constraints import ConstraintsUnsatisfied

FAR = (9.0, 0.0, 0.0)
"""Base pose from which two places are reached, too few to be worth the drive."""
NARROW = 20
"""Base poses on the way there that reach more and have no room."""


def _lane(count: int) -> Lane:
    return Lane(np.column_stack([0.06 * np.arange(count), np.zeros((count, 2))]))


def _run(first: int, last: int) -> Run:
    return Run(first, last, np.zeros((last - first + 3, 7)))


def _wipe(*lanes: Lane) -> Wipe:
    """Make a surface 1 m long, of which two places of each lane are reached, from FAR only."""
    places = np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros((101, 2))])[None]
    poses = SimpleNamespace(free=lambda bases: np.ones(len(bases), bool), has_room=lambda base: base == FAR)
    bases = np.array([(0.0, 0.0, 0.0), *((1.0 + 0.2 * k, 0.0, 0.0) for k in range(NARROW)), FAR])
    standing = SimpleNamespace(poses=poses, lattice=lambda *_: (bases, np.ones(len(bases), bool)))
    platform = SimpleNamespace(base=lambda: (0.0, 0.0, 0.0), joints=lambda _: np.zeros(7), standing=lambda: standing)

    def counts(bases: Array, due: list[Array]) -> Array:
        return np.outer(np.where(bases[:, 0] == FAR[0], 2, np.where(bases[:, 0] > 0.0, 20, 0)), np.ones(len(due), int))

    reach = SimpleNamespace(
        counts=counts,
        gain=lambda _, due: 2 * len(due),
        runs=lambda *_: iter([_run(0, 1)]),
    )
    motion = SimpleNamespace(arms=[SimpleNamespace(joints=())])
    room = Room(places, np.ones((1, 101), bool), 2)
    return Wipe(cast(Any, platform), cast(Any, motion), np.eye(4), room, cast(Any, reach), list(lanes))


@pytest.mark.parametrize(
    ("first", "last", "rest"), [(0, 4, []), (1, 4, [[0, 1]]), (0, 3, [[3, 4]]), (1, 2, [[0, 1], [2, 3, 4]])]
)
def test_the_rest_of_a_lane_stays_due_from_the_last_place_that_was_wiped(
    first: int, last: int, rest: list[list[int]]
) -> None:
    lane = _lane(5)
    wipe = _wipe(lane)
    wipe.done(lane, _run(first, last))
    assert [one.places.tolist() for one in wipe.due] == [lane.places[part].tolist() for part in rest]


def test_no_place_is_left_out_between_the_halves_of_a_lane_that_failed() -> None:
    lane = _lane(7)
    wipe = _wipe(lane)
    wipe.failed(lane, ConstraintsUnsatisfied())
    first, second = (one.places for one in wipe.due)
    assert first[-1].tolist() == second[0].tolist()
    assert len(first) + len(second) == 8


def test_a_base_pose_with_room_is_found_though_many_without_reach_more() -> None:
    assert list(_wipe(_lane(2)).stands()) == [FAR]


def test_the_base_drives_far_for_few_places_only_until_enough_is_wiped() -> None:
    wipe = _wipe(_lane(2))
    assert not wipe.is_enough()
    assert list(wipe.stands()) == [FAR]
    wipe.wiped.append(lifted(np.array([(0.0, 0.0, 0.0), (0.9, 0.0, 0.0)])))
    assert wipe.is_enough()
    assert list(wipe.stands()) == []
