"""OWL files -> one consistent in-memory ontology with positions.

General layout: ``documents`` reads a file and what it imports (``imports``) in one of three syntaxes (``rdfxml``,
``turtle``, ``manchester``); ``repairs`` makes their triples alike, ``checks`` reports what is wrong with them;
``ontology`` answers questions about all of them (``classes``). ``terms`` holds names and values, ``triples`` stores
what is stated, ``writing`` writes it again. Nothing is ever fetched from the network.
"""

from planlang.ontology.classes import Restriction
from planlang.ontology.documents import Document
from planlang.ontology.ontology import Ontology, load
from planlang.ontology.terms import BNode, Literal, Term, Triple, expand, shorten

__all__ = ["BNode", "Document", "Literal", "Ontology", "Restriction", "Term", "Triple", "expand", "load", "shorten"]
