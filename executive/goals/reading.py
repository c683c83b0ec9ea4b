"""Goals of phrases, with the names of a map."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from executive.goals.checking import Check
from executive.maps import SemanticMap
from planlang.designators import Object, local_name
from planlang.diagnostics import BadInput, Diagnostic, Span
from planlang.goals import Goal
from planlang.ontology import expand
from planlang.phrases import Lexicon, read_goal
from planlang.words import Text
from sim import Scene
from sim.bodies import FLOOR

STATES = ("StateOfThing",)
"""Classes of states, whose individuals a goal may name; those of devices are on and off."""
THE_FLOOR = Object("Floor", FLOOR)
"""What stands on no furniture stands on it."""


def read_goals(
    phrases: Iterable[str], lexicon: Lexicon, semantic_map: SemanticMap, scene: Scene, file: str = "goal"
) -> tuple[Goal, ...]:
    """Read goals with the names of a map, whose ``scene`` has the bodies.

    Raises BadInput with all errors: also for a thing that is not there, a state that it cannot have, and a relation
    that no state of the world decides.
    """
    things = lexicon.things if FLOOR in lexicon.things else {**lexicon.things, FLOOR: THE_FLOOR}
    lexicon = lexicon.with_things(things)
    states, goals, problems = states_of(semantic_map), list[Goal](), list[Diagnostic]()
    for phrase in phrases:
        try:
            goal = read_goal(phrase, lexicon, states, file=file)
        except BadInput as problem:
            problems += [_of(phrase, one) for one in problem.diagnostics]
            continue
        wrong = list(Check(semantic_map, scene, Span(file)).problems(goal))
        problems += [_of(phrase, one) for one in wrong]
        goals.append(goal)
    if problems:
        raise BadInput(problems)
    return tuple(goals)


def states_of(semantic_map: SemanticMap) -> Mapping[str, str]:
    """Map the local names of the states that an ontology has to their IRIs."""
    ontology = semantic_map.ontology
    found = (iri for cls in STATES for iri in ontology.individuals(expand(cls)))
    return {local_name(iri): iri for iri in found}


def _of(phrase: str, problem: Diagnostic) -> Diagnostic:
    """Name the goal that a problem is about."""
    return replace(problem, message=Text(f"{phrase!r}: ", problem.message))
