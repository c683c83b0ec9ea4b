"""The compiler from recipes to plans in Python.

General layout: ``lowering`` turns recipes into the ``tree`` of a plan, with ``structure`` (order of the steps) and
``terms`` (their arguments and resources). ``compile`` is the entry point, and writes the tree as source with ``bodies``
(of functions), ``expressions`` (and names) and ``layout`` (lines); ``drawing`` draws the order of steps.
"""

from planlang.compiler.compile import CompiledPlan, compile_ontology, compile_recipe

__all__ = ["CompiledPlan", "compile_ontology", "compile_recipe"]
