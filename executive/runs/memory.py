"""What a robot executive has to remember so that a run can be resumed: the world as it is, and what it believes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import astuple
from typing import Any, Protocol, runtime_checkable

import numpy as np

from executive.belief.free_floor import BasePose
from executive.locations import Reach, ReachSolution
from executive.locations.reach import HandTerm
from executive.locations.ways import HandPlan
from executive.modules.arm_choice import ArmChoices
from executive.modules.platform import Platform
from executive.robots.arms import ArmModel
from planlang.designators import Location
from planlang.geometry import Array
from planlang.kernel.exact import dump, load


@runtime_checkable
class RestorableWorld(Protocol):
    """A world that can be brought back to where it was: a simulator."""

    def snapshot(self) -> dict[str, Any]:
        """The state as JSON."""

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a snapshot; raises ValueError for one that does not fit."""


def snapshot(platform: Platform) -> dict[str, Any]:
    """World, belief, planning world, random numbers and choices that are kept, as JSON; about 5 kB.

    A world that cannot be restored is left out.
    """
    state: dict[str, Any] = {}
    if isinstance(platform.world, RestorableWorld):
        state["world"] = platform.world.snapshot()
    state["believed"] = platform.scene.world.snapshot()
    state["belief"] = platform.belief.snapshot()
    state["rng"] = platform.rng.bit_generator.state
    state["arms"] = platform.choices.state()
    state["begun"] = [
        [arm, revision, list(base), _way_json(way)]
        for arm, (revision, base, way) in platform.begun_grasps.items()
        if revision == platform.belief.revision and base == platform.base()
    ]
    state["reached"] = [
        [arm, list(base), [_way_json(way) for way in ways.values()]]
        for (arm, base), ways in platform.resolver.reached_from(platform.base()).items()
    ]
    state["viewers"] = [[dump(location), list(place)] for location, place in platform.resolver.viewers()]
    return state


def restore(platform: Platform, state: Mapping[str, Any], *, world: bool) -> None:
    """Go on from a snapshot; ``world``: bring the world back too. Raises ValueError for one that does not fit."""
    try:
        if world and isinstance(platform.world, RestorableWorld):
            platform.world.restore_state(state["world"])
        platform.belief.restore(state["belief"])
        platform.scene.world.restore_state(state["believed"])
        platform.rng.bit_generator.state = state["rng"]
        arms = {arm.name: arm for arm in platform.scene.arms.all}
        platform.choices = ArmChoices.restored(state["arms"], arms)
        platform.begun_grasps = {
            arms[arm].name: (int(revision), _base(base), _way(way, arms)) for arm, revision, base, way in state["begun"]
        }
        platform.resolver.remember(
            {(arms[arm].name, _base(base)): list(_ways(ways, arms)) for arm, base, ways in state["reached"]}
        )
        platform.resolver.remember_viewers([_viewer(*viewer) for viewer in state["viewers"]])
    except (KeyError, TypeError, AttributeError) as problem:
        raise ValueError(f"the state of the robot is damaged: {problem!r}") from None


def _way_json(way: ReachSolution) -> list[Any]:
    plan = way.plan
    hand = [plan.label, plan.poses.tolist(), plan.touches, plan.opened]
    return [_listed(astuple(way.reach)), way.arm.name, hand, way.joints.tolist()]


def _listed(value: Any) -> Any:
    """A value with lists for tuples, as JSON gives it back: a state is compared with one that was read."""
    return [_listed(one) for one in value] if isinstance(value, tuple) else value


def _way(state: Any, arms: Mapping[str, ArmModel]) -> ReachSolution:
    reach, arm, (label, poses, touches, opened), joints = state
    plan = HandPlan(str(label), _array(poses, (-1, 4, 4)), touches, bool(opened))
    return ReachSolution(_reach(*reach), arms[arm], plan, _array(joints, (-1, len(arms[arm].joints))))


def _reach(
    kind: str, body: str, grasp: str | None, some: Any, heights: Any, inside: bool, also: Any, before: bool
) -> Reach:
    low, high = heights
    named = None if some is None else tuple(map(str, some))
    terms = tuple(_term(*term) for term in also)
    return Reach(kind, body, grasp, named, (float(low), float(high)), inside, terms, before)


def _term(name: str, body: str, within: float | None, beyond: float | None, negated: bool, viewer: Any) -> HandTerm:
    seen = None if viewer is None else (float(viewer[0]), float(viewer[1]))
    return HandTerm(name, body, within, beyond, negated, seen)


def _ways(states: Any, arms: Mapping[str, ArmModel]) -> Iterator[ReachSolution]:
    for state in states:
        yield _way(state, arms)


def _viewer(what: Any, place: Any) -> tuple[Location, tuple[float, float]]:
    location, (x, y) = load(what), place
    if not isinstance(location, Location):
        raise TypeError(f"{location!r} is no location")
    return location, (float(x), float(y))


def _array(state: Any, shape: tuple[int, ...]) -> Array:
    return np.array(state, dtype=float).reshape(shape)


def _base(state: Any) -> BasePose:
    x, y, yaw = state
    return float(x), float(y), float(yaw)
