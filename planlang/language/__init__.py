"""The plan language: the constructs that plans are written with, on top of the kernel.

General layout: ``branches`` runs branches in sequence or concurrently, ``ordering`` in a partial order, and
``state_machine`` as states. ``budgets`` limits the time and the attempts of a body, ``conditions`` adds goals and
policies to it, ``recovery`` handles its failures with the strategies of ``planlang.recoveries``, and ``tidying`` closes
the doors that these have opened. ``plans`` defines plan functions and the named tasks in them, with handles to suspend
and evaporate them. ``executive`` is the interface to a robot; ``performing`` (with the ``resources`` that actions need)
and ``location`` act through it. ``running`` runs a plan, ``replaying`` replays a recorded run, and ``tasktree`` reads
the tree of a run from its trace.
"""
