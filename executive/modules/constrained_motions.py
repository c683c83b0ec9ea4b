"""The process module for motions under constraints (KnowRob's ITaSCMotion): one phase of a recipe in each action.

It looks at the things that constraints are about, drives nearer where they are out of reach, moves the arms that hold
the tools, and checks in the end what holds. A vessel that ends upside down is held so until the amount has flowed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, islice

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.modules.motion_grounding import GroundedMotion, Grounding
from executive.modules.phases import Phase
from executive.modules.platform import Platform
from executive.modules.pouring import Pouring
from executive.modules.process_modules import Navigation
from executive.modules.stances import stances
from executive.motion import MotionError
from executive.motion.constrained_ends import Ends
from executive.motion.constrained_motion import PhaseMotion, solve_motion
from executive.motion.constraint_functions import Bound, ConstraintFunctions
from executive.motion.errors import ConstraintsContradict, NoConstrainedPath
from planlang import checkpoint, perform
from planlang.designators import Action, Location, Object, action
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    NavigationFailure,
    PerceptionFailure,
)
from planlang.geometry import Array
from planlang.modules import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied, Feature, MotionConstraint
from planlang.protocols import MotionState

INSIDE = 1 / 3
"""Share of the width between limits that is left out on both sides at first: a motion ends well inside if it can."""
PLACES = 4
"""Places of the base from which a motion is tried."""


@process_module
class ConstrainedMotions:
    """Moves one or more arms until constraints between features of tools and of the world hold."""

    name = "constrained_motion"
    actions = ("ITaSCMotion",)
    failures = (ManipulationFailure, NavigationFailure, PerceptionFailure, LookingFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the base, the torso and the arms of tools; the head is asked for by looking."""
        scene = self.platform.scene
        holders = [one.tool.held_by for one in constraints_of(action)]
        arms = {arm.name for held_by in holders for arm in (scene.arms.of(held_by) if held_by else scene.arms.all)}
        torso = [] if self.platform.robot.torso is None else ["torso"]
        return ("base", *torso, *(arm.name for arm in scene.arms.all if arm.name in arms))

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Move; return the names of constraints that heavier ones exclude. Without active ones nothing moves."""
        asked = [one for one in constraints_of(action) if one.is_active]
        phase = self.platform.phases.current()
        if not asked:
            phase.before = ()
            await checkpoint()
            return ()
        grounding = Grounding(self.platform)
        motion, solved = await self._solved(grounding, asked, phase)
        self.platform.arms.choices.choose(motion.arms[0].name)
        done = await self.platform.follow(" and ".join(arm.name for arm in motion.arms), solved.trajectory)
        if done.state is not MotionState.DONE:
            await self.platform.sensing.bump(done)
            name = motion.arms[0].name
            raise ManipulationGoalInCollision(arm=name, what=action.type, blocked_by=done.blocked_by)
        self._check_end(grounding, motion, solved)
        await Pouring(self.platform).pour(action, motion, grounding.group(motion), solved.trajectory.positions)
        phase.before = tuple(asked)
        return tuple(str(one.name) for one in solved.given_up)

    # Where from

    async def _solved(
        self, grounding: Grounding, asked: Sequence[MotionConstraint], phase: Phase
    ) -> tuple[GroundedMotion, PhaseMotion]:
        """Return the motion, from here or from a place to which the base is driven; raises ConstraintsUnsatisfied."""
        problem: ManipulationFailure | NavigationFailure | None = None
        await self._look(grounding, asked, phase)
        for place in chain([None], islice(self._places(grounding, asked, phase), PLACES)):
            try:
                if place is not None:
                    await self._drive(place)
                    await self._look(grounding, asked, phase)
                motion = grounding.grounded(asked, phase)
                if place is None and self._is_mobile() and not self._within_reach(grounding, motion, None):
                    continue
                return motion, self._way(grounding, motion, phase)
            except (ConstraintsUnsatisfied, NavigationFailure) as failure:
                problem = problem or failure
        if problem is not None:
            raise problem
        motion = grounding.grounded(asked, phase)
        return motion, self._way(grounding, motion, phase)

    def _is_mobile(self) -> bool:
        return not self.platform.robot.base.fixed

    async def _look(self, grounding: Grounding, asked: Sequence[MotionConstraint], phase: Phase) -> None:
        """Look at things of the world that were not seen since the base moved; keep where they are seen first."""
        belief = self.platform.belief
        for name in grounding.world_things(asked):
            if name in phase.things or name in belief.held:
                continue
            if not belief.seen_from_here(name):
                with suppress(PerceptionFailure, LookingFailure):
                    what = next(one.world.of for one in asked if self.platform.scene.bodies.bind(one.world.of) == name)
                    await perform(action("LookingForSomething", object_acted_on=what))
            if belief.seen_from_here(name) or self.platform.robot.camera is None:
                phase.things[name] = belief.pose(name)

    async def _drive(self, place: BasePose) -> None:
        x, y, yaw = map(float, place)
        await Navigation(self.platform).execute(action("Translation-LocationChange", x=x, y=y, yaw=yaw))

    def _places(self, grounding: Grounding, asked: Sequence[MotionConstraint], phase: Phase) -> Iterator[BasePose]:
        """Yield places of the base from which constraints can hold, if nothing is in the way, near ones first."""
        if not self._is_mobile():
            return
        motion = grounding.grounded(asked, phase)
        points = np.array([pose[:2, 3] for pose in motion.things.values()])
        for base in stances(self.platform, points.mean(axis=0), motion.arms):
            if self._within_reach(grounding, motion, base):
                yield base

    def _within_reach(self, grounding: Grounding, motion: GroundedMotion, base: BasePose | None) -> bool:
        problem = grounding.problem(motion, self.platform.base() if base is None else base)
        return Ends.of(problem, self._start(motion), [_inside(motion.constraints, ())]).within_reach(TRIES)

    # The motion

    def _way(self, grounding: Grounding, motion: GroundedMotion, phase: Phase) -> PhaseMotion:
        """Return the motion of the phase, well inside of its limits if there is one; raises ConstraintsUnsatisfied."""
        self.platform.sync()
        problem, start = grounding.problem(motion), self._start(motion)
        before = grounding.grounded(phase.before, phase).constraints if phase.before else ()
        inside = _inside(motion.constraints, before)
        with suppress(MotionError):
            (found,) = solve_motion(problem, start, [inside], before)
            if not found.given_up:
                return found
        try:
            (found,) = solve_motion(problem, start, [motion.constraints], before)
        except (ConstraintsContradict, NoConstrainedPath) as failure:
            names = tuple(str(one.name or one) for one in failure.constraints)
            blocking = next((body for _, body in failure.pairs), None)
            arm = motion.arms[0].name
            raise ConstraintsUnsatisfied(
                str(failure).partition(": ")[2], arm=arm, blocked_by=blocking, constraints=names
            ) from failure
        except MotionError as failure:
            raise ConstraintsUnsatisfied(str(failure), arm=motion.arms[0].name) from failure
        return found

    def _start(self, motion: GroundedMotion) -> Array:
        """Return the joint values of the arms (n,), shared ones first met."""
        names = dict.fromkeys(name for arm in motion.arms for name in arm.joints)
        return self.platform.joints(tuple(names))

    def _check_end(self, grounding: Grounding, motion: GroundedMotion, solved: PhaseMotion) -> None:
        """Raise ConstraintsUnsatisfied for what does not hold where the arms are, but for what was given up."""
        given_up = {one.name for one in solved.given_up}
        asked = [one for one in motion.constraints if one.name not in given_up]
        problem = grounding.problem(motion, self.platform.base())
        functions = ConstraintFunctions(problem.group, [Bound.of(one, problem.where) for one in asked])
        excess = functions.excess(functions.all_values(self._start(motion)[None])[0])
        outside = tuple(str(one.name or one) for one, beyond in zip(asked, excess, strict=True) if beyond > 1.0)
        if outside:
            raise ConstraintsUnsatisfied(arm=motion.arms[0].name, constraints=outside)


TRIES = 3
"""Beginnings from which it is looked whether constraints are within reach of a place."""


def constraints_of(action: Action) -> tuple[MotionConstraint, ...]:
    """Return the constraints of an action, about what it acts on; raises ActionUnresolvable if it does not say what."""
    stated = action.get("constrained_by")
    every = stated if isinstance(stated, tuple) else (stated,)
    return tuple(
        replace(one, tool=_about(one.tool, action), world=_about(one.world, action))
        for one in every
        if isinstance(one, MotionConstraint)
    )


ROLES = {"ObjectActedOn": "object_acted_on", "TargetOfMotion": "to_location"}
"""Class that stands for what a motion is about -> the property of the action that says what that is."""


def _about(feature: Feature, action: Action) -> Feature:
    """Return a feature of the thing that the action names, if the feature's thing stands for that."""
    role = ROLES.get(feature.of.type)
    if role is None:
        return feature
    filler = action.get(role)
    parts = (one.reference for one in filler.relations) if isinstance(filler, Location) else (filler,)
    what = next((one for one in parts if isinstance(one, Object)), None)
    if what is None:
        raise ActionUnresolvable(f"a motion about {feature} needs {role}", designator=str(action))
    return replace(feature, of=what)


def _inside(
    constraints: Sequence[MotionConstraint], before: Sequence[MotionConstraint]
) -> tuple[MotionConstraint, ...]:
    """Return constraints with narrower limits, but for those that were asked for before: they hold on the way."""
    return tuple(one if any(one.asks_the_same(other) for other in before) else _narrowed(one) for one in constraints)


def _narrowed(constraint: MotionConstraint) -> MotionConstraint:
    lower, upper = constraint.limits
    least, most = constraint.kind.value.range
    margin = INSIDE * (min(upper, most) - max(lower, least))
    if not np.isfinite(margin) or margin <= 0:
        return constraint
    return replace(
        constraint,
        lower=constraint.lower if np.isinf(lower) else lower + margin,
        upper=constraint.upper if np.isinf(upper) else upper - margin,
    )
