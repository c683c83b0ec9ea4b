"""Matching of tasks with robots by the rules of KnowRob's SRDL (November 2014), for comparison with ours.

The values of a property of a class are those in restrictions (some, value) on the property or its subproperties, of
the class and everything above it: superclasses, members of the intersection that defines it, unions that contain it,
and classes that are stated to be equivalent to it. Equivalence is followed in this direction only, so that the class's
own definitions by equivalence are not seen. Sub-actions are all values of ``subAction``, transitively; order, states
and alternatives are ignored. A task requires

* its own capabilities and those of its sub-actions, and the direct dependencies of its own;
* its own components, those of its sub-actions and those of the required capabilities.

A capability is available if it or a subclass is claimed, whatever components it depends on, or if all components and
capabilities that it depends on, possibly none, are available. Nothing is unknown: undefined classes require nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache, cached_property

from executive.robots.closed_world import ClosedWorld
from executive.robots.matching import Possessions
from executive.robots.requirements import NEEDED, PROPERTIES, Availability, Finding, FindingKind, together
from planlang.closure import reached
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import BNode, Literal, Ontology, Term, expand
from planlang.ontology.classes import twin
from planlang.ontology.expression_text import expression_of, text_of
from planlang.ontology.terms import OWL, RDF, RDFS

Node = str | tuple[int, BNode]
"""An IRI, or a blank node with the number of its ontology."""

CAPABILITY, COMPONENT = NEEDED
AVAILABLE, MISSING = Availability.AVAILABLE, Availability.MISSING
_SUB_ACTION, _HAS_CAPABILITY = expand("knowrob:subAction"), expand("srdl2-cap:hasCapability")
_ANY_CAPABILITY, _ROBOT = expand("srdl2-cap:Capability"), expand("knowrob:Robot")


class ClassProperties:
    """Properties of classes in the union of several ontologies."""

    def __init__(self, ontologies: Iterable[Ontology]) -> None:
        self.ontologies = tuple(ontologies)
        self.above = cache(self._above)
        self._next = cache(lambda cls: tuple(self._directly_above(cls)))
        self.values = cache(self._values)
        self._unions: dict[Node, list[Node]] = {}
        for number, ontology in enumerate(self.ontologies):
            for triple in ontology.triples(p=OWL.unionOf):
                for member in self._items(number, triple.object):
                    self._unions.setdefault(member, []).append(_node(number, triple.subject))

    def _above(self, cls: Node) -> dict[Node, None]:
        """Collect a class and everything above it, by the original rules."""
        return dict.fromkeys(reached((cls,), self._next))

    def _directly_above(self, cls: Node) -> Iterator[Node]:
        for number, ontology in enumerate(self.ontologies):
            if isinstance(cls, tuple) and cls[0] != number:
                continue
            name = cls if isinstance(cls, str) else cls[1]
            for triple in ontology.triples(name, RDFS.subClassOf):
                yield _node(number, triple.object)
            for triple in ontology.triples(None, OWL.equivalentClass, name):
                yield _node(number, triple.subject)
            for triple in ontology.triples(name, OWL.intersectionOf):
                yield from self._items(number, triple.object)
        yield from self._unions.get(cls, ())
        other = twin(cls) if isinstance(cls, str) else None
        if other is not None and any(ontology.is_class(other) for ontology in self.ontologies):
            yield other

    def _items(self, number: int, cell: Term | None) -> Iterator[Node]:
        """Yield the items of an RDF list; a cyclic list ends where it repeats."""
        ontology, seen = self.ontologies[number], set[Term]()
        while isinstance(cell, BNode) and cell not in seen:
            seen.add(cell)
            yield from (_node(number, item) for item in ontology.values(cell, RDF.first))
            cell = ontology.value(cell, RDF.rest)

    def _values(self, cls: Node, prop: str) -> dict[Node, Span]:
        """Collect the values of a property (IRI) for a class, each with its first statement."""
        below = {name for ontology in self.ontologies for name in ontology.subproperties(prop)}
        values: dict[Node, Span] = {}
        for one in self.above(cls):
            if isinstance(one, str):
                continue
            number, blank = one
            for restriction in self.ontologies[number].restrictions(blank):
                is_read = restriction.property in below and restriction.kind in ("some", "value")
                if is_read and not isinstance(restriction.filler, Literal):
                    values.setdefault(_node(number, restriction.filler), restriction.span)
        return values

    def text(self, node: Node) -> str:
        """Write a named class by its local name, an anonymous one in Manchester syntax."""
        if isinstance(node, str):
            return local_name(node)
        expression = expression_of(self.ontologies[node[0]], node[1], Span(""))
        return "an expression" if expression is None else text_of(expression)


def _node(number: int, term: Term) -> Node:
    return (number, term) if isinstance(term, BNode) else str(term)


class OriginalMatcher:
    """Compares the tasks of an ontology with one robot by the original rules."""

    def __init__(self, ontology: Ontology, robot: Possessions) -> None:
        model_ontologies = [] if robot.model is None or robot.model.ontology is ontology else [robot.model.ontology]
        self.classes = ClassProperties([ontology, *model_ontologies])
        self.robot = robot
        self._world = ClosedWorld(self.classes.ontologies)
        self._claimed: dict[Node, str] = {}
        for claim in self._claims():
            for capability in self.classes.above(claim):
                self._claimed.setdefault(capability, self.classes.text(claim))
        self._derived: dict[Node, bool] = {}

    def task(self, cls: str) -> Finding:
        """Check the requirements of a class of actions and its sub-actions."""
        capabilities = self.classes.values(cls, PROPERTIES[CAPABILITY])
        own = (
            *(self._capability(one, span, deeper=True) for one, span in capabilities.items()),
            *self._components(cls),
        )
        start: Node = cls
        subs = reached((start,), lambda action: self.classes.values(action, _SUB_ACTION))
        below = (*own, *(self._action(sub) for sub in subs if sub != cls))
        span = next(filter(None, (ontology.span(cls) for ontology in self.classes.ontologies)), None)
        return Finding(FindingKind.TASK, local_name(cls), cls, _all_there(below), "", span, below)

    def _action(self, cls: Node) -> Finding:
        capabilities = self.classes.values(cls, PROPERTIES[CAPABILITY])
        below = (*(self._capability(one, span) for one, span in capabilities.items()), *self._components(cls))
        iri = cls if isinstance(cls, str) else None
        return Finding(FindingKind.ACTION, self.classes.text(cls), iri, _all_there(below), "", None, below)

    def _components(self, cls: Node) -> tuple[Finding, ...]:
        components = self.classes.values(cls, PROPERTIES[COMPONENT])
        return tuple(self._component(one, span) for one, span in components.items())

    def _component(self, component: Node, required: Span) -> Finding:
        part = self._part(component)
        state, reason = (MISSING, f"{self.robot.robot} has none") if part is None else (AVAILABLE, part)
        iri = component if isinstance(component, str) else None
        return Finding(COMPONENT, self.classes.text(component), iri, state, reason, None, (), required)

    def _capability(self, capability: Node, required: Span, *, deeper: bool = False) -> Finding:
        """Check a capability and its components; with ``deeper``, also the capabilities that it depends on."""
        needed = self.classes.values(capability, PROPERTIES[CAPABILITY]) if deeper else {}
        below = (*self._components(capability), *(self._capability(one, span) for one, span in needed.items()))
        state, reason = self._state(capability)
        iri = capability if isinstance(capability, str) else None
        return Finding(CAPABILITY, self.classes.text(capability), iri, state, reason, None, below, required)

    def _state(self, capability: Node) -> tuple[Availability, str]:
        name, claim = self.robot.robot, self._claimed.get(capability)
        if claim is not None:
            return AVAILABLE, f"{name} claims {'it' if claim == self.classes.text(capability) else claim}"
        if self._is_derived(capability):
            is_free = not any(self._dependencies(capability))
            return AVAILABLE, "it has no prerequisites" if is_free else "all prerequisites are met"
        components, capabilities = self._dependencies(capability)
        lacking = [one for one in components if self._part(one) is None]
        lacking += [one for one in capabilities if one not in self._claimed and not self._is_derived(one)]
        short = ", ".join(map(self.classes.text, lacking))
        return MISSING, f"{name} does not claim it and lacks {short}" if short else f"{name} does not claim it"

    def _dependencies(self, capability: Node) -> tuple[tuple[Node, ...], tuple[Node, ...]]:
        """List the components and the capabilities that a capability depends on directly."""
        values = self.classes.values
        return tuple(values(capability, PROPERTIES[COMPONENT])), tuple(values(capability, PROPERTIES[CAPABILITY]))

    def _is_derived(self, capability: Node) -> bool:
        """Check whether all dependencies of a capability are available; none may rest on itself (least fixed point)."""
        if capability not in self._derived:
            closure = tuple(reached((capability,), lambda one: self._dependencies(one)[1]))
            available = {one for one in closure if one in self._claimed}
            while new := [one for one in closure if one not in available and self._follows(one, available)]:
                available.update(new)
            self._derived |= {one: self._follows(one, available) for one in closure}
        return self._derived[capability]

    def _follows(self, capability: Node, available: set[Node]) -> bool:
        if _ANY_CAPABILITY not in self.classes.above(capability) or capability == _ANY_CAPABILITY:
            return False
        components, capabilities = self._dependencies(capability)
        return self._is_robot() and available.issuperset(capabilities) and None not in map(self._part, components)

    def _is_robot(self) -> bool:
        return self.robot.model is None or any(_ROBOT in self.classes.above(kind) for kind in self.robot.model.types)

    def _claims(self) -> Iterator[Node]:
        """Yield the capabilities claimed for the robot and for its classes."""
        model = self.robot.model
        if model is None:
            yield from self.robot.claims
            return
        if not self._is_robot():
            return
        below = set(model.ontology.subproperties(_HAS_CAPABILITY))
        for triple in model.ontology.triples(model.iri):
            if triple.predicate in below and isinstance(triple.object, str):
                yield triple.object
        for kind in model.types:
            yield from self.classes.values(kind, _HAS_CAPABILITY)

    @cached_property
    def _kinds(self) -> dict[Node, str]:
        """Class -> name of the first part of the robot that is of this class."""
        kinds: dict[Node, str] = {}
        for part in self.robot.parts:
            for kind in sorted(part.classes):
                for cls in self.classes.above(kind):
                    kinds.setdefault(cls, part.name)
        return kinds

    def _part(self, component: Node) -> str | None:
        """Find the name of a part of a named or anonymous class; None if the robot has none."""
        if isinstance(component, str) or component in self._kinds:
            return self._kinds.get(component)
        expression = expression_of(self.classes.ontologies[component[0]], component[1], Span(""))
        fitting = (
            part.name
            for part in self.robot.parts
            if expression is not None and part.iri is not None and self._world.satisfies(part.iri, expression)
        )
        return next(fitting, None)


def _all_there(below: Iterable[Finding]) -> Availability:
    """Find the worst state of all findings that count; dependencies of claimed capabilities do."""
    return together(one.state for top in below for one, _ in top.walk())
