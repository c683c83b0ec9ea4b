"""Why a run failed: the smallest change of map, recipe or call after which a whole rerun reaches the goal.

``evidence`` reads the trace, ``candidates`` makes the changes, ``costs`` says how small each is, ``free_places`` which
of them there is room for, ``reruns`` runs them in workers of a sweep, ``searching`` decides which are run,
``explaining`` says what was found, ``wording`` in words, and ``both_runs`` on a page.
"""
