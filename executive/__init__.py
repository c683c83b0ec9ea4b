"""Grounds and runs plans with a robot in a world; the outermost layer, and the only one that a user starts.

General layout: ``cli`` is the command; ``inputs``, ``outputs`` and ``console`` are its edges to files and people.
``running`` puts a run together from ``knowledge`` (what is believed), ``locations`` (where to stand and reach),
``motion`` (how to get there), ``process_modules`` (who does it) and ``capabilities`` (whether the robot can).
``report`` records what happened.
"""
