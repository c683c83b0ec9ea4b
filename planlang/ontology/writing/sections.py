"""Define the parts of a file in Manchester syntax: frames, their sections, and the property that each states."""

from __future__ import annotations

from dataclasses import dataclass, field

from planlang.ontology.terms import OWL, RDF, RDFS, XSD

WIDTH = 120
"""Characters of a line that holds more than one item."""

FRAMES = {
    OWL.AnnotationProperty: "AnnotationProperty",
    RDFS.Datatype: "Datatype",
    OWL.ObjectProperty: "ObjectProperty",
    OWL.DatatypeProperty: "DataProperty",
    OWL.Class: "Class",
    OWL.NamedIndividual: "Individual",
}
"""Kind of thing -> the word that begins its frame, in the order of the file."""

PROPERTIES = ("ObjectProperty", "DataProperty", "AnnotationProperty")
SECTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    OWL.equivalentClass: ("EquivalentTo", ("Class", "Datatype")),
    RDFS.subClassOf: ("SubClassOf", ("Class",)),
    OWL.disjointWith: ("DisjointWith", ("Class",)),
    RDFS.subPropertyOf: ("SubPropertyOf", PROPERTIES),
    OWL.equivalentProperty: ("EquivalentTo", ("ObjectProperty", "DataProperty")),
    OWL.propertyDisjointWith: ("DisjointWith", ("ObjectProperty", "DataProperty")),
    OWL.inverseOf: ("InverseOf", ("ObjectProperty",)),
    RDFS.domain: ("Domain", PROPERTIES),
    RDFS.range: ("Range", PROPERTIES),
    OWL.sameAs: ("SameAs", ("Individual",)),
    OWL.differentFrom: ("DifferentFrom", ("Individual",)),
}
"""Property -> the section that states it, and the frames that have it; the value is an expression or a name."""

LISTS: dict[str, tuple[str, str, str]] = {
    OWL.disjointUnionOf: ("DisjointUnionOf", "Class", ", "),
    OWL.hasKey: ("HasKey", "Class", " "),
    OWL.propertyChainAxiom: ("SubPropertyChain", "ObjectProperty", " o "),
}
"""Property -> its section, its frame, and what stands between the items of its list."""

CHARACTERISTICS = {
    f"{OWL}{name}Property": name
    for name in ("Functional", "InverseFunctional", "Reflexive", "Irreflexive", "Symmetric", "Asymmetric", "Transitive")
}
ORDER = ("Annotations", "Types", "Facts", "Characteristics", "SubClassOf", "EquivalentTo", "DisjointWith",
         "DisjointUnionOf", "HasKey", "SubPropertyOf", "SubPropertyChain", "InverseOf", "Domain", "Range", "SameAs",
         "DifferentFrom")  # fmt: skip
"""Sections in the order of a frame."""

SINGLE = ("DisjointUnionOf", "HasKey", "SubPropertyChain")
"""Sections of one item each; a datatype's EquivalentTo is another."""

SEVERAL = {
    "AllDisjointClasses": "DisjointClasses",
    "AllDisjointProperties": "DisjointProperties",
    "AllDifferent": "DifferentIndividuals",
}
PAIRS = {
    OWL.sameAs: "SameIndividual",
    OWL.differentFrom: "DifferentIndividuals",
    OWL.equivalentClass: "EquivalentClasses",
    OWL.disjointWith: "DisjointClasses",
    OWL.equivalentProperty: "EquivalentProperties",
    OWL.propertyDisjointWith: "DisjointProperties",
}
ANNOTATING = frozenset(
    (*(RDFS + name for name in ("label", "comment", "seeAlso", "isDefinedBy")),
     *(OWL + name for name in ("versionInfo", "deprecated", "priorVersion", "backwardCompatibleWith",
                               "incompatibleWith")))
)  # fmt: skip
LANGUAGES = (OWL, RDF, RDFS, XSD)


@dataclass(slots=True)
class Frame:
    """One frame: its heading, and the items of its sections; an annotated item has a section of its own.

    The Note lets it stand in the middle of others; not every reader does.
    """

    word: str
    heads: list[str]
    sections: dict[str, list[str]] = field(default_factory=dict)

    def text(self) -> str:
        lines = [f"{self.word}: {head}" for head in self.heads]
        for name in ORDER:
            if items := sorted(self.sections.get(name, ()), key=lambda item: (" " in item, item)):
                single = name in SINGLE or (self.word, name) == ("Datatype", "EquivalentTo")
                alone = [item for item in items if single or item.startswith("Annotations: ")]
                together = [item for item in items if item not in alone]
                lines += [section(name, group) for group in (together, *([item] for item in alone)) if group]
        return "\n".join(lines) + "\n"


def section(name: str, items: list[str]) -> str:
    """Return a section on one line if it fits or has one item, else with a line for each item."""
    line = f"    {name}: {', '.join(items)}"
    if not items[1:] or (len(line) <= WIDTH and "\n" not in line):
        return line
    return f"    {name}:\n        " + ",\n        ".join(items)
