"""The plan language: the constructs that plans are written with, on top of the kernel.

General layout: ``branches`` checks what constructs are given and runs branches one after another or side by side,
``ordering`` and ``state_machine`` run them in a partial order and as states. ``budgets`` bounds the time and the
attempts of one body, ``conditions`` are its goals and policies, ``recovery`` handles its failures, with the strategies
of ``planlang.recoveries``. ``plans`` has plan functions, names tasks in them and stops these. ``executive`` says what a
robot has to offer; through it act ``performing``, with the resources that actions take, and ``location``. ``running``
runs a plan, ``replaying`` repeats a recorded run; ``tasktree`` reads what happened from a trace.
"""
