"""What planlang does, as functions of options: run, locate, sweep, check, compile.

Options are dataclasses whose fields are declared once (:mod:`executive.options`). Two faces are made from these
functions: the command line (``executive.cli``), and the functions of ``planlang`` with keyword arguments
(``executive.keywords``). All raise BadInput for options and files that cannot be used.

Each function imports what it needs: to compile a recipe loads no robot, to run a plan no compiler.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from planlang.progress import Report, Waiting, unreported, unwatched

if TYPE_CHECKING:
    from executive.commands.checked import CheckResult
    from executive.options.recipes import CheckOptions, CompileOptions
    from executive.options.running import LocateOptions, RunSettings, SweepOptions
    from executive.runs.located import Located
    from executive.runs.options import RunResult
    from executive.sweeps import Row
    from executive.sweeps.records import Done
    from planlang.compiler import CompiledPlan
    from planlang.diagnostics import Diagnostic


def run(options: RunSettings) -> RunResult:
    """Run a plan or a recipe in a simulated world; a failed plan is a result, too.

    :class:`~executive.runs.options.RunOptions` has observers besides.
    """
    from executive.runs.options import RunOptions  # as said at the top, here and below
    from executive.runs.plan_run import run_plan_file

    return run_plan_file(options if isinstance(options, RunOptions) else RunOptions.of(options))


def locate(options: LocateOptions, *, long_work: Report = unreported, waiting: Waiting = unwatched) -> Located:
    """Find poses that match a phrase, and draw the candidates; ``explain`` also writes the drawing.

    ``long_work`` gets the progress of building reachability maps; ``waiting`` is entered while poses are searched.
    """
    from executive.runs.locating import locate as located

    found = located(options, long_work=long_work, waiting=waiting)
    if options.explain is not None and found.sheet is not None:
        found.picture(options.explain, force=True)
    return found


def sweep(
    options: SweepOptions,
    *,
    announce: Callable[[Sequence[Diagnostic]], object] = lambda found: None,
    finished: Callable[[Done], object] = lambda done: None,
    resumed: Callable[[Sequence[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Run a plan or a recipe in many worlds; gives a row for each, in their order.

    ``announce`` gets diagnostics before the first world, ``resumed`` the rows of an earlier call, ``finished`` each
    world that is done.
    """
    from executive.commands.sweep import swept

    return swept(options, announce=announce, finished=finished, resumed=resumed)


def check(options: CheckOptions, *, report: Report = unreported, waiting: Waiting = unwatched) -> CheckResult:
    """Check a recipe, a plan, a map or a folder of recipes, or fix a recipe; nothing is run.

    ``report`` gets the progress through a folder; ``waiting`` is entered while a reasoner runs.
    """
    from executive.commands.check import check as checked

    return checked(options, report=report, waiting=waiting)


def compile(options: CompileOptions) -> CompiledPlan:
    """Compile a recipe to a plan in Python, and write the files that the options name.

    Its diagnostics are warnings and notes, and an error for each conflict that a merge left in the plan.
    """
    from executive.commands.compile import compiled

    return compiled(options)
