"""Compiles recipes to plans in Python.

General layout: ``compile`` is the way in; ``lowering`` turns recipes into the ``tree`` of a plan, with ``scopes`` (what
happens where), ``terms`` (what it happens to) and ``recoveries``; ``emit`` writes the tree as source, with ``symbols``
(names), ``statements`` (bodies) and ``layout`` (lines).
"""

from planlang.compiler.compile import CompiledPlan, compile_ontology, compile_recipe

__all__ = ["CompiledPlan", "compile_ontology", "compile_recipe"]
