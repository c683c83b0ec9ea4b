"""Faults: events of the world and of a robot's interface that are given from outside, named or by chance.

General layout: ``kinds`` is the table of what can go wrong, and at which opportunities; ``named`` is the grammar in
which faults are stated, ``stated`` all that is stated for a run; ``drawing`` decides at each opportunity what goes
wrong there. What a fault does to a simulated world is in :mod:`sim.faults`.
"""
