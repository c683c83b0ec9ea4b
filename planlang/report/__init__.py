"""One HTML file that explains a run: what was done, when, with what, and why it ended as it did.

General layout: ``tree`` (nodes and lanes of a run), ``failures`` (why something failed, and what was tried), ``story``
(the run in sentences), ``sources`` (lines of plan and recipe), ``graph`` (the recipe's steps), ``model`` (all of it as
one JSON object, docs/guides/report.md), ``html`` (the file, from ``page/``). Whoever has a world adds scene, map and
poses: ``executive.report``.
"""

from planlang.report.html import page
from planlang.report.model import Context, Told, model_of

__all__ = ["Context", "Told", "model_of", "page"]
