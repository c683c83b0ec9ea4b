"""Options, each declared once: as a field of a dataclass, with what every face needs to know of it.

General layout: ``declaring`` has the declaration and reads values from text, ``running`` and ``recipes`` declare the
options of :mod:`executive.api`. What follows from the declarations: the command line
(``executive.cli.command_lines``), the keyword arguments of Python (``executive.keywords``), the header of a trace and
its check when a run is resumed, the calls in advice, and the worlds of a sweep.
"""
