"""What planlang does, as functions of options: run, locate, sweep, compare, check, compile, and why a run failed.

Options are dataclasses whose fields are declared once (:mod:`executive.options`). Two faces are made from these
functions: the command line (``executive.cli``), and the functions of ``planlang`` with keyword arguments
(``executive.keywords``). All raise BadInput for options and files that cannot be used.

A function's module is imported on its first use: to compile a recipe loads no robot, to run a plan no compiler.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from executive.commands.check import check
    from executive.commands.compare import compared as compare
    from executive.commands.compile import compiled as compile
    from executive.commands.run import run
    from executive.commands.sweep import swept as sweep
    from executive.runs.locating import locate
    from executive.why.explaining import why
else:  # with a __getattr__ in its sight, mypy would accept any name
    from pkgutil import resolve_name

    _FUNCTIONS = {
        "check": "executive.commands.check:check",
        "compare": "executive.commands.compare:compared",
        "compile": "executive.commands.compile:compiled",
        "locate": "executive.runs.locating:locate",
        "run": "executive.commands.run:run",
        "sweep": "executive.commands.sweep:swept",
        "why": "executive.why.explaining:why",
    }

    def __getattr__(name: str) -> object:
        if name not in _FUNCTIONS:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return resolve_name(_FUNCTIONS[name])  # late, as said above


__all__ = ["check", "compare", "compile", "locate", "run", "sweep", "why"]
