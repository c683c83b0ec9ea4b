"""Readers of the dialects in which recipes are written; each yields the same statements.

General layout: one file for each dialect. ``partial_order`` reads classes with sub-actions and ordering constraints,
in an intersection, flat or equivalent, as ``subAction`` or ``subEvents`` (D1, D1f, D1e, D2), ``finite_state`` classes
with states and transitions (D3), ``action_table`` individuals chained by ``nextAction`` (D4), ``workflow`` individuals
with ``hasStep`` and relations of intervals (D5); ``data_flow`` what any of them says about inputs and outputs. A
dialect is told by what a class or an individual states, so that one file may mix them.
"""

from planlang.recipe.readers.reader import READERS, Reader, statements_of, tasks_of

__all__ = ["READERS", "Reader", "statements_of", "tasks_of"]
