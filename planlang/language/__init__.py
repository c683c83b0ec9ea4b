"""The plan language: the constructs that plans are written with, on top of the kernel.

General layout: ``branches`` checks what constructs are given and runs branches one after another; ``parallel``,
``ordering`` and ``machine`` run them side by side, in a partial order, as states. ``budgets`` bounds the time and the
attempts of one body, ``policies`` and ``goals`` its conditions, ``recovery`` handles its failures. ``tags`` names,
suspends and evaporates tasks; ``plans`` marks plan functions. ``executive`` says what a robot has to offer; through it
act ``performing``, ``location`` and ``resources``. ``running`` runs a plan; ``tasktree`` reads what happened from a
trace.
"""
