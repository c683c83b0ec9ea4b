"""Triples -> text, in every syntax that is read."""
