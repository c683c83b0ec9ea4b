"""What is true in a world, for tests and for judging a run: never for planning."""

from __future__ import annotations

from sim.world import PyBulletWorld

ROBOT = "robot"
"""What :func:`held_by` calls the robot."""

_RESTS = 0.005


def held_by(world: PyBulletWorld, name: str) -> str | None:
    """Who holds a body: "robot" as long as it does, else the person who has taken it, else None."""
    return ROBOT if name in world.attached() else world.taken(name)


def at_rest_on(world: PyBulletWorld, name: str) -> str | None:
    """The body that a body stands on; None while it is held, falls, or has nothing below it within 5 mm."""
    if held_by(world, name) or world.falling(name):
        return None
    return world.support(name) if world.height_above_support(name) <= _RESTS else None
