"""Motions of groups of joints, played row by row; a row that would touch something is not entered."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planlang.geometry import Array
from planlang.protocols import Configuration, Contact, Motion, MotionState, Trajectory
from sim.contact import Query
from sim.robot import Robot

BASE = ("x", "y", "yaw")
DEEPER = 0.003
"""A contact that was there before the motion blocks it once it is deeper by more than this [m]."""

_JUMP = 0.05
_LIMIT = 1e-3
Find = Callable[[Configuration, Query], tuple[Contact, ...]]


@dataclass(slots=True)
class Playback:
    """A motion under way: row ``row`` of the trajectory was reached, ``strands`` move on independently.

    An arm is one strand; each finger is a strand of its own, so that one which touches waits for the others.
    """

    trajectory: Trajectory
    strands: list[Strand]
    grip: bool
    row: int = 0
    halted: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the joints and bodies that the motion moves."""
        return self.trajectory.names

    def state(self) -> Motion:
        """See :class:`planlang.protocols.Motion`."""
        blocked = next((strand.blocked_by for strand in self.strands if strand.blocked_by), None)
        if self.halted:
            return Motion(MotionState.HALTED)
        over = self.row + 1 >= len(self.trajectory.positions)
        if blocked and (over or all(strand.blocked_by for strand in self.strands)):
            return Motion(MotionState.BLOCKED, blocked)
        return Motion(MotionState.DONE) if over else Motion(MotionState.MOVING)


@dataclass(slots=True)
class Strand:
    """Columns of a trajectory that stop together, and the contacts there were when it began."""

    columns: list[int]
    query: Query
    before: dict[tuple[str, str], float]
    blocked_by: str | None = None


def begin(robot: Robot, find: Find, now: Configuration, trajectory: Trajectory) -> Playback:
    """Check a trajectory against the robot and where it is, and get ready to play it.

    Raises ``ValueError``: an unknown joint, a wrong shape, a number that is none, a row outside the joint limits, or a
    first row that is not where the robot is.
    """
    _check(robot, now, trajectory)
    fingers = {link for links in robot.body.hands.values() for link in links}
    numbers = {robot.number[link] for link in fingers if link in robot.number}
    moved = [robot.moved_by(name) for name in trajectory.names]
    grip = bool(moved) and all(links and links <= numbers for links in moved)
    columns = [[k] for k in range(len(moved))] if grip else [list(range(len(moved)))]
    strands = []
    for chosen in columns:
        query = Query(
            frozenset().union(*(moved[k] for k in chosen)), grip=grip, itself=not set(trajectory.names) <= set(BASE)
        )
        before = {(contact.part, contact.body): contact.depth for contact in find(now, query)}
        strands.append(Strand(chosen, query, before))
    return Playback(trajectory, strands, grip)


def _check(robot: Robot, now: Configuration, trajectory: Trajectory) -> None:
    names, rows = trajectory.names, np.asarray(trajectory.positions, dtype=float)
    for name in names:
        if name not in BASE and name not in robot.joints:
            raise ValueError(f"the robot has no joint {name!r}; it has x, y, yaw and {', '.join(robot.joints)}")
    if rows.ndim != 2 or not len(rows) or rows.shape[1] != len(names) or len(set(names)) != len(names):
        raise ValueError(f"a trajectory of {len(names)} different names needs (n, {len(names)}) rows, got {rows.shape}")
    if not np.isfinite(rows).all():
        raise ValueError(f"the trajectory of {', '.join(names)} contains what is no number")
    here = [coordinate(now, name) for name in names]
    for k, name in enumerate(names):
        offset = abs(rows[0, k] - here[k])
        if name == "yaw":
            offset = abs((offset + np.pi) % (2 * np.pi) - np.pi)
        if offset > _JUMP:
            raise ValueError(f"the trajectory begins at {name} = {rows[0, k]:.4f}, the robot is at {here[k]:.4f}")
        lower, upper = robot.limits.get(name, (-np.inf, np.inf))
        for extreme in (float(rows[:, k].min()), float(rows[:, k].max())):
            if not lower - _LIMIT <= extreme <= upper + _LIMIT:
                raise ValueError(f"the trajectory takes {name} to {extreme:.4f}, limits are {lower:.4f} to {upper:.4f}")


def coordinate(configuration: Configuration, name: str) -> float:
    """Return the value of a joint or of x, y, yaw."""
    return configuration.base[BASE.index(name)] if name in BASE else configuration.joints[name]


def moved(configuration: Configuration, names: Sequence[str], values: Array) -> Configuration:
    """Return the configuration with some coordinates changed."""
    base, joints = list(configuration.base), dict(configuration.joints)
    for name, value in zip(names, values.tolist(), strict=True):
        if name in BASE:
            base[BASE.index(name)] = value
        else:
            joints[name] = value
    return Configuration((base[0], base[1], base[2]), joints)


def advance(playback: Playback, find: Find, now: Configuration) -> Configuration:
    """Advance by one row; return the robot's configuration then: ``now`` where the way is blocked."""
    playback.row += 1
    row = np.asarray(playback.trajectory.positions, dtype=float)[playback.row]
    for strand in playback.strands:
        if strand.blocked_by is not None:
            continue
        following = moved(now, [playback.names[k] for k in strand.columns], row[strand.columns])
        contacts = find(following, strand.query)
        strand.blocked_by = _obstacle(contacts, strand.before)
        if strand.blocked_by is None:
            current = {(contact.part, contact.body) for contact in contacts}
            strand.before = {pair: depth for pair, depth in strand.before.items() if pair in current}
            now = following
    return now


def _obstacle(contacts: Sequence[Contact], before: Mapping[tuple[str, str], float]) -> str | None:
    for contact in contacts:
        known = before.get((contact.part, contact.body))
        if known is None or contact.depth > known + DEEPER:
            return contact.body
    return None
