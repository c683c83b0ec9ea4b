"""Base poses: which have room for the base and a path to them, and why others do not.

Callers bring base poses (``standing`` has sources of them) and test the remaining ones for themselves: whether a hand
gets there, what the camera sees, how far a leaf can be moved.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.questions import Question, once
from executive.locations.rejections import NO_ROOM, Rejections, first_body
from planlang.failure_wording import NO_WAY
from planlang.geometry import Array

MOST_CROWDED = 48
"""Number of promising base poses whose obstacles are named if there is no room."""


class BasePoses:
    """Base poses in the world as believed at the time of the call; ``question`` receives the rejected ones."""

    def __init__(self, scene: PlanningScene, question: Question | None = None) -> None:
        self.scene, self.question = scene, Question() if question is None else question
        self.crowded: list[tuple[float, Array]] = []
        """Base poses without room, with their scores, for :meth:`name_crowding`."""

    @property
    def log(self) -> Rejections:
        """Rejected base poses, and why."""
        return self.question.log

    def free(self, bases: Array, worth: Array | None = None) -> NDArray[np.bool_]:
        """Check which of bases (n, 3) have room and a path, (n,); note those without room if ``worth`` is given.

        A quick first test: :meth:`has_room` then checks exactly.
        """
        free = self.scene.collisions.floor().holds(bases)
        self.log.add(NO_ROOM, int((~free).sum()))
        if worth is not None:
            self.crowded += zip(worth[~free].tolist(), bases[~free], strict=True)
        free[free] = self.driven_to(bases[free])
        return free

    def rooms(self, bases: Array) -> NDArray[np.bool_]:
        """Check at which of bases (n, 3) there is room for the base, (n,); results are cached for the question."""
        floor = self.scene.collisions.floor()
        return np.array(once(self.question.known.rooms, bases, lambda new: floor.holds(new).tolist()), bool)

    def have_way(self, bases: Array) -> NDArray[np.bool_]:
        """Check which of bases (n, 3) the base can drive to, (n,); all, as long as none was rejected for that."""
        if not self.question.known.walled:
            return np.ones(len(bases), bool)
        good = self.scene.collisions.have_way(bases)
        self.log.add(NO_WAY, int((~good).sum()))
        return good

    def driven_to(self, bases: Array) -> NDArray[np.bool_]:
        good = self.scene.collisions.drivable()(bases)
        self.log.add(NO_WAY, int((~good).sum()))
        return good

    def is_driven_to(self, base: BasePose, score: float) -> bool:
        """Check that the base can surely drive to an otherwise accepted pose; if not, note that paths matter."""
        if self.scene.collisions.has_way(base):
            return True
        self.question.known.walled = True
        return self.log.reject(base, score, NO_WAY)

    def has_room(self, base: BasePose, score: float = 1.0, moving: frozenset[str] = frozenset()) -> bool:
        """Check exactly that the robot in its posture, but for ``moving`` parts, is collision-free at a base pose."""
        contacts = [one for one in self.scene.collisions.contacts(base) if one.part not in moving]
        if contacts:
            body = first_body(contacts)
            self.log.crowded(body)
            self.log.remember(base, score, NO_ROOM, body)
        return not contacts

    def with_room(self, bases: Iterable[Array], moving: frozenset[str] = frozenset()) -> Iterator[BasePose]:
        """Yield, in order and lazily, the bases (3,) at which :meth:`has_room` holds."""
        for x, y, yaw in map(np.ndarray.tolist, bases):
            if self.has_room((x, y, yaw), moving=moving):
                yield x, y, yaw

    def name_crowding(self) -> None:
        """Count the bodies that occupy the best of the base poses noted as without room."""
        for score, place in sorted(self.crowded, key=lambda one: -round(one[0], 6))[:MOST_CROWDED]:
            base = (float(place[0]), float(place[1]), math.remainder(float(place[2]), 2 * math.pi))
            body = first_body(contacts) if (contacts := self.scene.collisions.contacts(base)) else None
            if body is not None:
                self.log.blocking[body] += 1
            self.log.remember(base, score, NO_ROOM, body)
