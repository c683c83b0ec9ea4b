"""Fixes of recipes that are safe to make in their text, and some that a person has to accept.

General layout: ``proposals`` and ``removals`` tell from the diagnostics and their suggestions what should be changed;
``manchester_text`` and ``xml_text`` make text edits (``edits``) of it; ``fixing`` tries them one after the other and
keeps those that help. ``codes`` says which codes have fixes, and why the others have none.
"""

from planlang.recipe.fixes.codes import ACCEPTABLE, SAFE, WITHOUT
from planlang.recipe.fixes.edits import Fix
from planlang.recipe.fixes.fixing import Fixed, fix_recipe

__all__ = ["ACCEPTABLE", "SAFE", "WITHOUT", "Fix", "Fixed", "fix_recipe"]
