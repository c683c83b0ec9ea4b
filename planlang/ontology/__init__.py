"""OWL files -> one consistent in-memory ontology with positions.

General layout: ``documents`` reads a file and what it imports in one of three syntaxes (``rdfxml``, ``turtle``,
``manchester``); ``checks`` corrects known mistakes in the triples and reports the others; ``ontology`` answers
questions about all documents (``classes``). ``terms`` holds names and values, ``triples`` stores what is stated,
``convert`` reads, writes and compares: ``manchester_writer`` (with ``expression_text``) writes frames,
``nested_writers`` Turtle, N-Triples and RDF/XML; ``canonical`` puts triples into an order that does not depend on
labels, and shortens IRIs. Nothing is ever fetched from the network.
"""

from planlang.ontology.classes import Restriction
from planlang.ontology.ontology import Ontology, load
from planlang.ontology.terms import BNode, Literal, Term, Triple, expand, shorten

__all__ = ["BNode", "Literal", "Ontology", "Restriction", "Term", "Triple", "expand", "load", "shorten"]
