"""The world on the page of a run: poses over time, shapes, the floor plan, searches for base poses.

General layout: ``tracks`` (poses over time, true and believed), ``shapes`` (geometry of bodies and links),
``places`` (searches for base poses, with rejected candidates and reasons), ``watching`` (collects all of these during a
run). The page itself, and everything that comes from the trace, is ``planlang.report``.
"""
