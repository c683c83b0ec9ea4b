"""OWL files -> one consistent in-memory ontology with positions.

General layout: ``documents`` finds and reads files (``rdfxml``, ``manchester``, ``imports``, ``cache``), ``canonical``
and ``repairs`` make their triples alike, ``ontology`` answers questions about them (``classes``, ``taxonomy``),
``checks`` says what is wrong. ``terms`` holds names and values. Nothing is ever fetched from the network.
"""

from planlang.ontology.classes import Restriction
from planlang.ontology.documents import Document
from planlang.ontology.ontology import Ontology, load
from planlang.ontology.terms import BNode, Literal, Term, Triple, expand, shorten

__all__ = ["BNode", "Document", "Literal", "Ontology", "Restriction", "Term", "Triple", "expand", "load", "shorten"]
