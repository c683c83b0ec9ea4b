"""Triples -> text, in every syntax that is read.

General layout: ``convert`` reads, writes and compares; ``manchester_writer`` (with ``sections``, ``expression_text``),
``turtle_writer`` and ``rdfxml_writer`` write a syntax each; ``nodes`` puts triples into an order that does not depend
on labels, ``names`` shortens IRIs.
"""
