"""Process module for motions under constraints (KnowRob's ITaSCMotion): each action is one phase of a recipe.

It looks at the objects of the constraints, drives nearer if they are out of reach, moves the arms that hold the tools,
and checks the constraints at the end. A vessel that ends upside down is held there until the amount has flowed.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice, product

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations import Rejections
from executive.locations.changes import Changes
from executive.locations.shut_ways import check_way_to
from executive.modules.arm.hand_work import HandWork
from executive.modules.phases import Phase
from executive.modules.platform import Platform
from executive.modules.runner import Skill, nothing
from executive.modules.tools.motion_grounding import UP, GroundedMotion, Grounding, constraints_of
from executive.modules.tools.pouring import Pouring
from executive.modules.tools.turning_over import check_flip
from executive.motion import MotionError
from executive.motion.constrained_ends import Ends
from executive.motion.constrained_motion import PhaseMotion, solve_motion
from executive.motion.constraint_functions import Bound, ConstraintFunctions
from executive.motion.errors import ConstraintsContradict, NoConstrainedPath
from executive.robots.arms import ArmModel, too_far
from planlang.advice import Advice
from planlang.designators import Action, action
from planlang.failures import (
    AmountNotPoured,
    LookingFailure,
    NavigationFailure,
    NavigationPoseUnreachable,
    PerceptionFailure,
    PlanFailure,
)
from planlang.geometry import Array, Pose
from planlang.kernel import checkpoint, compute_in_thread
from planlang.language.performing import perform
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied, MotionConstraint
from planlang.protocols import Group, GroupKind, Trajectory

INSIDE = 1 / 3
"""Margin on both sides within limits that is tried first, as a share of their width: motions end well inside."""
PLACES = 4
"""Base poses from which to try whether a motion would be possible if its object stood elsewhere."""
LOOKED_AT = 20
"""Base poses from which to compute whether the arms reach the goal: one takes up to 1.5 s."""


Objection = Callable[[GroundedMotion, PhaseMotion], "AmountNotPoured | None"]
"""Returns the failure for which a motion from here is rejected; None to accept it."""


def no_objection(motion: GroundedMotion, solved: PhaseMotion) -> None:
    """Accept any motion."""


class ConstrainedWork(HandWork):
    """Base of the process modules for motions under constraints: choice of the base pose, and solution."""

    def resources(self, action: Action) -> tuple[str, ...]:
        """List the base, the torso and the arms that may hold the tools; looking requests the head itself."""
        scene = self.platform.scene
        holders = [one.tool.held_by for one in constraints_of(action)]
        arms = {arm.name for held_by in holders for arm in (scene.arms.of(held_by) if held_by else scene.arms.all)}
        torso = [] if self.platform.robot.torso is None else ["torso"]
        return ("base", *torso, *(arm.name for arm in scene.arms.all if arm.name in arms))

    # Base poses

    async def _solved(
        self, grounding: Grounding, objection: Objection = no_objection
    ) -> tuple[GroundedMotion, PhaseMotion]:
        """Solve the motion from here, or drive to where it can be solved and repeat the phase before there.

        The base does not move while a vessel is turned over. Raises ConstraintsUnsatisfied, a NavigationFailure, or the
        failure of ``objection``.
        """
        here, moves, unsolved = self.platform.base(), self._is_mobile(), ConstraintsUnsatisfied()
        phase = grounding.phase
        await self._look(grounding)

        async def solved(_: object) -> tuple[GroundedMotion, PhaseMotion]:
            motion = grounding.grounded()
            found = await compute_in_thread(partial(self._solve, grounding, motion))
            if (problem := objection(motion, found)) is not None:
                # ends just inside the limits: a vessel is turned over less far, and flows for less time
                found = await compute_in_thread(partial(self._solve_plain, grounding, motion))
                if objection(motion, found) is not None:
                    raise problem
            return motion, found

        async def otherwise(problem: PlanFailure | None, tried: int) -> PlanFailure:
            return problem or unsolved

        try:
            return await Skill(
                partial(self._places, grounding),
                solved,
                approach=lambda place: self._prepare_at(grounding, *place) if place[0] != here else nothing(),
                failures=(ConstraintsUnsatisfied, NavigationFailure, AmountNotPoured),
                otherwise=otherwise,
            ).run()
        except ConstraintsUnsatisfied as problem:
            # _end requires all constraints: if no base pose satisfies them, the motion is yet to be tried with fewer.
            last = self._solve if problem is unsolved else self._solve_plain
        await self._look(grounding)
        motion = grounding.grounded()
        try:
            return motion, await compute_in_thread(partial(last, grounding, motion, explains=True))
        except ConstraintsUnsatisfied as failure:
            if not moves or self._is_pouring(phase) or failure.blocked_by is not None or len(failure.constraints) != 1:
                raise
            possible = partial(self._ends_somewhere, grounding)
            reason, advice = await compute_in_thread(partial(_out_of_reach, self.platform, motion, possible))
            said = (failure.message, reason, None if advice is None else advice.sentence)
            raise ConstraintsUnsatisfied(
                "; ".join(filter(None, said)),
                arm=failure.arm,
                constraints=failure.constraints,
                changes=() if advice is None else advice.changes,
            ) from failure.__cause__

    async def _places(self, grounding: Grounding) -> AsyncIterator[tuple[BasePose, Array | None]]:
        """Yield base poses with an end of the motion: the present one first, if the arms need not stretch there.

        With each other base pose, the joint positions (n,) at the end of the first motion to be made there, which may
        be that of the phase before.
        """
        motion, here, phase = grounding.grounded(), self.platform.base(), grounding.phase
        at_ease = self.platform.standing().is_at_ease(_middle(motion), motion.arms)
        if phase.before or not self._is_mobile() or (at_ease and await self._end_at(grounding, here) is not None):
            yield here, None
        for place in islice(self._free(motion), LOOKED_AT) if self._is_mobile() and not self._is_pouring(phase) else ():
            end = await self._end_at(grounding, place)
            if end is not None and phase.before:
                end = await self._end_at(grounding.before(), place)
            if end is not None:
                yield place, end

    def _is_pouring(self, phase: Phase) -> bool:
        """Check whether a vessel that is being poured from is turned over."""
        return any(flow.name in phase.pours and flow.turned[-1] for flow in self.platform.flowing.flows())

    def _ends_somewhere(self, grounding: Grounding, scene: PlanningScene) -> bool:
        """Check whether the goal can be reached from any of the first base poses in a scene that is supposed."""
        supposed, grounding = self.supposing(scene), grounding.supposing(scene)
        motion = grounding.grounded()
        return any(supposed._end(grounding, motion, place) is not None for place in islice(self._free(motion), PLACES))

    async def _prepare_at(self, grounding: Grounding, place: BasePose, end: Array | None) -> None:
        """Move the arms to joint positions ``end`` (n,), drive to ``place``, and look.

        The phase before is repeated there, so that the motion begins as intended.
        """
        first = grounding.before() if grounding.phase.before else grounding
        if end is not None:
            await self._pose_arms(first, first.grounded(), end)
        await self.drive_with_room(place)
        await self._look(grounding)
        if grounding.phase.before:
            motion = first.grounded()
            solved = await compute_in_thread(partial(self._solve, first, motion))
            await self.gone(motion, solved.trajectory)
            self._check_end(first, motion, solved)

    async def _pose_arms(self, grounding: Grounding, motion: GroundedMotion, end: Array) -> None:
        """Move the arms one after another to joint positions ``end`` (n,) before driving, while there is more room."""
        columns = grounding.group(motion).columns
        pending = list(zip(motion.arms, columns, strict=True))
        for _ in range(len(pending)):  # moving one arm may make room for the other
            for arm, own in tuple(pending):
                trajectory = await compute_in_thread(partial(self._path, arm, end[own]))
                if trajectory is not None:
                    await self.platform.follow(f"{arm.name} getting ready", trajectory)
                    pending = [one for one in pending if one[0] is not arm]

    async def drive_with_room(self, place: BasePose) -> None:
        """Drive to a base pose; if that fails, tuck the arms first, since an extended arm needs room to turn."""
        try:
            await self.drive(place)
        except NavigationPoseUnreachable:
            await self.tuck()
            await self.drive(place)

    def _path(self, arm: ArmModel, goal: Array) -> Trajectory | None:
        with suppress(MotionError):
            return self.platform.arms.path(arm, goal, iterations=SEARCHED)
        return None

    def _is_mobile(self) -> bool:
        return not self.platform.robot.base.fixed

    async def _look(self, grounding: Grounding) -> None:
        """Look at world objects not seen since the base moved, and note first poses. Raises BehindClosedDoor.

        A vessel that is being poured from is turned back at once: more would flow while the camera turns.
        """
        belief, phase = self.platform.belief, grounding.phase
        if self._is_pouring(phase):
            return
        for name in grounding.world_things():
            if name in phase.things or name in belief.held:
                continue
            if not belief.seen_from_here(name):
                check_way_to(self.platform.scene, name)
                with suppress(PerceptionFailure, LookingFailure):
                    bind = self.platform.scene.bodies.bind
                    what = next(one.world.of for one in grounding.constraints if bind(one.world.of) == name)
                    await perform(action("LookingForSomething", object_acted_on=what))
            if belief.seen_from_here(name) or self.platform.robot.camera is None:
                phase.things[name] = belief.pose(name)

    def _free(self, motion: GroundedMotion) -> Iterator[BasePose]:
        """Yield free base poses in front of the objects of the constraints, near ones first."""
        return self.platform.standing().before(_middle(motion), motion.arms, arms_first=True)

    async def _end_at(self, grounding: Grounding, base: BasePose) -> Array | None:
        return await compute_in_thread(partial(self._end, grounding, grounding.grounded(), base))

    def _end(self, grounding: Grounding, motion: GroundedMotion, base: BasePose) -> Array | None:
        """Find collision-free joint positions (n,) that satisfy the constraints from a base pose; None without any.

        Tools that must not tilt stay upright if possible.
        """
        upright = grounding.uprights(motion)
        for constraints in dict.fromkeys(
            ((*_inside(motion.constraints, ()), *upright), (*motion.constraints, *upright), motion.constraints)
        ):
            end = next(self._ends(grounding, replace(motion, constraints=constraints), base), None)
            if end is not None:
                return end
        narrow = Ends.of(grounding.problem(motion, base), self._start(motion), [(*motion.constraints, *upright)])
        with suppress(MotionError):  # tight limits between bodies: solve for constraints and collisions together
            return next(replace(narrow, explains=False).found())[0]
        return None

    def _ends(self, grounding: Grounding, motion: GroundedMotion, base: BasePose) -> Iterator[Array]:
        """Yield collision-free joint positions (n,) that satisfy the constraints from a base pose.

        Solves for each arm alone, then combines the solutions of several arms.
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

    def _solve(self, grounding: Grounding, motion: GroundedMotion, *, explains: bool = False) -> PhaseMotion:
        """Solve the motion of the phase, as far inside its limits as possible. Raises ConstraintsUnsatisfied."""
        before, upright = grounding.before().grounded().constraints, grounding.uprights(motion)
        problem, start = grounding.problem(motion), self._start(motion)
        inside = _inside(motion.constraints, before)
        wishes = {one: wide for one, wide in zip(inside, motion.constraints, strict=True) if one != wide}
        for constraints, wished in ((inside, {}), (motion.constraints, wishes)):
            with suppress(MotionError):
                at_end, on_path = (*constraints, *upright), (*before, *upright)
                (solved,) = solve_motion(problem, start, [at_end], on_path, wishes=wished, explains=False)
                return solved
        return self._solve_plain(grounding, motion, explains=explains)

    def _solve_plain(self, grounding: Grounding, motion: GroundedMotion, *, explains: bool = False) -> PhaseMotion:
        """Solve the motion of the phase with its stated constraints only. Raises ConstraintsUnsatisfied.

        A minimal set of contradicting constraints is computed only with ``explains``, for the final failure, or if
        constraints of less weight may be dropped, because that takes longer than all the rest.
        """
        before = grounding.before().grounded().constraints
        problem, differ = grounding.problem(motion), len({one.weight for one in motion.constraints}) > 1
        try:
            (solved,) = solve_motion(
                problem, self._start(motion), [motion.constraints], before, explains=explains or differ
            )
        except MotionError as failure:
            raise unsatisfied(motion, failure) from failure
        return solved

    async def gone(self, motion: GroundedMotion, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Move the arms of a motion along a trajectory. Raises ManipulationGoalInCollision if they are stopped."""
        await self.follow_to_end(Group(GroupKind.ARMS, *(arm.name for arm in motion.arms)), trajectory, pushes=pushes)

    def _leaning(self, motion: GroundedMotion, solved: PhaseMotion) -> set[str]:
        """Collect the objects in the arms of a motion that it does not keep upright."""
        upright = {one.tool.of.iri for one in solved.kept if one.world.of == UP}
        arms, body = {arm.name for arm in motion.arms}, self.platform.scene.world.scene.body
        held = (name for name, grip in self.platform.belief.held.items() if grip.arm in arms)
        return {name for name in held if (body(name).iri or f"thing:{name}") not in upright}

    def _straightened(self) -> None:
        """Remove objects from ``platform.leaning`` that are within their tilt limits again."""
        world = self.platform.scene.world
        for name in tuple(self.platform.leaning):
            limit = world.scene.body(name).largest_tilt
            if limit is None or world.pose(name).rotation[2, 2] >= math.cos(limit):
                self.platform.leaning.discard(name)

    def taken(self) -> dict[str, Pose]:
        """Map each held object to its pose in the map when it was grasped."""
        return {name: grip.before for name, grip in self.platform.belief.held.items()}

    def _start(self, motion: GroundedMotion) -> Array:
        """Read the joint positions of the arms (n,), shared joints once, in the order of the arms."""
        names = dict.fromkeys(name for arm in motion.arms for name in arm.joints)
        return self.platform.joints(tuple(names))

    def _check_end(self, grounding: Grounding, motion: GroundedMotion, solved: PhaseMotion) -> None:
        """Raise ConstraintsUnsatisfied if a constraint that was not dropped is violated where the arms are now."""
        given_up = {one.name for one in solved.given_up}
        constraints = [one for one in motion.constraints if one.name not in given_up]
        problem = grounding.problem(motion, self.platform.base(), blocked=False)
        functions = ConstraintFunctions(problem.group, [Bound.of(one, problem.where) for one in constraints])
        excess = functions.excess(functions.all_values(self._start(motion)[None])[0])
        outside = tuple(str(one.name or one) for one, beyond in zip(constraints, excess, strict=True) if beyond > 1.0)
        if outside:
            raise ConstraintsUnsatisfied(arm=motion.arms[0].name, constraints=outside)


@process_module
class ConstrainedMotions(ConstrainedWork):
    """Moves one or more arms until the constraints between features of tools and of the world are satisfied."""

    name = "constrained_motion"
    actions = ("ITaSCMotion",)

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Make the motion of a phase; return the names of constraints dropped in favour of those of more weight.

        Without active constraints, nothing moves. Raises failures of the classes in ``failures``.
        """
        constraints = [one for one in constraints_of(action) if one.is_active]
        phase = self.platform.phases.current()
        if not constraints:
            phase.before = ()
            await checkpoint()
            return ()
        grounding, pouring = Grounding(self.platform, constraints, phase), Pouring(self.platform, phase)
        await self._resume_phase(action, pouring)
        if pouring.is_done(action):
            phase.before = ()
            return ()
        return await self._moved(action, grounding, pouring)

    async def _moved(self, action: Action, grounding: Grounding, pouring: Pouring) -> tuple[str, ...]:
        """Make a motion from where the phase before ended, and pour; return the names of constraints dropped."""
        phase = grounding.phase

        def objection(motion: GroundedMotion, solved: PhaseMotion) -> AmountNotPoured | None:
            return pouring.too_slow(action, motion, solved.trajectory)

        motion, solved = await self._reversed(grounding) or await self._solved(grounding, objection)
        self.platform.arms.choices.choose(motion.arms[0].name)
        self.platform.leaning |= self._leaning(motion, solved)
        async with pouring.during(action, motion, solved.trajectory):
            await self.gone(motion, solved.trajectory)
            self._check_end(grounding, motion, solved)
        self._straightened()
        phase.before, phase.taken, phase.path = grounding.constraints, self.taken(), solved.trajectory.positions
        names, rows = grounding.world_things(), solved.trajectory.positions
        await check_flip(self.platform, motion, grounding.group(motion), rows, phase, names)
        return tuple(str(one.name) for one in solved.given_up)

    async def _reversed(self, grounding: Grounding) -> tuple[GroundedMotion, PhaseMotion] | None:
        """Reverse the motion of the phase before, if a vessel is being poured from and that satisfies this phase.

        Its flow has been predicted already, and a path that was found once need not be found again.
        """
        start, path = self._start(grounding.grounded()), grounding.phase.path
        if not grounding.phase.pours or path is None or path.shape[1] != len(start):
            return None
        if np.abs(path[-1] - start).max() > STRAY:
            return None
        await self._look(grounding)
        motion, rows = grounding.grounded(), np.vstack([start, path[-2::-1]])
        problem = grounding.problem(motion)
        functions = ConstraintFunctions(problem.group, [Bound.of(one, problem.where) for one in motion.constraints])
        if functions.excess(functions.all_values(rows[-1:])).max(initial=0.0) > 1.0 or problem.hits(rows[1:]):
            return None
        return motion, PhaseMotion(Trajectory(problem.group.names, rows), (), ())

    async def _resume_phase(self, action: Action, pouring: Pouring) -> None:
        """Repeat the phase before if its tools have been grasped anew since, because this phase begins at its end.

        After a pour only the rest is poured; if there is none, this phase begins anywhere.
        """
        taken, phase = self.taken(), pouring.phase
        tools = set(phase.tools.values()) & taken.keys() & phase.taken.keys()
        if all(phase.taken[name] == taken[name] for name in tools):
            return
        poured = [pour for pour in phase.pours.values() if pour.by.type != action.type]
        if poured:
            phase.before = poured[0].over
        if poured and pouring.is_done(poured[0].by):
            phase.before = ()
        if phase.before:
            first = Grounding(self.platform, phase.before, replace(phase, before=(), pours={}))
            motion, solved = await self._solved(first)
            await self.gone(motion, solved.trajectory)
            self._check_end(first, motion, solved)
        phase.taken = taken
        if poured and not pouring.is_done(poured[0].by):
            again = [one for one in constraints_of(poured[0].by) if one.is_active]
            await self._moved(poured[0].by, Grounding(self.platform, again, phase), pouring)


TRIES = 30
"""Starts of the solver for checking whether constraints can be satisfied from a base pose."""
SEARCHED = 300
"""Iterations of the path search to a posture before driving; without a path, the base drives anyway."""
STRAY = 1e-2
"""Tolerance within which joints are still where a motion ended [rad, m]."""
WAYS = 2
"""Solutions of each arm to combine with those of the others."""


def unsatisfied(motion: GroundedMotion, problem: MotionError) -> ConstraintsUnsatisfied:
    """Convert a planning error to the failure of a motion."""
    arm = motion.arms[0].name
    if not isinstance(problem, ConstraintsContradict | NoConstrainedPath):
        return ConstraintsUnsatisfied(str(problem), arm=arm)
    names = tuple(dict.fromkeys(str(one.name or one) for one in problem.constraints))
    blocking = next((body for _, body in problem.pairs), None)
    return ConstraintsUnsatisfied(str(problem).partition(": ")[2], arm=arm, blocked_by=blocking, constraints=names)


def _middle(motion: GroundedMotion) -> Array:
    """Compute the mean position (2,) in the map of the world objects of a motion."""
    return np.asarray(np.mean([pose[:2, 3] for pose in motion.things.values()], axis=0))


def _inside(
    constraints: Sequence[MotionConstraint], before: Sequence[MotionConstraint]
) -> tuple[MotionConstraint, ...]:
    """Narrow the limits of constraints, except for those of the phase before, which hold throughout the motion."""
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


def _out_of_reach(
    platform: Platform, motion: GroundedMotion, does: Callable[[PlanningScene], bool]
) -> tuple[str, Advice | None]:
    """Describe how near a shoulder gets to the first movable object of a motion, and where that would have to stand.

    ``does``: predicate whether the motion is possible from some base pose in a scene that is supposed. Returns "" and
    None for a motion without a movable object.
    """
    bodies, arm = platform.scene.bodies, motion.arms[0]
    objects = ((bodies.bind(one), pose[:2, 3]) for one, pose in motion.things.items())
    first = next((one for one in objects if bodies.is_movable(one[0]) and bodies.support(one[0]) is not None), None)
    if first is None:
        return "", None
    name, position = first
    distance = platform.standing().distances([position[None]], motion.arms)[0]
    reason = too_far(arm, name, distance)
    return reason, Changes(name, platform.scene, Rejections(), does).nearer()
