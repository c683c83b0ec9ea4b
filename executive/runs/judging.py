"""The goals of a run: those that its options state, and what they say of the plan's own claim."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from executive.goals import Predicate, Verdict, decidable
from executive.options.running import SituationSettings
from executive.runs.parameters import plan_parameters
from executive.runs.plan_body import Subject
from planlang.designators import Object
from planlang.goals import Goal
from planlang.language.plans import Plan
from planlang.ontology import Ontology
from planlang.recipe.goals import declared_goals
from planlang.words import Option, Text

if TYPE_CHECKING:
    from planlang.compiler.compile import CompiledPlan


def goals_of(
    options: SituationSettings,
    subject: Subject,
    compiled: CompiledPlan | None,
    ontologies: Sequence[Ontology],
    plan: Plan[Any, Any],
) -> tuple[tuple[Goal | Predicate, ...], tuple[Goal, ...]]:
    """Find the goals that options state, and further ones that a compiled recipe declares. Raises BadInput."""
    stated, declared = _stated(options, subject), _declared(subject, compiled, ontologies, plan)
    known = {str(one) for one in stated}
    return stated, tuple(one for one in declared if str(one) not in known)


def _stated(options: SituationSettings, subject: Subject) -> tuple[Goal | Predicate, ...]:
    """Read the goals that options state, with the names of what is there in truth. Raises BadInput."""
    given = options.goal or ()
    phrases = [one for one in given if isinstance(one, str)]
    if not given:
        return ()
    from executive.goals.reading import read_goals  # the parser of phrases, which most runs do without
    from executive.runs.phrases import lexicon_of

    there, scene = subject.in_truth
    lexicon = lexicon_of(there, (one.type for body in scene.bodies for one in body.content))
    read = iter(read_goals(phrases, lexicon, there, scene, Text(Option("goal"))))
    return tuple(next(read) if isinstance(one, str) else Predicate(one) for one in given)


def _declared(
    subject: Subject, compiled: CompiledPlan | None, ontologies: Sequence[Ontology], plan: Plan[Any, Any]
) -> tuple[Goal, ...]:
    """List the goals that the recipe of a compiled plan declares, of the things that its parameters are bound to."""
    if compiled is None:
        return ()
    there, scene = subject.in_truth
    stated = {one.default.iri: name for name, one in plan_parameters(plan).items() if one.default is not None}

    def meant(what: Object) -> Object | None:
        value = subject.bound.get(stated[what.iri], what) if what.iri in stated else what
        return value if isinstance(value, Object) and value.iri is not None and there.find(value.iri) else None

    found = (one for ontology in ontologies for one in declared_goals(ontology, compiled.recipes, meant))
    return tuple(goal for goal in found if decidable(goal, there, scene))


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
