"""Things that look alike: nothing that a camera reads tells them apart, so that one is as good as the other."""

from __future__ import annotations

from sim.scene import Body

SAME_SIZE = 0.01
"""Difference of extents up to which things are of one size [m]."""


def is_of_kind(one: Body, other: Body, within: float = SAME_SIZE) -> bool:
    """Check whether two bodies are of one class and size, within a difference of their extents [m]."""
    return one.type == other.type and all(abs(a - b) <= within for a, b in zip(one.size, other.size, strict=True))


def is_like(one: Body, other: Body) -> bool:
    """Check whether two bodies are of one class, size, mark and colour."""
    return is_of_kind(one, other) and (one.mark, one.colour) == (other.mark, other.colour)
