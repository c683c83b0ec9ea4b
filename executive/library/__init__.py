"""planlang as a library: its functions take the options of the commands, and return what can be asked and shown.

General layout: ``functions`` has them; ``arguments`` makes arguments of a command from values of Python, by the
declaration that the command line has; ``sources`` takes recipes and plans by name, path or text; ``checked`` is the
result of a check. Everything else is done by what the commands call, too. ``planlang`` exposes the functions.
"""

from executive.library.functions import check, compile, locate, simulate, sweep

__all__ = ["check", "compile", "locate", "simulate", "sweep"]
