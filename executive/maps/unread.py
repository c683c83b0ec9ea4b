"""What a map states and cannot be read, misspelt properties among it: an error, unless the user goes on without it.

Unread is whatever has a shape or a pose and is not in the world as the map states it: an obstacle that nobody sees, a
thing at another place. Where a map states no shape at all, nothing is unread: the object is a mere place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from executive.maps import soma
from executive.maps.link_names import LINKS
from executive.maps.measures import EXTENTS
from planlang.designators import local_name, local_part
from planlang.diagnostics import BadInput, Diagnostic, Severity, has_errors, unread
from planlang.ontology import Ontology
from planlang.spelling import Spellings

ALIKE = 0.9
"""Least similarity (difflib) of a misspelt property and a known one: a letter too many, or two that are swapped."""
KNOWROB = (
    *EXTENTS, "describedInMap", "objectActedOn", "eventOccursAt", "startTime", "orientation", "translation",
    "quaternion", "relativeTo", "properPhysicalParts", "properPhysicalPartOf", "physicalParts", "physicalPartOf",
    "hingedTo", "connectedTo-Rigidly", "in-ContGeneric", "on-Physical", "jointPosition", "minJointValue",
    "maxJointValue", "linkToMapFile", "pathToCadModel", "massOfObject", "weightOfObject", "areaOfObject",
)  # fmt: skip
"""Properties of KnowRob's maps that are read, of which a statement is lost if it is misspelt.

The vocabulary does not tell them from others: nine of them have no domain there, and a hundred others, such as
nextEvent and streetNumber, have the domains of the rest. An undeclared property that is nearly one of those loses
nothing.
"""


def settled(found: Iterable[Diagnostic], *, ignore_unread: bool) -> list[Diagnostic]:
    """Return the diagnostics of reading a map; with ``ignore_unread``, its errors are warnings.

    Otherwise raises BadInput with all of them if one is an error.
    """
    found = list(found)
    if not ignore_unread and has_errors(found):
        raise BadInput(found)
    return [replace(one, severity=Severity.WARNING) if one.severity is Severity.ERROR else one for one in found]


def misspellings(ontology: Ontology) -> Iterator[Diagnostic]:
    """Report the properties in use that nothing declares and that are nearly those of maps, each once."""
    words = Spellings((*KNOWROB, *LINKS, *soma.READ))
    for number in ontology.store.used:
        iri = ontology.store.name(number) or ""
        name = local_part(iri)
        alike = words.similar(name, least=ALIKE)
        if not alike or alike[0] == name or ontology.is_property(iri):
            continue
        first = next(ontology.triples(None, iri))
        of = f" of {local_name(first.subject)}" if isinstance(first.subject, str) else ""
        yield unread("M036", f"{name}{of} is no property that maps have", first.span, f"did you mean {alike[0]}?")
