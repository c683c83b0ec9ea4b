"""The compiler from recipes to plans in Python.

General layout: ``compile`` is the way in; ``lowering`` turns recipes into the ``tree`` of a plan, with ``structure``
(how steps follow each other), ``terms`` (what they are about, and which resources they hold) and ``recoveries``;
``emit`` writes the tree as source, with ``names``, ``bodies`` (of functions), ``expressions`` and ``layout`` (lines);
``drawing`` draws what was compiled.
"""

from planlang.compiler.compile import CompiledPlan, compile_ontology, compile_recipe

__all__ = ["CompiledPlan", "compile_ontology", "compile_recipe"]
