"""OWL files -> one consistent in-memory ontology with positions.

General layout: ``documents`` finds and reads files (``syntaxes`` tells ``rdfxml``, ``turtle`` and ``manchester`` apart;
``imports``, ``cache``); ``canonical``, ``repairs`` and ``structure`` make their triples alike or say what is wrong with
them; ``ontology`` answers questions about them (``classes``, ``taxonomy``); ``checks`` says what only shows when all
are read. ``terms`` holds names and values, ``writing`` writes them again. Nothing is ever fetched from the network.
"""

from planlang.ontology.classes import Restriction
from planlang.ontology.documents import Document
from planlang.ontology.ontology import Ontology, load
from planlang.ontology.terms import BNode, Literal, Term, Triple, expand, shorten

__all__ = ["BNode", "Document", "Literal", "Ontology", "Restriction", "Term", "Triple", "expand", "load", "shorten"]
