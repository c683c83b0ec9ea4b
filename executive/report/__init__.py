"""The world in the page of a run: poses over time, shapes, the map from above, places that were looked at.

General layout: ``tracks`` (poses over time, true and believed), ``shapes`` (what bodies and links look like),
``places`` (searches for base poses, with what was rejected and why), ``watching`` (looks on while a run goes on).
The page itself, and all that a trace tells, is ``planlang.report``.
"""
