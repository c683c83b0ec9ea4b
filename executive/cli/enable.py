"""``planlang enable``: download what a robot lacks for a task from a knowledge base, and run the task."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

from executive.cli import run
from executive.cli.arguments import EnableArguments, RunArguments
from executive.cli.console import Answer, ExitCode, say, show
from executive.cli.match import possessions_in
from executive.enabling.explanation import Explanation
from executive.enabling.needs import Enabling
from executive.enabling.shelf import open_shelf
from executive.enabling.stock import Folder, Stock
from executive.modules.bundled import performed_by
from executive.options.declaring import Name, names
from executive.runs.files import check_files, check_trusted, chosen, environments, refuse
from planlang.diagnostics import BadInput, Diagnostic, error, warning
from planlang.files import Bundled
from planlang.knowledge.entries import Kind, Unusable
from planlang.knowledge.places import LEVELS


def command(arguments: EnableArguments) -> Answer:
    """Explain what is missing, download it, and run the task if the user wants it. Raises BadInput."""
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf, modules=arguments.modules)
    check_trusted(problems, arguments.modules or (), trust=arguments.trust)
    robot = chosen(Bundled.ROBOT, arguments.robot, None, problems, needs="what is missing depends on the robot: enable")
    maps = environments(names(arguments.environment or ()), problems)
    if arguments.source is None:
        problems.append(error("K030", "no server was named", help="add --from URL, or set PLANLANG_SERVER"))
    refuse(problems)
    assert robot is not None
    assert arguments.source is not None
    possessions = possessions_in(robot, arguments.urdf, arguments.folders, problems)
    folder = Folder.read(arguments.store or Path(f"{possessions.robot}_knowledge"))
    with _usable(arguments.source), closing(open_shelf(arguments.source, arguments.folders)) as shelf:
        enabling = Enabling(
            possessions,
            Stock(shelf, folder, arguments.folders, arguments.limit, ignore_unread=arguments.ignore_unread),
            performed_by(arguments.modules or (), problems),
            next(iter(maps), None),
            {level: text for level in LEVELS if (text := getattr(arguments, level)) is not None},
        )
        explanation, reply = _explained(arguments, enabling)
        reply = replace(reply, diagnostics=(*problems, *reply.diagnostics, *shelf.diagnostics()))
    return _with_run(arguments, explanation, folder, reply) if arguments.run and not arguments.dry else reply


@contextmanager
def _usable(source: str) -> Iterator[None]:
    """Raise BadInput if the file of a store turns out to be damaged or locked."""
    try:
        yield
    except Unusable as problem:
        raise BadInput([problem.diagnostic(source)]) from None


def _explained(arguments: EnableArguments, enabling: Enabling) -> tuple[Explanation, Answer]:
    """Explain whether the robot can do the task, and download what is missing; the answer lists the files."""
    if not arguments.recipe.strip():
        raise BadInput([error("C001", "the name of the task is empty")])
    path = Path(arguments.recipe)
    is_file = os.path.isfile(path)
    root = enabling.given_task(path, arguments.task) if is_file else enabling.task(arguments.recipe)
    explanation = Explanation(enabling, enabling.combination(root))
    lines, data = [*explanation.tree().lines()], explanation.as_json()
    if explanation.combination.unmet:
        lines += explanation.verdict()
        return explanation, Answer(ExitCode.MISSING_CAPABILITY, (), "\n".join(lines), data)
    entries = explanation.taken() if not arguments.dry else ()
    written = enabling.stock.folder.take(entries, enabling.stock.shelf)
    warned = tuple(a_program(file, enabling.url) for file in written if file.suffix.lower() == ".py")
    lines += [f"wrote {file}" for file in written]
    return explanation, Answer(ExitCode.DONE, warned, "\n".join(lines), {**data, "written": [*map(str, written)]})


def a_program(file: Path, source: str) -> Diagnostic:
    """Warning that a downloaded file is a program."""
    return warning("K038", f"{file} is a program, from {source}", help="it runs only with --trust: read it first")


def _with_run(arguments: EnableArguments, explanation: Explanation, folder: Folder, reply: Answer) -> Answer:
    """Run the task unless something is missing, and merge the answers."""
    if reply.exit_code is not ExitCode.DONE:
        return reply
    if not arguments.json:
        show(reply.diagnostics, arguments.detail)
        say(reply.text)
    result = _run(arguments, explanation, folder)
    before = reply.diagnostics if arguments.json else ()
    return replace(result, diagnostics=(*before, *result.diagnostics), data={**reply.data, **result.data})


def _run(arguments: EnableArguments, explanation: Explanation, folder: Folder) -> Answer:
    """Run the task with the recipes, the maps and the models of the folder."""
    used = [one.entry for one in explanation.entries()]
    *further, recipe = [folder.file(one) for one in used if one.kind is Kind.RECIPE] or [Path(arguments.recipe)]
    is_own = os.path.isfile(arguments.recipe)
    about = next((one.about for one in reversed(used) if one.kind is Kind.RECIPE), None)
    maps: list[Name] = [folder.file(one) for one in explanation.maps()]
    run_arguments = RunArguments(
        recipe=arguments.recipe if is_own else recipe,
        task=arguments.task if is_own else about,
        robot=arguments.robot,
        urdf=arguments.urdf,
        environment=arguments.environment or maps,
        models=[path for kind in (Kind.OBJECT, Kind.ENVIRONMENT) if (path := folder.path / kind.value).is_dir()],
        modules=arguments.modules,
        trust=arguments.trust,
        ignore_unread=arguments.ignore_unread,
        ontologies=arguments.ontologies,
        set=arguments.set,
        start=arguments.start,
        seed=arguments.seed,
        trace=arguments.trace,
        verbose=arguments.verbose,
        quiet=arguments.quiet,
        json=arguments.json,
    )
    return run.command(run_arguments, recipes=tuple([*further, recipe] if is_own and about else further))
