"""The true world in PyBullet: it is commanded and sensed like a robot's real environment, and time goes on in steps."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from planlang.protocols import Configuration, Detection, Motion, MotionState, Trajectory
from sim import snapshots
from sim.kinematic import KinematicScene
from sim.picture import save_png
from sim.playback import Playback, advance, begin
from sim.scene import RobotBody, Scene

ROBOT = "robot"
"""The name by which :func:`held_by` calls the robot."""

_RESTS = 0.005


class PyBulletWorld(KinematicScene):
    """Implements :class:`planlang.protocols.World`; planning asks a :class:`sim.PlanningWorld` instead.

    Motions are played back (:mod:`sim.playback`): a step that would make the robot touch something is taken back.
    """

    def __init__(
        self, scene: Scene, robot: RobotBody | None = None, *, gui: bool = False, rate: int = 30, seed: int = 0
    ) -> None:
        """Initialize as every scene; ``seed`` is kept for records: nothing in here is random."""
        super().__init__(scene, robot, gui=gui, rate=rate)
        self.seed, self.steps = seed, 0
        self._motions: dict[str, Playback] = {}

    # Time and motions

    def step(self) -> None:
        """Advance by one step: motions in the order of their groups' first start, then people, then what falls."""
        for playback in self._motions.values():
            if playback.state().state is MotionState.MOVING:
                self._now = advance(playback, self._find, self._now)
        self._here()
        if self._robot is not None:
            self._contacts.part()
        self._people.step({name: self._bodies.poses[name] for name in self._held})
        self._falling.step()
        self.steps += 1

    def start(self, group: str, trajectory: Trajectory) -> None:
        """Begin a motion. A joint obeys the newest motion: another group that moves one of these joints is halted.

        A trajectory that moves finger joints alone lets each finger go on until it touches something by itself.
        Raises ``ValueError`` for unknown joints, wrong shapes, values outside the limits, or a first row elsewhere.
        """
        begun = begin(self.robot, self._find, self._now, trajectory)
        for other, playback in self._motions.items():
            if other != group and set(playback.names) & set(trajectory.names):
                self.halt(other)
        self._motions[group] = begun

    def motion(self, group: str) -> Motion:
        """State of the group's last motion; a group that has never moved is done."""
        return self._motions[group].state() if group in self._motions else Motion(MotionState.DONE)

    def halt(self, group: str) -> None:
        """Stop the group where it is; nothing happens when it does not move."""
        if group in self._motions and self._motions[group].state().state is MotionState.MOVING:
            self._motions[group].halted = True

    def set_configuration(self, configuration: Configuration) -> None:
        """Put the robot, with what it holds, somewhere; joints not named stay. Motions under way are halted."""
        super().set_configuration(configuration)
        for group in self._motions:
            self.halt(group)

    def release(self, name: str) -> None:
        """Let a body go: it sinks in free fall unless a person has taken it. ``KeyError`` when it is not held."""
        super().release(name)
        if self._people.holder(name) is None:
            self._falling.begin(name)

    def falling(self, name: str) -> bool:
        """Return whether a body is on its way down."""
        return name in self._falling.on_the_way

    def taken(self, name: str) -> str | None:
        """Return the person who has taken a body, None if nobody has."""
        return self._people.holder(name)

    def hand(self, name: str, side: str = "right") -> tuple[float, float, float]:
        """Return where a person's palm is, in the map."""
        x, y, z = self._people.hand(name, 0 if side == "right" else 1).tolist()
        return (x, y, z)

    def between_fingers(self, fingers: str | Collection[str]) -> str | None:
        """Return the body between the fingers of a hand (its link, or the finger links), each within 1 cm of it."""
        links = self.robot.body.hands[fingers] if isinstance(fingers, str) else fingers
        self._here()
        return self._contacts.between(links)

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """Return what the camera at a link sees in its picture, in the order of the scene."""
        self._here()
        return self._camera.detect(self._optics(), self.robot.link_pose(camera_link))

    def save_picture(self, path: Path, of: Collection[str] = (), width: int = 640, height: int = 480) -> None:
        """Write :meth:`render` as a PNG file; raises OSError as writing does."""
        save_png(path, self.render(width, height, of=of))

    def state(self) -> tuple[object, ...]:
        """Return something hashable, equal for worlds where everything is in the same pose and motion."""
        motions = tuple((group, playback.row, playback.state()) for group, playback in self._motions.items())
        *things, people = super().state()
        return (self.steps, *things, motions, people)

    def snapshot(self) -> dict[str, Any]:
        """Return the state as JSON. Motions under way are left out; the robot is taken to stand where it is."""
        return {"step": self.steps, "groups": list(self._motions), **super().snapshot()}

    def restore_state(self, state: Mapping[str, Any]) -> None:
        """Go on from a :meth:`snapshot`; raises ValueError for one of another scene or robot, or that is damaged."""
        try:
            steps, groups = int(state["step"]), [str(group) for group in state["groups"]]
        except (KeyError, TypeError, OverflowError) as problem:
            raise ValueError(f"the state of the world is damaged: {problem!r}") from None
        if steps < 0:
            raise ValueError(f"the state of the world is damaged: it is {steps} steps old")
        super().restore_state(state)
        self._motions = {group: snapshots.at_rest() for group in groups}
        self.steps = steps


def held_by(world: PyBulletWorld, name: str) -> str | None:
    """Return who holds a body: "robot" as long as it does, else the person who has taken it, else None."""
    return ROBOT if name in world.attached() else world.taken(name)


def at_rest_on(world: PyBulletWorld, name: str) -> str | None:
    """Return the body that a body stands on; None while it is held, falls, or has nothing below it within 5 mm."""
    if held_by(world, name) or world.falling(name):
        return None
    return world.support(name) if world.height_above_support(name) <= _RESTS else None
