"""Fixes of recipes that are safe to make in their text, and some that a person has to accept.

General layout: ``proposals`` and ``removals`` tell from the diagnostics and their suggestions what should be changed;
``manchester_text`` and ``xml_text`` make text edits (``edits``) of it; ``fixing`` tries them one after the other and
keeps those that help.
"""

from planlang.recipe.fixes.edits import Fix
from planlang.recipe.fixes.fixing import Fixed, fix_recipe

ACCEPTABLE = ("R010", "R011", "R020", "R033", "R038", "R040", "R045", "R046", "R049", "R050", "R058")
"""Codes of fixes that may be guesses, which are made only if they are accepted."""

__all__ = ["ACCEPTABLE", "Fix", "Fixed", "fix_recipe"]
