"""Neighbours whose shapes overlap in most postures: a draft lets them touch, as MoveIt's setup assistant does."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from executive.robots import bind_draft
from executive.robots.draft import draft_of
from tests.support.robot_parts import Parts, Y, Z


def wrist(*, wide: bool, ceiling: float) -> Parts:
    """An arm on a lift, below a head at ``ceiling`` [m] above the lift; the hull of its wrist may be wide."""
    parts = Parts()
    base = parts.base("wheels")
    mast = parts.fixed(base, parts.link("mast", (0.05, 0.05, 0.1)), (-0.15, 0.0, 0.35))
    head = parts.joint("pan", mast, parts.link("head_pan_link", (0.12, 0.12, 0.1)), (0.0, 0.0, ceiling))
    parts.fixed(head, parts.link("camera_optical_frame"))
    lift = parts.joint("lift", mast, parts.link("lift_link", (0.1, 0.1, 0.1)), (0, 0, 0.1), Z, (0, 0.6), "prismatic")
    arm = parts.arm(lift, "arm", 4, 0.0, at=(0.12, 0.0))
    size = 0.15 if wide else 0.04
    yaw = parts.joint("yaw", arm, parts.link("yaw_link", (size, size, size)), (0.0, 0.0, 0.09), Z)
    pitch = parts.joint("pitch", yaw, parts.link("pitch_link"), (0.0, 0.0, 0.05), Y)
    roll = parts.joint("roll", pitch, parts.link("roll_link", (0.05, 0.05, 0.05), (0, 0, 0.03)), (0.0, 0.0, 0.05), Z)
    parts.gripper(roll, "hand")
    return parts


def touching(parts: Parts, folder: Path) -> set[frozenset[str]]:
    path = parts.written(folder / "robot.urdf")
    draft = draft_of(path)
    bind_draft(draft, path)
    return {frozenset(pair) for pair in tomllib.loads(draft.text()).get("allowed_contacts", ())}


def test_links_that_are_drawn_apart_may_not_touch(tmp_path: Path) -> None:
    assert touching(wrist(wide=False, ceiling=1.0), tmp_path) == set()


def test_a_wrist_in_a_hull_that_overlaps_it_in_most_postures_may_touch_it(tmp_path: Path) -> None:
    assert frozenset(("yaw_link", "roll_link")) in touching(wrist(wide=True, ceiling=1.0), tmp_path)


@pytest.mark.parametrize(("ceiling", "meets"), [(0.7, True), (0.85, False)])
def test_a_lift_may_touch_what_it_meets_only_where_its_range_ends(ceiling: float, meets: bool, tmp_path: Path) -> None:
    pair = frozenset(("lift_link", "head_pan_link"))
    assert (pair in touching(wrist(wide=False, ceiling=ceiling), tmp_path)) == meets
