"""Fixes of recipes that are safe to make in their text, and some that a person has to accept.

General layout: ``proposals`` tells from the diagnostics' own questions what should be changed; ``manchester_text`` and
``xml_text`` make text edits (``edits``) of it; ``fixing`` tries them one after the other and keeps those that help.
"""

from planlang.recipe.fixes.fixing import Fixed, fix_recipe
from planlang.recipe.fixes.proposals import Fix

ACCEPTABLE = ("R010",)
"""Codes of fixes that are made only if they are accepted."""

__all__ = ["ACCEPTABLE", "Fix", "Fixed", "fix_recipe"]
