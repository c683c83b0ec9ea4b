"""What a run tells of how far held things leaned, and when that was measured."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast

import pytest

from executive.runs.options import Tilts
from sim import PyBulletWorld


@pytest.mark.parametrize(("first", "lines"), [(0.0, 1), (1.5, 0)], ids=["stood", "lay"])
def test_how_far_a_thing_leaned_is_told_if_it_stood_when_it_was_grasped(first: float, lines: int) -> None:
    watched = Tilts()
    for lean in (first, 0.1, first):
        turn = (math.sin(lean / 2), 0.0, 0.0, math.cos(lean / 2))
        poses, bodies = {"cup": SimpleNamespace(orientation=turn)}, {"cup": SimpleNamespace(largest_tilt=0.26)}
        scene = SimpleNamespace(body=bodies.__getitem__)
        world = SimpleNamespace(
            attached=lambda: ["cup"], carrier=lambda name: None, scene=scene, pose=poses.__getitem__
        )
        watched(cast(PyBulletWorld, world))
    assert len(list(watched.lines())) == lines


@pytest.mark.parametrize(
    ("carriers", "leaning", "how"),
    [
        ([None, None], [False, False], "held"),
        (["tray", "tray"], [False, False], "carried on tray"),
        ([None, "tray"], [False, False], "held and carried on tray"),
        ([None, None], [False, True], "held, except when it was tilted on purpose"),
    ],
    ids=["in the hand", "on a tray", "in the hand, then on a tray", "for pouring"],
)
def test_how_a_thing_was_held_while_it_leaned_is_told(
    carriers: list[str | None], leaning: list[bool], how: str
) -> None:
    on_purpose: set[str] = set()
    watched = Tilts(on_purpose)
    for carrier, leans in zip(carriers, leaning, strict=True):
        on_purpose |= {"cup"} if leans else set()
        scene = SimpleNamespace(body=lambda name: SimpleNamespace(largest_tilt=0.26))
        pose = SimpleNamespace(orientation=(0.0, 0.0, 0.0, 1.0))
        world = SimpleNamespace(
            attached=lambda: ["cup"], carrier=lambda name, on=carrier: on, scene=scene, pose=lambda name, at=pose: at
        )
        watched(cast(PyBulletWorld, world))
        watched(cast(PyBulletWorld, SimpleNamespace(attached=lambda: [])))  # it is let go
    assert list(watched.lines()) == [f"cup: leaned by at most 0 degrees while it was {how}"]
