"""Candidates that are joined: what is possible alone has to be possible together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executive.maps.supports import Standing
from executive.why.candidates import Candidate
from executive.why.costs import cost_of, groups_of
from executive.why.free_places import is_at_rest, is_free, poses_after
from planlang.advice import ABSENT, BEFORE, TRANSLATION, Change
from sim import Scene


def pair(one: Candidate, other: Candidate, scene: Scene) -> Candidate | None:
    """Join two candidates; None if they cannot be made together.

    Of the moves of the other to one side it has those that can; the farthest of these stands for all.
    """
    if not can_be_joined(one, other):
        return None
    moves = [each for each in (*other.smaller, other) if fit_together(one.changes, each.changes, scene)]
    joined = [Candidate((*one.changes, *each.changes), "pair", one.cost + each.cost, (), (one, each)) for each in moves]
    return replace(joined[-1], smaller=tuple(joined[:-1])) if joined else None


def followed(one: Candidate, other: Candidate, scene: Scene) -> Candidate | None:
    """Join a candidate with what its rerun advises, which stands for what says something else of the same.

    None if they cannot be made together.
    """
    if can_be_joined(one, other):
        return pair(one, other, scene)
    about = set(map(_about, other.changes))
    kept = tuple(change for change in one.changes if _about(change) not in about)
    if not fit_together(kept, other.changes, scene):
        return None
    changes = (*kept, *other.changes)
    return Candidate(changes, "pair" if kept else other.kind, cost_of(changes, scene), parts=(other,) if kept else ())


def can_be_joined(one: Candidate, other: Candidate) -> bool:
    """Check whether no change of one says something else of what a change of the other is about."""
    about = set(map(_about, one.changes))
    return not any(_about(change) in about for change in other.changes)


def _about(change: Change) -> tuple[object, ...]:
    """What a change is about: a thing, an option, or one of the actions that come before."""
    if change.thing is not None:
        return (change.thing,)
    return (None, change.what, change.value if change.what == BEFORE else None)


def fit_together(one: Sequence[Change], other: Sequence[Change], scene: Scene) -> bool:
    """Check whether what changes move has room, and is at rest, with others made, too; alone each is possible."""
    return _fits(one, other, scene) and _fits(other, one, scene)


def _fits(changes: Sequence[Change], others: Sequence[Change], scene: Scene) -> bool:
    elsewhere, gone = poses_after(others, scene), {change.thing for change in others if change.what == ABSENT}
    if not (elsewhere or gone):
        return True
    moving = [change for change in changes if change.what == TRANSLATION]
    for group in groups_of(moving, scene):
        poses = poses_after(group, scene)
        kept = [body for body in scene.bodies if body.name not in gone]
        after = Scene(tuple(replace(one, pose=elsewhere.get(one.name, one.pose)) for one in kept))
        met = Scene(tuple(one for one in after.bodies if one.name in poses or one.name in elsewhere))
        if not (is_free(met, poses) and is_at_rest(after, poses, str(group[0].thing), Standing(after))):
            return False
    return True
