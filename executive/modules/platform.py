"""The robot as process modules command it: motions in the true world, planned in the planning scene.

The arms of a platform: which one is used, where it is, and its paths. Where a plan leaves the choice of the arm, it is
made once in each strand of the run, and kept there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.locations import HandSolution, Reach, ReachKind, Resolver
from executive.locations.base_poses import BasePoses
from executive.locations.demands import asks_for
from executive.locations.grasp_candidates import HandPoses
from executive.locations.likely_places import Searches
from executive.modules.carrying import is_near, upright_postures
from executive.modules.commanding import Control, Hands, Sensing
from executive.modules.drive import Drive
from executive.modules.phases import Phases
from executive.motion import JointSpace, MotionError, cartesian_path, keeps_line, plan_path, time_curve, time_path
from executive.motion.upright import Upright
from executive.robots import CARRYING
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang import perform
from planlang.designators import Action, FixedPose, Location, Object, action
from planlang.failures import ActionUnresolvable, ManipulationGoalInCollision
from planlang.geometry import Array, Pose, matrices
from planlang.kernel import Task
from planlang.language.branches import concurrent_branches
from planlang.protocols import MotionState, Trajectory
from planlang.records import dataclass
from planlang.relations import Sense

if TYPE_CHECKING:
    from executive.locations.next_view import Exploration

ALONE = ""
"""The branch where no plan is running."""
ITERATIONS = 1000
"""Branches that the search of a path grows before it gives up."""
SHARE = 0.8
"""Share of the largest tilt of what is held to which paths keep, as they are checked at some places only."""
HAIR = 1e-6
"""More than rounding [rad]."""
AT_PLACE = 0.01
"""Difference of the tip's pose from that at which it puts something down, up to which it retreats from there [m, 1]."""
CLOSE = 0.05
"""Share of the resolution of checks by which an arm moves from one exact check in time to the next: a torso is slow."""
MOST = 256
"""Choices that are remembered; branches that have ended are forgotten first."""


@dataclass(frozen=True, slots=True)
class _Choice:
    arm: str
    branch: Task | None
    """None if it was read from a snapshot, or no plan is running."""

    @property
    def over(self) -> bool:
        return self.branch is not None and self.branch.dead


@dataclass(slots=True)
class ArmChoices:
    """Branch -> the arm that was chosen in it last.

    Two branches that go on side by side may use two arms. A branch without a choice goes on with that of what has ended
    inside of it, else with that of the branch around it, and leaves arms alone that others have chosen.
    """

    made: dict[str, _Choice] = field(default_factory=dict)
    """In the order of the last choices; by path."""

    def choose(self, arm: str) -> None:
        """Record that the running branch uses this arm from now on."""
        mine = next(iter(concurrent_branches()), None)
        path = ALONE if mine is None else mine.path
        self.made.pop(path, None)
        self.made[path] = _Choice(arm, mine)
        if len(self.made) > MOST:
            ended = (name for name, choice in self.made.items() if choice.over)
            del self.made[next(ended, next(iter(self.made)))]

    def mine(self) -> str | None:
        """Return the arm of the branch that runs, None while there is no choice."""
        around = [branch.path for branch in concurrent_branches()] or [ALONE]
        if around[0] in self.made:
            return self.made[around[0]].arm
        inner = [c.arm for path, c in self.made.items() if c.over and _inside(path, around[0])]
        if inner:
            return inner[-1]
        return next((self.made[path].arm for path in around[1:] if path in self.made), None)

    def others(self) -> frozenset[str]:
        """Return the arms that branches beside the one that runs have chosen and may be in the middle of using."""
        around = [branch.path for branch in concurrent_branches()] or [ALONE]
        beside = (
            choice.arm
            for path, choice in self.made.items()
            if not choice.over and path not in around and not _inside(path, around[0])
        )
        return frozenset(beside) - {self.mine()}


def _inside(path: str, outer: str) -> bool:
    return path.startswith(f"{outer}/") if outer else path != outer


def _apart(rows: Array, step: Array) -> list[int]:
    """Return the numbers of rows (n, d) of joint values that differ by a step (d,) in some joint, and of the last."""
    kept = [0] if len(rows) else []
    for number in range(1, len(rows)):
        if number == len(rows) - 1 or bool((np.abs(rows[number] - rows[kept[-1]]) >= step).any()):
            kept.append(number)
    return kept


class Arms:
    """Chooses arms and plans their motions. ``rng`` feeds the path planner."""

    def __init__(self, control: Control, rng: np.random.Generator) -> None:
        self._control, self._rng = control, rng
        self.choices = ArmChoices()
        """Arms that were chosen where the plan left the choice."""
        self.begun: dict[str, tuple[int, BasePose, HandSolution]] = {}
        """Arm -> belief revision, base pose and the solution that it is in the middle of."""

    # Which arm

    def in_order(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """Return arms, the one chosen before first, those that other strands of the plan use last."""
        mine, others = self.choices.mine(), self.choices.others()
        return sorted(arms, key=lambda arm: (arm.name != mine, arm.name in others))

    def holding(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """Return the arms that hold something for this strand of the plan, the last chosen first."""
        others = self.choices.others()
        return [
            arm for arm in self.in_order(arms) if self._control.scene.arms.held(arm.name) and arm.name not in others
        ]

    def free(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """Return the arms that hold nothing, in the order of :meth:`in_order`."""
        return [arm for arm in self.in_order(arms) if self._control.scene.arms.held(arm.name) is None]

    def use(self, arm: ArmModel, solution: HandSolution) -> None:
        """Remember which arm was chosen, and the grasp that it has begun, or how it puts something down."""
        self.choices.choose(arm.name)
        if solution.reach.kind in (ReachKind.GRASP, ReachKind.PLACE):
            self.begun[arm.name] = (self._control.belief.revision, self._control.base(), solution)

    def begun_grasp(self, arm: ArmModel, location: Location) -> HandSolution | None:
        """Return what the arm goes on with, if the location asks for it and nothing has changed.

        After the pre-grasp that is the grasp, after something was put down the retreat from it.
        """
        if arm.name not in self.begun:
            return None
        revision, base, solution = self.begun[arm.name]
        goes_on = Sense.PRE_GRASP if solution.reach.kind is ReachKind.RETREAT else Sense.GRASP_POINT
        if not asks_for(location, "hand", goes_on):
            return None
        meant = [
            self._control.scene.bodies.bind(r.reference) for r in location.relations if isinstance(r.reference, Object)
        ]
        current = revision == self._control.belief.revision and base == self._control.base()
        return solution if current and solution.reach.body in meant else None

    def opening(self, arm: ArmModel) -> Fingers:
        """Return how far a hand opens: as what it holds, or is about to grasp, asks for; else as far as it goes."""
        control = self._control
        if control.scene.arms.held(arm.name) is not None:
            return arm.openings.beyond(control.scene.world.configuration().joints)
        revision, base, solution = self.begun.get(arm.name, (-1, None, None))
        if solution is None or (revision, base) != (control.belief.revision, control.base()):
            return arm.openings.widest
        return solution.plan.fingers or arm.openings.widest

    def put_down(self, arm: ArmModel, what: str) -> None:
        """Begin to retreat from what the arm has just put down."""
        _, base, solution = self.begun.get(arm.name, (0, (0.0, 0.0, 0.0), None))
        if solution is None or solution.reach.kind is not ReachKind.PLACE:
            return
        if np.abs(self._control.scene.arms.tip(arm) - solution.plan.poses[1]).max() > AT_PLACE:
            return
        plan = HandPoses(f"retreat from {what}", solution.plan.poses[2:], what)
        retreat = HandSolution(Reach(ReachKind.RETREAT, what), arm, plan, solution.joints[2:])
        self.begun[arm.name] = (self._control.belief.revision, base, retreat)

    # Where it is

    def is_at(self, arm: ArmModel, q: Array) -> bool:
        """Return whether the arm is at joint positions (d,), to a milliradian or millimetre."""
        return bool(np.allclose(self._control.arm_joints(arm), q, atol=1e-3))

    def posture(self, arm: ArmModel, name: str) -> Array:
        """Return the joint positions (d,) of a named posture; joints that it does not name stay.

        A name that contains that of a posture means it ("parkingpose"), any other one the carrying posture. Raises
        ActionUnresolvable if the robot has no such posture.
        """
        robot = self._control.robot
        known = robot.postures
        meant = name if name in known else next((one for one in known if one in name.lower()), CARRYING)
        if meant not in known:
            message = f"{robot.name} has no posture {name}; it has {', '.join(known) or 'none'}"
            raise ActionUnresolvable(message, designator=f"posture {name}")
        now = zip(arm.joints, self._control.arm_joints(arm), strict=True)
        return np.array([known[meant].get(joint, value) for joint, value in now])

    def postures(self, arm: ArmModel, name: str) -> list[Array]:
        """Return joint positions (d,) for a named posture, the best first: such that what is held stays upright.

        Raises ActionUnresolvable as :meth:`posture` does; none are left if nothing near it keeps upright what is held.
        """
        named, held = self.posture(arm, name), self._control.scene.arms.held(arm.name)
        if held is None or held.largest_tilt is None:
            return [named]
        self._control.sync()
        return upright_postures(self._control, arm, held, named)

    def untucked(self) -> list[tuple[ArmModel, Array]]:
        """Return the arms that are not in the carrying posture, each with its joint positions there (d,).

        The height of a torso that arms share does not count: what one of them holds may need another.
        """
        there = self._control.scene.arms
        arms = [arm for arm in there.all if not there.mates(arm.name) and not self._is_tucked(arm)]
        postures = [(arm, self.postures(arm, CARRYING)) for arm in arms]
        return [(arm, qs[0]) for arm, qs in postures if qs]

    def _is_tucked(self, arm: ArmModel) -> bool:
        q, named, held = (
            self._control.arm_joints(arm),
            self.posture(arm, CARRYING),
            self._control.scene.arms.held(arm.name),
        )
        if held is not None and held.largest_tilt is not None:
            return is_near(arm, held, named, q)
        away = np.abs(q - named)
        return bool((away if arm.lift is None else np.delete(away, arm.lift.column)).max() <= 1e-3)

    # Where it can go

    def path(
        self,
        arm: ArmModel,
        goal: Array,
        touches: str | None = None,
        iterations: int = ITERATIONS,
        others: Sequence[Array] = (),
    ) -> Trajectory:
        """Return a timed path to joint positions (d,), or to ``others``, through the planning scene.

        Raises a MotionError. The hand may touch the body ``touches``. With few ``iterations`` it gives up early. What
        is held stays upright if it has to.
        """
        control = self._control
        control.sync()
        chain, base, start = arm.solver.chain, control.base(), control.arm_joints(arm)
        space = JointSpace.of(arm.lower, arm.upper, continuous=chain.continuous, resolution=arm.resolution)
        quick = control.scene.collisions.quick_check(arm, touches)

        def touching(q: Array, among: Sequence[tuple[str, str]] | None) -> list[tuple[str, str]]:
            # At the start the whole robot is checked; later what stands still cannot touch anything new.
            contacts = control.scene.collisions.contacts(base, arm, q, touches, among=among)
            return [(contact.part, contact.body) for contact in contacts]

        def moments(path: Array) -> Array:
            """Return where the arm is checked exactly: at the resolution of checks, and in time along its curve."""
            rows = control.timed(arm.joints, path).positions[1:]
            return np.concatenate([space.points(path), rows[_apart(rows, CLOSE * arm.resolution)]])

        upright = self.upright(arm, goal)
        found = plan_path(
            start,
            goal,
            space,
            quick,
            touching,
            self._rng,
            moments=moments,
            others=others,
            constraint=upright,
            iterations=iterations,
        )
        if upright is not None and len(found) > 2:  # a curve does not stop at each of many waypoints
            curve = control.timed(arm.joints, found, time_curve)
            rows = curve.positions[1:]
            holds = chain.within(rows, 1e-6).all() and upright.holds(rows).all()
            if holds and not any(map(touching, rows, quick.doubtful(rows))):
                return curve
        return control.timed(arm.joints, found)

    def upright(self, arm: ArmModel, goal: Array) -> Upright | None:
        """Return how upright an arm keeps what it holds on its way to joint positions (d,); None if it need not.

        Where it leans more at the start, as after pouring, or is to at the goal, it may on the way.
        """
        held = self._control.scene.arms.held(arm.name)
        if held is None or held.largest_tilt is None:
            return None
        usual = Upright(arm.solver.chain, held.up, SHARE * held.largest_tilt)
        ends = usual.tilts(np.stack([self._control.arm_joints(arm), goal]))
        return replace(usual, limit=max(usual.limit, float(ends.max()) + HAIR))

    def drawn(self, arm: ArmModel, ways: Iterable[Array], touches: str | None) -> Trajectory | None:
        """Return the first straight line of the tip along one of some ways (3,) [m]; None if none is free."""
        for way in ways:
            pose = self._control.scene.arms.tip(arm).copy()
            pose[:3, 3] += way
            with suppress(MotionError):
                return self.straight_path(arm, pose, self._control.arm_joints(arm), touches)
        return None

    def straight_path(self, arm: ArmModel, pose: Array, q: Array, touches: str | None) -> Trajectory:
        """Return a timed straight line of the tip to a map pose (4, 4) at joint positions q (d,).

        Raises a MotionError with the reason.
        """
        control = self._control
        control.sync()
        start, base = control.arm_joints(arm), control.base()
        quick = control.scene.collisions.quick_check(arm, touches)

        def is_free(row: Array) -> bool:
            return all_free(row[None])

        def all_free(rows: Array) -> bool:
            contacts = control.scene.collisions.contacts
            return not any(
                contacts(base, arm, row, touches, among=pairs)
                for row, pairs in zip(rows, quick.doubtful(rows), strict=True)
                if pairs is None or pairs
            )

        chain = arm.solver.chain
        beginning, end = chain.fk(start)[0], matrices.product(Pose.planar(*base).inverse().matrix(), pose)
        line = cartesian_path(arm.solver, start, beginning, end, is_free)
        if line.waypoints is None:
            raise MotionError(line.reason)
        for timing in (time_curve, time_path):  # a curve is faster, but swings out, also beyond joint limits
            trajectory = control.timed(arm.joints, line.waypoints, timing)
            rows = trajectory.positions[1:]
            straight = keeps_line(chain.fk(trajectory.positions), beginning, end)
            if straight and chain.within(rows, 1e-6).all() and all_free(rows):
                return trajectory
        raise MotionError("in collision or off the line between two steps")


@dataclass
class Platform(Control):
    """Basis of all process modules, by subject: ``drive``, ``arms``, ``hands`` and ``sensing``."""

    resolver: Resolver
    ancestors: Callable[[str], Sequence[str]]
    """Action class -> itself and its superclasses, nearest first; local names."""
    releasing: frozenset[str]
    """Action classes that let go of something."""
    rng: np.random.Generator
    drive: Drive = field(init=False)
    arms: Arms = field(init=False)
    hands: Hands = field(init=False)
    phases: Phases = field(init=False)
    leaning: set[str] = field(default_factory=set)
    """Held things that the running steps mean to lean farther than they may else."""
    sensing: Sensing = field(init=False)
    upload: Path | None = field(init=False, default=None)
    """The file that uploaded maps are written to."""
    _exploration: Exploration | None = field(init=False, default=None)
    _searches: Searches | None = field(init=False, default=None)

    @property
    def searches(self) -> Searches:
        """The searches of this run."""
        if self._searches is None:
            self._searches = Searches(self.scene, self.drive.seconds)
        return self._searches

    def base_poses(self) -> BasePoses:
        """Return the base poses in the believed world as it is now."""
        self.sync()
        return BasePoses(self.scene)

    @property
    def exploration(self) -> Exploration:
        """The exploration of this run; begun where the base is when it is first asked for."""
        from executive.locations.next_view import Exploration

        if self._exploration is None:
            self._exploration = Exploration(self.scene)
        return self._exploration

    @property
    def exploring(self) -> Exploration | None:
        """The exploration, None if none was begun."""
        return self._exploration

    def base_at(self, pose: FixedPose) -> BasePose:
        """Return where the base goes for a pose in the map; one off the map counts from where exploring began."""
        x_min, y_min, x_max, y_max = self.scene.world.scene.bounds
        if self._exploration is None or (x_min < pose.x < x_max and y_min < pose.y < y_max):
            return pose.x, pose.y, pose.yaw
        x, y, yaw = self._exploration.origin
        there = Pose.planar(x, y, yaw) @ Pose.planar(pose.x, pose.y, pose.yaw)
        return there.position[0], there.position[1], there.yaw

    def made_goal(self, name: str) -> BasePose | None:
        """Return where the base goes by a name that a step made, at each use the next place; None for other names.

        Raises ObjectNowhereToBeFound when a search has no more places.
        """
        if self._exploration is not None and name in self._exploration.names:
            return self._exploration.goal
        search = None if self._searches is None else self._searches.begun.get(name)
        return None if search is None else self.searches.next(search).base

    def goes_elsewhere(self, where: object) -> bool:
        """Return whether a name that a step made means another place than the last, which cannot be driven to."""
        name = where.name if isinstance(where, Location) else where
        if self._exploration is not None and name in self._exploration.names:
            self._exploration.missed()
            return self._exploration.goal is not None
        return self._searches is not None and name in self._searches.begun

    def watched(self, group: str) -> Sequence[str]:
        """Return the arms that must not lose what they hold: all while driving, else those that this strand uses."""
        if group == "base":
            return super().watched(group)
        return [arm.name for arm in self.arms.holding(self.scene.arms.all) if group != f"gripper of {arm.name}"]

    def missed(self, arm: ArmModel) -> None:
        """Believe that what a hand closed for in vain is not where the map has it, if there is no camera to tell."""
        if self.robot.camera is None and arm.name in self.arms.begun:
            _, base, solution = self.arms.begun[arm.name]
            self.belief.missed(solution.reach.body, arm.name, base)

    def __post_init__(self) -> None:
        self.drive, self.hands, self.sensing = Drive(self), Hands(self), Sensing(self)
        self.arms, self.phases = Arms(self, self.rng), Phases()


class PlatformModule:
    """A process module that works on a platform; it needs no part of the body unless it says which."""

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the parts of the body that an action needs."""
        return ()

    def whole_robot(self) -> tuple[str, ...]:
        """Return base, head, torso and all arms: what of them is needed is found out on the way."""
        torso = [] if self.platform.robot.torso is None else ["torso"]
        return ("base", "head", *torso, *(arm.name for arm in self.platform.scene.arms.all))

    def back_of(self, arm: ArmModel) -> Array:
        """Return the direction in the map (3,) in which a hand draws back from what it has come to."""
        return -matrices.rotated(self.platform.scene.arms.tip(arm)[:3, :3], np.asarray(arm.frame.approach))

    async def follow_to_end(
        self, arms: str, trajectory: Trajectory, what: str | None = None, *, pushes: str | None = None
    ) -> None:
        """Move arms; raises ManipulationGoalInCollision if something stops them, and notes what that was felt at."""
        motion = await self.platform.follow(arms, trajectory, pushes=pushes)
        if motion.state is not MotionState.DONE:
            await self.platform.sensing.bump(motion)
            raise ManipulationGoalInCollision(arm=arms, what=what, blocked_by=motion.blocked_by)

    async def drive(self, base: BasePose) -> None:
        """Ask whoever navigates to drive to a base pose; raises a NavigationFailure."""
        x, y, yaw = map(float, base)
        await perform(action("Translation-LocationChange", x=x, y=y, yaw=yaw))
