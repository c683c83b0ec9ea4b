"""A small reference model of the plan language: what a tree of constructs does, computed without tasks or coroutines.

A :class:`Strand` stands for a task. It goes through one tree, whose nodes say with ``run()`` what they have come to:
an outcome, or None when they wait. Time passes only when nothing can happen any more (:meth:`World.advance`). What is
computed: who is held, evaporating or dead at each moment, and with what outcome each tree ends.

The model knows a decision only as "all below has come to rest": it is for trees whose branches share nothing, where
the order of tasks within a round makes no difference.
"""

from reference_model import constructs
from reference_model.tasks import Outcome, Tree, World

__all__ = ["Outcome", "Tree", "World", "constructs"]
