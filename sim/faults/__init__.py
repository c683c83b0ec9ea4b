"""Faults in a simulated world: what the kinds of :mod:`planlang.faults` do to it.

:class:`~sim.faults.injection.Injection` belongs to one run, and draws what goes wrong. The robot (``faulty_robot.py``)
decorates the interface by which the world is commanded and sensed; the world (``faulty_world.py``) asks whether a
device switches and whether a person heeds an offer. ``motions.py``, ``grippers.py``, ``looks.py``, ``handles.py``,
``offers.py`` and ``things.py`` each have the kinds of some opportunities: what they need in order to happen, and what
they do.
"""
