"""planlang as a library: its functions take the options of the commands, and return results to query and show.

General layout: ``recipes`` and ``worlds`` have the functions, which ``planlang`` exposes; ``arguments`` makes arguments
of a command from Python values, by the declarations that the command line reads, too; ``sources`` takes recipes and
plans by name, path or text; ``checked`` is the result of a check. ``executive.commands`` does the work.
"""
