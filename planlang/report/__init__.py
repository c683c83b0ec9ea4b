"""One HTML file that explains a run: actions, times, resources, and the causes of failures.

General layout: ``tree`` (nodes and lanes of a run), ``failures`` (causes and attempted recoveries), ``story`` (the run
in sentences), ``sources`` (lines of plan and recipe), ``graph`` (the recipe's steps), ``model`` (all of it as one JSON
object, docs/guides/report.md), ``html`` (the file, from ``page/``). ``executive.report`` adds scene, map and poses.
"""

from planlang.report.html import page
from planlang.report.model import Context, Told, model_of

__all__ = ["Context", "Told", "model_of", "page"]
