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

from planlang.ontology.classes import Restriction as Restriction
from planlang.ontology.ontology import Ontology as Ontology
from planlang.ontology.ontology import load as load
from planlang.ontology.ontology import load_apart as load_apart
from planlang.ontology.terms import BNode as BNode
from planlang.ontology.terms import Literal as Literal
from planlang.ontology.terms import Term as Term
from planlang.ontology.terms import Triple as Triple
from planlang.ontology.terms import expand as expand
from planlang.ontology.terms import shorten as shorten
