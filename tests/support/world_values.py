"""States of worlds as values that can be compared, to test what leaves a world alone."""

from __future__ import annotations

from dataclasses import fields

from sim.kinematic import KinematicScene


def value_of(world: KinematicScene) -> tuple[object, ...]:
    """Everything that a world has in its state: equal if all is at the same place, in the same hands, and as it was."""
    state = world.world_state()
    return tuple(getattr(state, field.name) for field in fields(state))
