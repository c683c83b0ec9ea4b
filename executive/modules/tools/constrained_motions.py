"""The process module for motions under constraints (KnowRob's ITaSCMotion): one phase of a recipe in each action.

It looks at the things that constraints are about, drives nearer where they are out of reach, moves the arms that hold
the tools, and checks in the end what holds. A vessel that ends upside down is held so until the amount has flowed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice, product

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.modules.arm.hand_work import HandWork
from executive.modules.phases import Phase
from executive.modules.platform import PlatformModule
from executive.modules.tools.motion_failures import out_of_reach
from executive.modules.tools.motion_grounding import UP, GroundedMotion, Grounding
from executive.modules.tools.pouring import Pouring
from executive.modules.tools.turning_over import check_flip
from executive.modules.tries import Tries
from executive.motion import MotionError
from executive.motion.constrained_ends import Ends
from executive.motion.constrained_motion import PhaseMotion, solve_motion
from executive.motion.constraint_functions import Bound, ConstraintFunctions
from executive.motion.errors import ConstraintsContradict, NoConstrainedPath
from executive.robots.arms import ArmModel
from planlang import checkpoint, perform
from planlang.designators import Action, Location, Object, action, snake_case
from planlang.failures import (
    ActionUnresolvable,
    AmountNotPoured,
    DesignatorFailure,
    LookingFailure,
    ManipulationFailure,
    NavigationFailure,
    NavigationPoseUnreachable,
    PerceptionFailure,
)
from planlang.geometry import Array, Pose
from planlang.kernel import compute_in_thread
from planlang.language.process_module import process_module
from planlang.motion_constraints import STANDING_FOR, ConstraintsUnsatisfied, Feature, MotionConstraint
from planlang.protocols import Trajectory

INSIDE = 1 / 3
"""Share of the width between limits that is left out on both sides at first: a motion ends well inside if it can."""
PLACES = 4
"""Places of the base from which a motion is tried."""
LOOKED_AT = 20
"""Places of the base from which it is computed whether the arms get there: one takes up to 1.5 s."""


Objection = Callable[[GroundedMotion, PhaseMotion], "AmountNotPoured | None"]
"""Returns the failure for which a motion is looked for elsewhere, None if it is as it should be."""


def no_objection(motion: GroundedMotion, found: PhaseMotion) -> None:
    """Return None: any motion will do."""


class ConstrainedWork(PlatformModule):
    """Motions under constraints, as several process modules make them: from where, and on which way."""

    failures: Sequence[type[Exception]] = (
        ManipulationFailure,
        NavigationFailure,
        PerceptionFailure,
        LookingFailure,
        DesignatorFailure,
    )

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the base, the torso and the arms of tools; the head is asked for by looking."""
        scene = self.platform.scene
        holders = [one.tool.held_by for one in constraints_of(action)]
        arms = {arm.name for held_by in holders for arm in (scene.arms.of(held_by) if held_by else scene.arms.all)}
        torso = [] if self.platform.robot.torso is None else ["torso"]
        return ("base", *torso, *(arm.name for arm in scene.arms.all if arm.name in arms))

    # Where from

    async def _solved(
        self, grounding: Grounding, asked: Sequence[MotionConstraint], phase: Phase, objection: Objection = no_objection
    ) -> tuple[GroundedMotion, PhaseMotion]:
        """Return the motion, from here or from a place to which the base is driven, where the phase before is made too.

        While something is being poured the base stays. Raises ConstraintsUnsatisfied, or an ``objection`` to a motion.
        """
        tries = Tries(ConstraintsUnsatisfied, NavigationFailure, AmountNotPoured)
        await self._look(grounding, asked, phase)
        motion = grounding.grounded(asked, phase)
        now = self.platform.base()
        here = phase.before or not self._is_mobile()
        if here or (
            self.platform.base_poses().is_at_ease(_middle(motion), motion.arms)
            and await compute_in_thread(partial(self._end, grounding, motion, now)) is not None
        ):
            with tries:
                return motion, await self._accepted(grounding, motion, phase, objection)
        tried, moves = 0, self._is_mobile() and not phase.pours
        for place in islice(self._places(motion), LOOKED_AT) if moves else ():
            if await compute_in_thread(partial(self._end, grounding, motion, place)) is None:
                continue
            with tries:
                if not await self._gone_to(grounding, asked, phase, place):
                    continue
                motion = grounding.grounded(asked, phase)
                return motion, await self._accepted(grounding, motion, phase, objection)
            if (tried := tried + 1) == PLACES:
                break
        if isinstance(tries.problem, NavigationFailure | AmountNotPoured):
            raise tries.problem
        if tried:
            await self._look(grounding, asked, phase)
            motion = grounding.grounded(asked, phase)
        # Ends of places hold all constraints: if there is none, the motion was not tried yet without lighter ones.
        last = self._way if tries.problem is None else self._just
        try:
            return motion, await compute_in_thread(partial(last, grounding, motion, phase, explains=True))
        except ConstraintsUnsatisfied as failure:
            if not moves or failure.blocked_by is not None or len(failure.constraints) != 1:
                raise
            does = partial(self._ends_somewhere, grounding, asked, phase)
            told = await compute_in_thread(partial(out_of_reach, self.platform, motion, does))
            said = "; ".join(filter(None, (failure.message, told)))
            raise ConstraintsUnsatisfied(said, arm=failure.arm, constraints=failure.constraints) from failure.__cause__

    def _ends_somewhere(self, grounding: Grounding, asked: Sequence[MotionConstraint], phase: Phase) -> bool:
        """Return whether there is a place of the base from which a motion ends, with things where they are believed."""
        motion = grounding.grounded(asked, replace(phase, things={}))
        return any(self._end(grounding, motion, place) is not None for place in islice(self._places(motion), PLACES))

    async def _accepted(
        self, grounding: Grounding, motion: GroundedMotion, phase: Phase, objection: Objection
    ) -> PhaseMotion:
        """Return the motion of a phase from here; raises ConstraintsUnsatisfied, or an objection to it."""
        found = await compute_in_thread(partial(self._way, grounding, motion, phase))
        if (problem := objection(motion, found)) is not None:
            raise problem
        return found

    async def _gone_to(
        self, grounding: Grounding, asked: Sequence[MotionConstraint], phase: Phase, place: BasePose
    ) -> bool:
        """Drive to a place and look, with the arms where the motion, or the phase before it, ends; False if none does.

        The phase before is made there, so that the motion begins as it is meant to.
        """
        first = phase.before or asked
        motion = grounding.grounded(first, phase)
        end = await compute_in_thread(partial(self._end, grounding, motion, place))
        if end is None:
            return False
        await self._get_ready(grounding, motion, end)
        await self.drive_with_room(place)
        await self._look(grounding, asked, phase)
        if phase.before:
            await self._once_more(grounding, phase)
        return True

    async def _once_more(self, grounding: Grounding, phase: Phase) -> None:
        """Make the phase before once more, from here."""
        motion, alone = grounding.grounded(phase.before, phase), replace(phase, before=())
        solved = await compute_in_thread(partial(self._way, grounding, motion, alone))
        await self.gone(motion, solved.trajectory)
        self._check_end(grounding, motion, solved)

    async def _get_ready(self, grounding: Grounding, motion: GroundedMotion, end: Array) -> None:
        """Bring the arms, one after another, to where they will be before the base goes there: here is more room."""
        columns = grounding.group(motion).columns
        waiting = list(zip(motion.arms, columns, strict=True))
        for _ in range(len(waiting)):
            for arm, own in tuple(waiting):
                found = await compute_in_thread(partial(self._path, arm, end[own]))
                if found is not None:
                    await self.platform.follow(f"{arm.name} getting ready", found)
                    waiting = [one for one in waiting if one[0] is not arm]

    async def drive_with_room(self, place: BasePose) -> None:
        """Drive, if need be with the arms tucked: one that is stretched out may be in the way as the base turns."""
        try:
            await self.drive(place)
        except NavigationPoseUnreachable:
            await HandWork(self.platform).tuck(self.platform.arms.untucked())
            await self.drive(place)

    def _path(self, arm: ArmModel, goal: Array) -> Trajectory | None:
        with suppress(MotionError):
            return self.platform.arms.path(arm, goal, iterations=SEARCHED)
        return None

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

    def _places(self, motion: GroundedMotion) -> Iterator[BasePose]:
        """Yield free places of the base before what the constraints are about, near ones first."""
        return self.platform.base_poses().before(_middle(motion), motion.arms, arms_first=True)

    def _end(self, grounding: Grounding, motion: GroundedMotion, base: BasePose) -> Array | None:
        """Return joint values (n,) at which constraints hold, from a base, and nothing is touched; None without.

        What may not lean stays upright there if it can.
        """
        upright = grounding.uprights(motion)
        for asked in dict.fromkeys(
            ((*_inside(motion.constraints, ()), *upright), (*motion.constraints, *upright), motion.constraints)
        ):
            end = next(self._ends(grounding, replace(motion, constraints=asked), base), None)
            if end is not None:
                return end
        narrow = Ends.of(grounding.problem(motion, base), self._start(motion), [(*motion.constraints, *upright)])
        with suppress(MotionError):  # limits that leave little room between bodies are searched together with these
            return next(replace(narrow, explains=False).found())[0]
        return None

    def _ends(self, grounding: Grounding, motion: GroundedMotion, base: BasePose) -> Iterator[Array]:
        """Yield joint values (n,) at which constraints hold, from a base, and nothing is touched.

        They are looked for arm by arm: each may have several ways to hold its tool.
        """
        problem, every = grounding.problem(motion, base, blocked=False), []
        for arm in range(len(motion.arms)):
            alone = motion.of_arm(arm)
            every.append(list(islice(self._ends_of(grounding, alone, base, self._start(alone), TRIES), WAYS)))
            if not every[-1]:
                return
        if len(every) == 1:
            yield from every[0]
            return
        for parts in product(*every):
            q = self._start(motion)
            for columns, part in zip(problem.group.columns, parts, strict=True):
                q[columns] = part
            yield from self._ends_of(grounding, motion, base, q, 1)

    def _ends_of(
        self, grounding: Grounding, motion: GroundedMotion, base: BasePose, start: Array, tries: int
    ) -> Iterator[Array]:
        problem = grounding.problem(motion, base, blocked=False)
        for q in Ends.of(problem, start, [motion.constraints]).reached(tries):
            if not grounding.touching(motion, q, base):
                yield q

    # The motion

    def _way(
        self, grounding: Grounding, motion: GroundedMotion, phase: Phase, *, explains: bool = False
    ) -> PhaseMotion:
        """Return the motion of the phase, as far inside of its limits as it gets; raises ConstraintsUnsatisfied."""
        self.platform.sync()
        before = grounding.grounded(phase.before, phase).constraints if phase.before else ()
        upright = grounding.uprights(motion)
        problem, start = grounding.problem(motion), self._start(motion)
        inside = _inside(motion.constraints, before)
        wishes = {one: wide for one, wide in zip(inside, motion.constraints, strict=True) if one != wide}
        for asked, wished in ((inside, {}), (motion.constraints, wishes)):
            with suppress(MotionError):
                phase_asked, kept = (*asked, *upright), (*before, *upright)
                (found,) = solve_motion(problem, start, [phase_asked], kept, wishes=wished, explains=False)
                return found
        return self._just(grounding, motion, phase, explains=explains)

    def _just(
        self, grounding: Grounding, motion: GroundedMotion, phase: Phase, *, explains: bool = False
    ) -> PhaseMotion:
        """Return the motion of the phase with nothing but what is asked; raises ConstraintsUnsatisfied.

        A smallest set of constraints that contradict each other is found if it explains, or if lighter ones may be
        given up: that takes longer than all the rest, and what is told in the end is asked for once.
        """
        self.platform.sync()
        before = grounding.grounded(phase.before, phase).constraints if phase.before else ()
        problem, differ = grounding.problem(motion), len({one.weight for one in motion.constraints}) > 1
        try:
            (found,) = solve_motion(
                problem, self._start(motion), [motion.constraints], before, explains=explains or differ
            )
        except MotionError as failure:
            raise unsatisfied(motion, failure) from failure
        return found

    async def gone(self, motion: GroundedMotion, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Move the arms of a motion; raises ManipulationGoalInCollision if something stops them."""
        await self.follow_to_end(" and ".join(arm.name for arm in motion.arms), trajectory, pushes=pushes)

    def _leaning(self, motion: GroundedMotion, solved: PhaseMotion) -> set[str]:
        """Return what the arms of a motion hold and the motion does not keep upright."""
        upright = {one.tool.of.iri for one in solved.kept if one.world.of == UP}
        arms, body = {arm.name for arm in motion.arms}, self.platform.scene.world.scene.body
        held = (name for name, grip in self.platform.belief.held.items() if grip.arm in arms)
        return {name for name in held if (body(name).iri or f"thing:{name}") not in upright}

    def _straightened(self) -> None:
        """Note which things stand as upright again as they have to."""
        self.platform.sync()
        world = self.platform.scene.world
        for name in tuple(self.platform.leaning):
            limit = world.scene.body(name).largest_tilt
            if limit is None or world.pose(name).rotation[2, 2] >= math.cos(limit):
                self.platform.leaning.discard(name)

    def taken(self) -> dict[str, Pose]:
        """Return where in the map each thing in a hand was grasped."""
        return {name: grip.before for name, grip in self.platform.belief.held.items()}

    def _start(self, motion: GroundedMotion) -> Array:
        """Return the joint values of the arms (n,), shared ones first met."""
        names = dict.fromkeys(name for arm in motion.arms for name in arm.joints)
        return self.platform.joints(tuple(names))

    def _check_end(self, grounding: Grounding, motion: GroundedMotion, solved: PhaseMotion) -> None:
        """Raise ConstraintsUnsatisfied for what does not hold where the arms are, but for what was given up."""
        given_up = {one.name for one in solved.given_up}
        asked = [one for one in motion.constraints if one.name not in given_up]
        problem = grounding.problem(motion, self.platform.base(), blocked=False)
        functions = ConstraintFunctions(problem.group, [Bound.of(one, problem.where) for one in asked])
        excess = functions.excess(functions.all_values(self._start(motion)[None])[0])
        outside = tuple(str(one.name or one) for one, beyond in zip(asked, excess, strict=True) if beyond > 1.0)
        if outside:
            raise ConstraintsUnsatisfied(arm=motion.arms[0].name, constraints=outside)


@process_module
class ConstrainedMotions(ConstrainedWork):
    """Moves one or more arms until constraints between features of tools and of the world hold."""

    name = "constrained_motion"
    actions = ("ITaSCMotion",)

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Move; return the names of constraints that heavier ones exclude. Without active ones nothing moves."""
        asked = [one for one in constraints_of(action) if one.is_active]
        phase = self.platform.phases.current()
        if not asked:
            phase.before = ()
            await checkpoint()
            return ()
        grounding = Grounding(self.platform)
        await self._taken_up(action, grounding, phase)
        pouring = Pouring(self.platform, phase)

        def objection(motion: GroundedMotion, found: PhaseMotion) -> AmountNotPoured | None:
            return pouring.too_slow(action, motion, grounding.group(motion), found.trajectory)

        motion, solved = await self._solved(grounding, asked, phase, objection)
        back = self._back(grounding, motion, phase) if phase.pours else None
        if back is not None:
            solved = min(
                (solved, back), key=lambda one: pouring.flowing(motion, grounding.group(motion), one.trajectory)
            )
        self.platform.arms.choices.choose(motion.arms[0].name)
        self.platform.leaning |= self._leaning(motion, solved)
        async with pouring.during(action, motion, grounding.group(motion), solved.trajectory):
            await self.gone(motion, solved.trajectory)
            self._check_end(grounding, motion, solved)
        self._straightened()
        phase.before, phase.taken, phase.way = tuple(asked), self.taken(), solved.trajectory.positions
        names, rows = grounding.world_things(asked), solved.trajectory.positions
        await check_flip(self.platform, motion, grounding.group(motion), rows, phase, names)
        return tuple(str(one.name) for one in solved.given_up)

    def _back(self, grounding: Grounding, motion: GroundedMotion, phase: Phase) -> PhaseMotion | None:
        """Return the motion of the phase before, backwards, if it does what this phase asks: its time was foreseen."""
        start = self._start(motion)
        if phase.way is None or phase.way.shape[1] != len(start) or np.abs(phase.way[-1] - start).max() > STRAY:
            return None
        rows = np.vstack([start, phase.way[-2::-1]])
        problem = grounding.problem(motion)
        functions = ConstraintFunctions(problem.group, [Bound.of(one, problem.where) for one in motion.constraints])
        if functions.excess(functions.all_values(rows[-1:])).max(initial=0.0) > 1.0 or problem.hits(rows[1:]):
            return None
        return PhaseMotion(Trajectory(problem.group.names, rows), (), ())

    async def _taken_up(self, action: Action, grounding: Grounding, phase: Phase) -> None:
        """Make the phase before once more if what it held was taken anew since: this one begins where that ends.

        Not so if that one turned a vessel over to pour: what has flowed has flowed, and this one begins anywhere.
        """
        taken = self.taken()
        tools = set(phase.tools.values()) & taken.keys() & phase.taken.keys()
        if all(phase.taken[name] == taken[name] for name in tools):
            return
        if any(pour.by != action.type for pour in phase.pours.values()):
            phase.before = ()
            return
        motion, solved = await self._solved(grounding, phase.before, replace(phase, before=(), pours={}))
        await self.gone(motion, solved.trajectory)
        self._check_end(grounding, motion, solved)
        phase.taken = taken


TRIES = 30
"""Beginnings from which it is looked whether constraints are within reach of a place."""
SEARCHED = 300
"""Branches that the search of a path to a posture grows: the base goes without it if there is none."""
STRAY = 1e-2
"""Distance of joints from where a motion ended up to which they are there [rad, m]."""
WAYS = 2
"""Ways to hold one tool that are tried together with those of another."""


def unsatisfied(motion: GroundedMotion, problem: MotionError) -> ConstraintsUnsatisfied:
    """Return the failure of a motion that cannot be made."""
    arm = motion.arms[0].name
    if not isinstance(problem, ConstraintsContradict | NoConstrainedPath):
        return ConstraintsUnsatisfied(str(problem), arm=arm)
    names = tuple(str(one.name or one) for one in problem.constraints)
    blocking = next((body for _, body in problem.pairs), None)
    return ConstraintsUnsatisfied(str(problem).partition(": ")[2], arm=arm, blocked_by=blocking, constraints=names)


def constraints_of(action: Action) -> tuple[MotionConstraint, ...]:
    """Return the constraints of an action, about what it acts on; raises ActionUnresolvable if it does not say what."""
    stated = action.get("constrained_by")
    every = stated if isinstance(stated, tuple) else (stated,)
    return tuple(
        replace(one, tool=_about(one.tool, action), world=_about(one.world, action))
        for one in every
        if isinstance(one, MotionConstraint)
    )


def _about(feature: Feature, action: Action) -> Feature:
    """Return a feature of the thing that the action names, if the feature's thing stands for that."""
    if feature.of.type not in STANDING_FOR:
        return feature
    role = snake_case(STANDING_FOR[feature.of.type])
    filler = action.get(role)
    parts = (one.reference for one in filler.relations) if isinstance(filler, Location) else (filler,)
    what = next((one for one in parts if isinstance(one, Object)), None)
    if what is None:
        raise ActionUnresolvable(f"a motion about {feature} needs {role}", designator=str(action))
    return replace(feature, of=what)


def _middle(motion: GroundedMotion) -> Array:
    """Return the middle of what a motion is about in the map (2,)."""
    return np.asarray(np.mean([pose[:2, 3] for pose in motion.things.values()], axis=0))


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
