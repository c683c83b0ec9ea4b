"""Triples -> text, in every syntax that is read.

General layout: ``convert`` reads, writes and compares; ``manchester_writer`` (with ``expression_text``) writes frames,
``nested_writers`` Turtle, N-Triples and RDF/XML; ``canonical`` puts triples into an order that does not depend on
labels, and shortens IRIs.
"""
