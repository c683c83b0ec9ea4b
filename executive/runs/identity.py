"""Which true thing is what the robot believes: for declared effects in the simulated world, and for what is reported.

A robot that takes one bottle for another pours from the one that is in its hand. No plan and no module learns of this.
"""

from __future__ import annotations

from dataclasses import replace

from executive.belief import Belief
from executive.belief.planning_scene import PlanningScene
from planlang.changes import Change, Physics, Poured, Simulated, Switched, Transformed, TurnedOver
from sim import PyBulletWorld
from sim.likeness import is_of_kind

SAME_PLACE = 0.05
"""Distance of a true thing from where the one of its name is believed, up to which it surely is that [m]."""
NEAR = 0.5
"""Distance from where a thing is believed up to which a true one of its class and size is that [m]."""
SIZE = 0.02
"""Difference of sizes up to which they are equal [m]."""


class Identities:
    """Finds the true things that believed ones are."""

    def __init__(self, truth: PyBulletWorld, scene: PlanningScene) -> None:
        self._truth, self._scene = truth, scene

    def of(self, name: str) -> str:
        """Find the true thing that a believed one is: what is in the same hand, or of its kind where it is believed.

        The thing of its name, if nothing else is.
        """
        belief: Belief = self._scene.belief
        truth, names = self._truth, self._truth.names()
        if name in belief.held:
            link = belief.held[name].link
            return next((one for one in truth.attached() if link in truth.holders(one)), name)
        if name in belief.state.away:  # handed to somebody
            taken = [one for one in names if truth.taken(one) is not None and self._is_alike(one, name)]
            return taken[0] if taken and name not in taken else name
        if name not in belief.names() or any(name in joint.bodies for joint in truth.scene.joints):
            return name
        pose = self._scene.world.pose(name)
        if name in names and truth.pose(name).distance(pose) <= SAME_PLACE:
            return name
        alike = (one for one in names if self._is_alike(one, name))
        distances = {one: truth.pose(one).distance(pose) for one in alike}
        nearest = min(distances, key=lambda one: distances[one], default=name)
        return nearest if distances.get(nearest, 0.0) <= NEAR else name

    def _is_alike(self, one: str, name: str) -> bool:
        true, believed = self._truth.scene.body(one), self._scene.world.scene.body(name)
        return is_of_kind(true, believed, SIZE)


class TrueEffects(Physics):
    """The simulated world, in which declared effects on believed things come true for those that these are."""

    def __init__(self, truth: PyBulletWorld, scene: PlanningScene) -> None:
        """Make them for what is believed in a planning scene."""
        self._truth, self._of = truth, Identities(truth, scene).of

    @property
    def changed(self) -> int:
        return self._truth.changed

    @property
    def simulated(self) -> Simulated:
        return self._truth.simulated

    def bring_about(self, change: Change, since: Simulated | None = None) -> bool:
        return self._truth.bring_about(self._true(change), since)

    def is_free(self, name: str) -> bool:
        return self._truth.is_free(name)

    def _true(self, change: Change) -> Change:
        match change:
            case Poured(source, target, amount):
                return Poured(self._of(source), self._of(target), amount)
            case TurnedOver(name):
                return TurnedOver(self._of(name))
            case Switched(name, value):
                return Switched(self._of(name), value)
            case Transformed():
                things = tuple((self._of(name), amount) for name, amount in change.things)
                used = tuple((self._of(name), cls) for name, cls in change.used)
                vessel = None if change.vessel is None else self._of(change.vessel)
                return replace(change, things=things, used=used, vessel=vessel)
