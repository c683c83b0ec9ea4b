"""Triples -> text, in every syntax that is read.

General layout: ``convert`` reads, writes and compares; ``manchester`` (with ``frames``, ``expressions``, ``graph``),
``turtle``, ``rdfxml`` and ``ntriples`` write one syntax each; ``nodes`` puts triples into an order that does not depend
on labels, ``names`` shortens IRIs.
"""

from planlang.ontology.writing.convert import Converted, Target, convert, write

__all__ = ["Converted", "Target", "convert", "write"]
