"""Where what a robot lacks could be had: search over individuals and more special classes of a knowledge base.

What is missing is looked for with its specialisations, nearest first; what a candidate requires itself is checked in
the same way; the first one without unmet requirement is taken. Hardware is not had from a knowledge base.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from executive.robots.finding import NEEDED, Availability, Finding, FindingKind
from executive.robots.matching import Judge
from executive.robots.requirements import requirements_of
from executive.robots.tasks import Match
from planlang.designators import local_name
from planlang.ontology import Ontology, expand

HARDWARE = expand("srdl2-comp:HardwareComponent")
DEEPEST = 8
"""Requirements of requirements that are followed."""


def with_remedies(match: Match, judge: Judge, knowledge: Iterable[Ontology]) -> Match:
    """The match with a remedy at everything missing or unknown for which the knowledge base has one."""
    search = _Search(judge, tuple(knowledge))
    return replace(match, tree=search.told(match.tree))


class _Search:
    def __init__(self, judge: Judge, knowledge: tuple[Ontology, ...]) -> None:
        self.judge = judge
        self.knowledge = knowledge
        own = {part.iri for part in judge.robot.parts}
        self.own = frozenset(iri for iri in own if iri)

    def told(self, finding: Finding) -> Finding:
        below = tuple(self.told(one) for one in finding.below)
        remedy = ""
        if finding.iri and finding.state is not Availability.AVAILABLE and finding.kind in NEEDED:
            had = self.had(finding.kind, finding.iri, ())
            remedy = f"could be had: {', with '.join(had)}" if had else ""
        return replace(finding, below=below, remedy=remedy)

    def had(self, kind: FindingKind, cls: str, above: tuple[str, ...]) -> tuple[str, ...]:
        """What to get so that a missing class is there, with what that takes; nothing if there is no way."""
        if cls in above or len(above) >= DEEPEST:
            return ()
        inside = (*above, cls)
        for special in self._specialisations(cls):
            if kind is FindingKind.COMPONENT and self._is_hardware(special):
                continue
            unmet = self._unmet(special)
            needed = [self.had(one.kind, one.iri or "", inside) for one in unmet]
            if any(not one for one in needed):
                continue
            met = tuple(what for one in needed for what in one)
            if kind is FindingKind.COMPONENT:
                source = next(self._individuals(special), None)
                if source is not None:
                    return (source, *met)
            elif unmet or special != cls:
                takes = met if unmet else (f"{local_name(special)}, all that it takes is there",)
                return takes
        return ()

    def _specialisations(self, cls: str) -> Iterator[str]:
        yield from dict.fromkeys(below for one in self.knowledge for below in one.subclasses(cls))

    def _is_hardware(self, cls: str) -> bool:
        return any(one.taxonomy.is_below(cls, HARDWARE) for one in self.knowledge)

    def _unmet(self, cls: str) -> list[Finding]:
        """What a class requires and the robot does not have."""
        stated = [(one, needed) for one in self.knowledge for needed in requirements_of(one, cls)]
        judged = {needed.text: self.judge.requirement(needed) for _, needed in stated}
        return [one for one in judged.values() if one.state is not Availability.AVAILABLE]

    def _individuals(self, cls: str) -> Iterator[str]:
        """Individuals of just this class that are no parts of the robot, with where they are."""
        for one in self.knowledge:
            for iri in one.individuals(cls):
                if iri not in self.own and cls in one.types(iri) and not one.is_class(iri):
                    yield f"{local_name(iri)} ({local_name(cls)}, {one.span(iri)})"
