"""Why a run failed: the smallest change of map, recipe or call after which a whole rerun reaches the goal.

``evidence`` reads the trace, ``candidates`` makes the changes, ``costs`` says how small each is, ``rerun`` runs one in
a worker of a sweep, ``searching`` decides which are run, and ``answer`` says what was found.
"""
