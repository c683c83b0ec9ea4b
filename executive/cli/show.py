"""``planlang show``: the contents of a recipe, plan, trace, map or robot as text, and as a picture or page."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace as changed
from functools import partial
from pathlib import Path
from typing import Any

import click

from executive.cli import inspect, report
from executive.cli.arguments import ReportArguments
from executive.cli.authoring_arguments import ShowArguments
from executive.cli.check import answer_of
from executive.cli.console import Answer
from executive.commands.check import check
from executive.live.terminal import TerminalTree
from executive.maps import read_map, scene_of
from executive.options.declaring import check_written
from executive.options.recipes import CheckOptions
from executive.pictures.scene_picture import save_picture
from executive.robots import bind_robot
from executive.runs.ending import ending_of
from executive.runs.files import folders_beside, read, refuse
from executive.runs.traces import recorded_run
from planlang.compiler import compile_recipe
from planlang.designators import local_name
from planlang.diagnostics import BadInput, error
from planlang.files import Bundled, beginning
from planlang.language.recovery import explain
from planlang.language.source import PlanSource
from planlang.ontology import load
from planlang.outputs import PNG, replace
from planlang.recipe.model import Recipe, RecipeSet
from planlang.recipe.order import recipe_order
from planlang.records import dataclass
from planlang.report import Told
from planlang.report.wording import Wording
from planlang.runs.codec import load_failure
from planlang.spelling import guess
from sim import PyBulletWorld, Scene
from sim.scene import RobotBody

_PAGE, _GRAPH = (".html",), (".svg", ".png", ".dot", ".mmd")


@dataclass(frozen=True, slots=True)
class Shown:
    """Contents of a file; ``draw`` draws them to a file with one of the ``suffixes`` (None: text only)."""

    answer: Answer
    suffixes: tuple[str, ...] = ()
    draw: Callable[[Path], object] | None = None
    has_view: bool = False
    """True if the drawing has a viewpoint."""


def command(arguments: ShowArguments) -> Answer:
    """Show the contents of a file. Raises BadInput."""
    path, show = _kind(arguments.file)
    output = arguments.output
    refuse(check_written(arguments, ShowArguments, {"the file": path}))
    shown = show(path, arguments)
    diagnostics = (*folders_beside(arguments.file), *shown.answer.diagnostics)
    shown = changed(shown, answer=changed(shown.answer, diagnostics=diagnostics))
    if output is None and arguments.view is None:
        return shown.answer
    _check_drawn(shown, arguments)
    if output is not None and shown.draw is not None:
        shown.draw(output)
        data = {**shown.answer.data, "output": str(output)}
        return changed(shown.answer, text=f"{shown.answer.text}\n{output}", data=data)
    return shown.answer


def _check_drawn(shown: Shown, arguments: ShowArguments) -> None:
    """Raise BadInput or a usage error for a format or viewpoint that does not fit the file."""
    output, view, formats = arguments.output, arguments.view, ", ".join(shown.suffixes) or "text only"
    if output is not None and output.suffix.lower() not in shown.suffixes:
        message = f"{arguments.file} cannot be drawn as {output.suffix or output.name}; formats: {formats}"
        raise BadInput([error("C014", message)])
    if view is not None and not (shown.has_view and output is not None):
        raise click.BadParameter("--view needs --output, and a map or a robot")


def _kind(name: str) -> tuple[Path, Callable[[Path, ShowArguments], Shown]]:
    """Find a file by its name, and the function that shows it. Raises BadInput."""
    path = Path(name)
    if (kind := Bundled.of(name)) is None and not os.path.exists(name):  # False also for a text that cannot be a path
        advice = guess(name, (other for one in Bundled for other in one.names()))
        help = f"{advice}planlang list robots, rooms or recipes lists the bundled ones"
        raise BadInput([error("C001", f"no such file: {name[:80]}", help=help)])
    if kind is not None:
        return kind.find(name), _robot if kind is Bundled.ROBOT else _recipe_or_other
    if path.suffix.lower() in (".toml", ".urdf"):
        return Bundled.ROBOT.find(name), _robot
    path = Bundled.RECIPE.find(name)
    if beginning(path, 8).startswith("{"):
        return path, _trace
    return path, _plan if isinstance(read(name), PlanSource) else _recipe_or_other


# Recipes and maps


def _recipe_or_other(path: Path, arguments: ShowArguments) -> Shown:
    """Show a recipe; a file without one is a map, or else the self-model of a robot."""
    try:
        return _recipe_or_map(path, arguments)
    except BadInput as problem:
        if _is_of_map(problem):
            raise
        try:
            return _robot(path, arguments)
        except BadInput:
            raise problem from None


def _recipe_or_map(path: Path, arguments: ShowArguments) -> Shown:
    to_check = CheckOptions(
        file=path,
        task=arguments.task,
        ontologies=arguments.ontologies,
        ignore_unread=arguments.ignore_unread,
        lists_contents=True,
    )
    answer = answer_of(check(to_check))
    if answer.data["kind"] == "map":
        return Shown(answer, PNG, partial(_draw_map, path, arguments), has_view=True)
    plan = compile_recipe(path, task=arguments.task, folders=arguments.folders)
    text = "\n".join((f"{path}: the recipe {plan.task}", *recipe_lines(plan.recipes)))
    return Shown(changed(answer, text=text), _GRAPH, partial(plan.graph.save, force=True))


def _is_of_map(problem: BadInput) -> bool:
    """Check whether a file is a map that cannot be read, and not something else."""
    return any(one.code.startswith("M") for one in problem.diagnostics)


def recipe_lines(recipes: RecipeSet) -> Iterator[str]:
    """Yield the steps of a task in a feasible order, with those of a step's own recipe below it."""

    def lines(recipe: Recipe, depth: int, around: tuple[str, ...]) -> Iterator[str]:
        order = recipe_order(recipe)
        for step in sorted(recipe.steps, key=lambda step: order.earlier(step.iri)):
            lack = "  (nothing performs it)" if step.is_abstract else ""
            yield f"{'  ' * depth}{local_name(step.iri)}  {step.label or local_name(step.action)}{lack}"
            for one in step.recipes:
                if one in recipes.recipes and one not in around:
                    yield from lines(recipes.recipes[one], depth + 1, (*around, one))

    yield from lines(recipes.main, 1, (recipes.task,))


def _draw_map(path: Path, arguments: ShowArguments, output: Path) -> None:
    ontology = load(path, folders=arguments.folders)
    scene = scene_of(read_map(ontology, ignore_unread=arguments.ignore_unread), [])
    _draw_world(scene, None, arguments.view or "overview", output)


def _draw_world(scene: Scene, robot: RobotBody | None, view: str | None, output: Path) -> None:
    with closing(PyBulletWorld(scene, robot)) as world:
        replace(output, lambda temporary: save_picture(temporary, world, view=view))


# Robots


def _robot(path: Path, arguments: ShowArguments) -> Shown:
    robot = bind_robot(path, folders=arguments.folders)
    if path.suffix.lower() == ".urdf" and not robot.arms and robot.base.fixed:
        try:
            return _recipe_or_map(path, arguments)  # a world
        except BadInput as problem:
            if _is_of_map(problem):
                raise
    body = robot.body()
    answer = Answer(
        diagnostics=robot.diagnostics,
        text="\n".join(inspect.summary(robot, path)),
        data={"kind": "robot", "robot": robot.name, "arms": [arm.name for arm in robot.arms]},
    )
    return Shown(answer, PNG, partial(_draw_world, Scene(()), body, arguments.view), has_view=True)


# Plans


def _plan(path: Path, arguments: ShowArguments) -> Shown:
    """Show a plan file: whether it is up to date, and its functions with what they perform and raise."""
    plan = read(str(path))
    assert isinstance(plan, PlanSource)
    answer = answer_of(check(CheckOptions(file=path, ontologies=arguments.ontologies)))
    state = str(answer.text).partition("\n")[0]
    return Shown(changed(answer, text="\n".join((state, *_plan_lines(plan)))))


def _plan_lines(plan: PlanSource) -> Iterator[str]:
    """Yield the plan functions, each with its actions and plan calls in the order of the source."""
    for function in plan.functions:
        if function.is_plan:
            yield f"{function.name}({', '.join(function.parameters)})  {function.summary}".rstrip()
            for step in plan.steps:
                if step.function == function.name:
                    name = f"{step.name}: " if step.name is not None else ""
                    yield f"  {name}{step.what}{'()' * step.is_call}  line {step.line}"


# Traces


def _trace(path: Path, arguments: ShowArguments) -> Shown:
    recorded = recorded_run(path)
    told, tree = Told.of(line.record for line in recorded.lines), TerminalTree(inner=arguments.verbose)
    for line in recorded.lines:
        tree.heard(line.record, None)
    header, outcome = recorded.header, recorded.outcome or "interrupted"
    where = ", ".join(str(header[name]) for name in ("robot", "map") if name in header)
    seconds = recorded.last / float(header.get("rate", 1))
    message = next((one.reason for one in told.tree.roots if one.failure is not None), "")
    ending = ending_of(told, Wording(), outcome, message, seconds, ())
    explained = _explained(told, (line.record for line in recorded.lines)) if outcome == "failed" else None
    text = "\n".join(
        (
            f"{path}: a run of {header.get('plan', 'a plan')}{where and ' with '}{where}",
            *(f"  {line}" for line in tree.lines()),
            *(ending if explained is None else (ending[0], explained)),
        )
    )
    to_report = ReportArguments(
        trace=path, ontologies=arguments.ontologies, force=arguments.force, json=arguments.json, quiet=arguments.quiet
    )
    answer = Answer(text=text, data={"kind": "trace", "outcome": outcome, "seconds": seconds})
    return Shown(answer, _PAGE, lambda output: report.command(changed(to_report, output=output)))


def _explained(told: Told, records: Iterable[Mapping[str, Any]]) -> str | None:
    """The failure that ended the run, as ``planlang run`` prints it; None if the trace does not keep all of it."""
    messages = {one.failure["message"] for one in told.tree.roots if one.failure is not None}
    text = None
    for record in records:
        if "fields" in (record.get("failure") or ()):
            try:
                failure = load_failure(record["failure"])
            except ValueError:  # a class of failures that the plan defines, which is not imported
                continue
            text = explain(failure) if str(failure) in messages else text
    return text
