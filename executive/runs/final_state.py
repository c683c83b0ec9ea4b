"""Final state of a run in words: things in the true world, and how far they were tilted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, MutableSet

from planlang.designators import local_name
from planlang.object_changes import state_word
from sim.joints import Articulation, JointKind
from sim.truth import Truth, at_rest_on, held_by


def state_lines(truth: Truth, names: Iterable[str]) -> Iterator[str]:
    """Yield lines for each thing of the plan: where it is, whether it is open, its state (on, Clean), its contents.

    Then a line for each other door or drawer that the run left open.
    """
    scene, leaves = truth.scene, set[str]()
    for name in dict.fromkeys(names):
        if scene.body(name).graspable:
            holder, support = held_by(truth, name), at_rest_on(truth, name)
            if holder is not None:
                yield f"{name}: held by {holder}"
            else:
                yield f"{name}: at rest on {support}" if support is not None else f"{name}: not at rest"
        for joint in scene.joints:
            if not joint.is_knob and name in (joint.leaf, joint.holder):
                leaves.add(joint.leaf)
                yield f"{joint.leaf}: {_opening(truth.joint(joint.leaf), joint)}"
        if (state := truth.condition(name)) is not None:
            yield f"{name}: {state_word(state)}"
        if content := truth.contents(name):
            listed = (f"{amount:.0f} ml of {local_name(cls)}" for cls, amount in content.items())
            yield f"{name}: holds {', '.join(listed)}"
    for joint in scene.joints:
        value = truth.joint(joint.leaf)
        if not (joint.is_knob or joint.leaf in leaves or joint.is_shut(value)) and joint.is_shut(joint.first):
            yield f"{joint.leaf}: left {_opening(value, joint)}"


def _opening(value: float, joint: Articulation) -> str:
    if joint.is_shut(value):
        return "closed"
    slides = joint.kind is JointKind.PRISMATIC
    return f"open by {100 * value:.0f} cm" if slides else f"open by {math.degrees(value):.0f} degrees"


class Tilts:
    """Watcher that measures the largest tilt [rad] of held things that have to stay upright.

    Only of things that stood upright when grasped; not while they are in ``leaning``, as a step tilts them on purpose.
    """

    def __init__(self, leaning: MutableSet[str] | None = None) -> None:
        self._leaning: MutableSet[str] = set() if leaning is None else leaning
        self.largest: dict[str, float] = {}
        self.limits: dict[str, float] = {}
        self._held: dict[str, bool] = {}
        """Held things -> whether they stood upright when grasped."""

    def __call__(self, world: Truth) -> None:
        """Measure after a step of the world."""
        before, self._held = self._held, {}
        for name in world.attached():
            limit = world.scene.body(name).largest_tilt
            if limit is not None:
                x, y, _, _ = world.pose(name).orientation
                tilt = math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y)))
                self._held[name] = before.get(name, tilt <= limit)
                if self._held[name] and name not in self._leaning:
                    self.largest[name], self.limits[name] = max(tilt, self.largest.get(name, 0.0)), limit

    def degrees(self) -> dict[str, float]:
        """Largest tilt of each thing [degrees], to a tenth."""
        return {name: round(math.degrees(tilt), 1) for name, tilt in self.largest.items()}

    def lines(self) -> Iterator[str]:
        """Yield a line for each thing."""
        for name, tilt in self.degrees().items():
            limit = math.degrees(self.limits[name])
            beyond = f"; {limit:g} are allowed" if tilt > limit else ""
            yield f"{name}: leaned by at most {tilt:g} degrees while it was held{beyond}"
