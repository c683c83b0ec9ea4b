"""The goals of a run: those that its options state, and what they say of the plan's own claim."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from executive.goals import Predicate, Verdict, read_goals
from executive.options.running import SituationSettings
from executive.runs.phrases import lexicon_of
from executive.runs.plan_body import Subject
from planlang.goals import Goal
from planlang.words import Option, Text


def stated_goals(options: SituationSettings, subject: Subject) -> tuple[Goal | Predicate, ...]:
    """Read the goals that options state, with the names of what is there in truth. Raises BadInput."""
    given = options.goal or ()
    phrases = [one for one in given if isinstance(one, str)]
    if not given:
        return ()
    there, scene = subject.in_truth
    lexicon = lexicon_of(there, (one.type for body in scene.bodies for one in body.content))
    read = iter(read_goals(phrases, lexicon, there, scene, Text(Option("goal"))))
    return tuple(next(read) if isinstance(one, str) else Predicate(one) for one in given)


def phrases_of(options: SituationSettings) -> list[str] | None:
    """List the goals that are phrases, which traces record; None if there are none."""
    return [one for one in options.goal or () if isinstance(one, str)] or None


def contradicted(verdicts: Iterable[Verdict]) -> str | None:
    """Say what is so in the world although the plan says that it is done; None if all goals hold."""
    reasons = dict.fromkeys(one.reason for one in verdicts if not one.holds)
    return f"the plan says done; in the world {'; '.join(reasons)}" if reasons else None


def in_a_line(verdicts: Sequence[Verdict]) -> str:
    """Say of each goal whether it holds, for the page of a run."""
    return "; ".join(str(one).removeprefix("goal ") for one in verdicts)
