"""OWL files -> one consistent in-memory ontology with positions.

General layout: ``documents`` reads a file and its imports (``imports``, ``catalog``) in one of five syntaxes
(``rdfxml``, ``turtle``, ``manchester``, ``functional``, ``owlxml``; ``urdf_world`` and ``map_file`` read worlds and
sensed maps). ``axioms`` states axioms as triples, for the ``frames`` of Manchester syntax and the ``structures`` that
functional syntax and OWL/XML share; ``parsing`` keeps lark's parsers. ``checks`` repairs known mistakes in the triples
and reports the others; ``ontology`` answers queries over all documents (``classes``: class expressions); ``naming``
makes readable names from labels.
``terms`` has IRIs and literals, ``triples`` the store. ``convert`` reads, writes and compares: ``manchester_writer``
(with ``expression_text``) writes frames, ``functional_writer`` axioms, ``nested_writers`` Turtle, N-Triples and
RDF/XML; ``canonical`` sorts triples independently of blank-node labels, and shortens IRIs. ``reasoning`` runs HermiT or
Pellet. Nothing is ever fetched from the network.
"""

from planlang.ontology.classes import Restriction
from planlang.ontology.ontology import Ontology, load, load_apart
from planlang.ontology.terms import BNode, Literal, Term, Triple, expand, shorten

__all__ = [
    "BNode",
    "Literal",
    "Ontology",
    "Restriction",
    "Term",
    "Triple",
    "expand",
    "load",
    "load_apart",
    "shorten",
]
