"""KnowRob's matching of tasks with robots (SRDL), as an oracle: its rules one by one over an rdflib graph.

Nothing here is shared with what is tested but the files; these are parsed by rdflib.
"""

import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import rdflib
from rdflib import OWL, RDF, RDFS, BNode, Graph, Literal, URIRef
from rdflib.term import Node

KNOWROB = rdflib.Namespace("http://knowrob.org/kb/knowrob.owl#")
CAP = rdflib.Namespace("http://knowrob.org/kb/srdl2-cap.owl#")
COMP = rdflib.Namespace("http://knowrob.org/kb/srdl2-comp.owl#")
HOST = "http://knowrob.org/kb/"
ROBOEARTH = "http://www.roboearth.org/kb/roboearth.owl#"


class Answer(NamedTuple):
    """Local names."""

    required_capabilities: frozenset[str]
    required_components: frozenset[str]
    missing_capabilities: frozenset[str]
    missing_components: frozenset[str]


OLD = re.compile(r"http://ias\.cs\.tum\.edu/kb/(?=(?:knowrob|srdl2[a-z-]*)\.owl)")


def read(file: Path) -> Graph:
    """Return what a file says, the older namespaces of the vocabularies read as the later ones."""
    text = re.sub(r"<!-(?!-)", "<!--", file.read_text(encoding="utf-8", errors="replace"))  # exploration-recipe
    text = re.sub(r"(?s)(\sxmlns:[\w-]+=)\S+(?=[^<>]*\1)", "", text)  # acat-adt_example_pipetting declares one twice
    graph = Graph()
    for triple in Graph().parse(data=text, format="xml", publicID=f"file:///{file.name}"):
        if not isinstance(triple[2], Literal):  # the rules read none
            graph.add(tuple(URIRef(OLD.sub(HOST, term)) if isinstance(term, URIRef) else term for term in triple))
    return graph


class OriginalMatcher:
    def __init__(self, graphs: Iterable[Graph]) -> None:
        self.graph = Graph()
        for graph in graphs:
            self.graph += graph
        for term in {term for triple in self.graph for term in triple if term.startswith(ROBOEARTH)}:
            twin = KNOWROB[term.removeprefix(ROBOEARTH)]
            if (twin, RDF.type, OWL.Class) in self.graph:  # RoboEarth's class of the same name
                self.graph.add((term, RDFS.subClassOf, twin))
        self.unions: dict[Node, list[Node]] = {}
        for union, cell in self.graph.subject_objects(OWL.unionOf):
            for member in self.graph.items(cell):
                self.unions.setdefault(member, []).append(union)
        self.supers = cache(self.supers)
        self.values = cache(self.values)
        self.above = cache(self.above)

    def answer(self, task: str, robot: str, robot_graph: Graph) -> Answer:
        """``robot_graph`` is what the robot's own file says."""
        parts = self.parts(URIRef(robot), robot_graph)
        self.kinds = {cls for part in parts for kind in self.graph.objects(part, RDF.type) for cls in self.supers(kind)}
        capabilities = self.required_capabilities(URIRef(task))
        components = self.required_components(URIRef(task), capabilities)
        lacking = {one for one in capabilities if not self.has_capability(URIRef(robot), one, ())}
        absent = components - self.kinds
        return Answer(*(frozenset(map(local, one)) for one in (capabilities, components, lacking, absent)))

    def tasks(self) -> list[str]:
        """Named classes with sub-actions, their own or inherited."""
        classes = {cls for cls in self.graph.subjects(RDF.type, OWL.Class) if isinstance(cls, URIRef)}
        return sorted(str(cls) for cls in classes if self.values(cls, KNOWROB.subAction))

    def supers(self, cls: Node) -> dict[Node, None]:
        """A class and what is above it; of what is equivalent only what states that it is."""
        found = {cls: None}
        for one in (waiting := [cls]):
            above = [*self.graph.objects(one, RDFS.subClassOf), *self.graph.subjects(OWL.equivalentClass, one)]
            above += [part for cell in self.graph.objects(one, OWL.intersectionOf) for part in self.graph.items(cell)]
            above += self.unions.get(one, [])
            waiting += [other for other in dict.fromkeys(above) if other not in found]
            found |= dict.fromkeys(above)
        return found

    def values(self, cls: Node, prop: Node) -> list[Node]:
        """Return what the restrictions above a class say of a property, or of one below it, by some or value."""
        found = []
        for restriction in self.supers(cls):
            if any(prop in self.above(stated) for stated in self.graph.objects(restriction, OWL.onProperty)):
                for facet in (OWL.someValuesFrom, OWL.hasValue):
                    found += self.graph.objects(restriction, facet)
        return list(dict.fromkeys(found))

    def above(self, prop: Node) -> set[Node]:
        return set(self.graph.transitive_objects(prop, RDFS.subPropertyOf))

    def sub_actions(self, task: Node) -> list[Node]:
        found: list[Node] = []
        waiting = [task]
        for plan in waiting:
            for sub in self.values(plan, KNOWROB.subAction):
                if sub not in found:
                    found.append(sub)
                    waiting.append(sub)
        return found

    def required_capabilities(self, task: Node) -> set[Node]:
        own = self.values(task, CAP.dependsOnCapability)
        deeper = [one for capability in own for one in self.values(capability, CAP.dependsOnCapability)]
        below = [one for sub in self.sub_actions(task) for one in self.values(sub, CAP.dependsOnCapability)]
        return {*own, *deeper, *below}

    def required_components(self, task: Node, capabilities: set[Node]) -> set[Node]:
        needing = [task, *self.sub_actions(task), *capabilities]
        return {one for cls in needing for one in self.values(cls, COMP.dependsOnComponent)}

    def has_capability(self, robot: Node, capability: Node, asked: tuple[Node, ...]) -> bool:
        if capability in asked or not self.is_of(robot, KNOWROB.Robot):
            return False
        if any(capability in self.supers(one) for one in self.facts(robot, CAP.hasCapability)):
            return True
        if CAP.Capability not in self.supers(capability) or capability == CAP.Capability:
            return False
        kinds = [kind for cls in self.graph.objects(robot, RDF.type) for kind in self.supers(cls)]
        robots = [kind for kind in kinds if KNOWROB.Robot in self.supers(kind)]
        if any(capability in self.supers(one) for kind in robots for one in self.values(kind, CAP.hasCapability)):
            return True
        return self.kinds.issuperset(self.values(capability, COMP.dependsOnComponent)) and all(
            self.has_capability(robot, one, (*asked, capability))
            for one in self.values(capability, CAP.dependsOnCapability)
        )

    def parts(self, robot: Node, robot_graph: Graph) -> set[Node]:
        """Return what the robot has directly and along its chains, and the compositions that span a stretch of them."""
        found = [robot]
        for one in found:
            found += [part for part in self.facts(one, COMP.subComponent) if part not in found]
        spans = (COMP.baseLinkOfComposition, COMP.endLinkOfComposition)
        compositions = {one for prop in spans for one in robot_graph.subjects(prop)}
        return {*found[1:], *compositions} - {robot}

    def facts(self, thing: Node, prop: Node) -> Iterator[Node]:
        for stated, value in self.graph.predicate_objects(thing):
            if prop in self.above(stated):
                yield value

    def is_of(self, thing: Node, cls: Node) -> bool:
        return any(cls in self.supers(kind) for kind in self.graph.objects(thing, RDF.type))


def local(term: Node) -> str:
    return "expression" if isinstance(term, BNode) else str(term).rsplit("#")[-1]
