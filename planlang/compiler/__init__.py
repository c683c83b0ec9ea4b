"""The compiler from recipes to plans in Python.

General layout: ``lowering`` turns recipes into the ``tree`` of a plan, with ``structure`` (how steps follow each other)
and ``terms`` (what they are about, and which resources they hold); ``compile`` is the way in, and writes the tree as
source with ``bodies`` (of functions), ``expressions`` (and names) and ``layout`` (lines); ``drawing`` draws what was
compiled.
"""

from planlang.compiler.compile import CompiledPlan, compile_ontology, compile_recipe

__all__ = ["CompiledPlan", "compile_ontology", "compile_recipe"]
