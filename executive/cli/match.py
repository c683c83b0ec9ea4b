"""``planlang match``: whether a robot has what a recipe requires, with the reasons."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from executive.cli.authoring_arguments import MatchArguments
from executive.cli.console import Answer, ExitCode
from executive.modules.bundled import performed_by
from executive.robots import bind_robot, possessions_of
from executive.robots.matching import Possessions
from executive.robots.robot import claims_of, parts_of, read_self_model
from executive.robots.tasks import match
from executive.runs.files import check_files, check_trusted, chosen, programs, read_recipe_file, refuse
from planlang.diagnostics import BadInput, Diagnostic, Span, has_errors, note
from planlang.files import Bundled
from planlang.ontology import Ontology, expand, load
from planlang.recipe import Actions, RecipeSet, read_recipe
from planlang.recipe.reading import choose_task, named_action

EXIT_CODES = {True: ExitCode.DONE, False: ExitCode.MISSING_CAPABILITY, None: ExitCode.FAILED}
"""Exit codes for feasible, infeasible and unknown."""


def command(arguments: MatchArguments) -> Answer:
    """Compare a robot with a recipe; without a URDF, by its self-model alone. Raises BadInput."""
    file = read_recipe_file(arguments.recipe)
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf, modules=arguments.modules)
    check_trusted(problems, programs(file, arguments.modules), trust=arguments.trust)
    robot = chosen(Bundled.ROBOT, arguments.robot, "amigo" if file.is_bundled else None, problems)
    refuse(problems)
    assert robot is not None
    folders = arguments.folders
    ontology = load(file.path, folders=folders)
    diagnostics: list[Diagnostic] = []
    task = _task(ontology, arguments.task, diagnostics)
    performed = performed_by(arguments.modules or (), diagnostics)
    possessions = possessions_in(robot, arguments.urdf, folders, diagnostics)
    matched = match(ontology, task, possessions, performed)
    code = ExitCode.BAD_INPUT if has_errors(diagnostics) else EXIT_CODES[matched.feasible]
    return Answer(
        code, tuple(diagnostics), "\n".join(matched.lines()), {"task": matched.tree.text, **matched.as_json()}
    )


def _task(ontology: Ontology, name: str | None, diagnostics: list[Diagnostic]) -> RecipeSet | str:
    """Recipe of the task; for an action class without one, its IRI."""
    actions, span = Actions(ontology), Span(str(ontology.documents[0].path))
    reading = read_recipe(actions, name)
    if reading.recipes is not None:
        diagnostics += reading.diagnostics
        return reading.recipes
    others = [one for one in reading.diagnostics if one.code != "R004"]
    if name is None or has_errors(others):
        raise BadInput(reading.diagnostics)
    diagnostics += others
    iri = named_action(reading.actions, name, span)
    return iri if reading.actions.ontology.is_a(iri, expand("knowrob:Event")) else choose_task(reading.actions, name)


def possessions_in(
    robot: Path, urdf: Path | None, folders: Sequence[Path], diagnostics: list[Diagnostic]
) -> Possessions:
    """What a robot has, from its self-model alone without a URDF; appends to ``diagnostics``. Raises BadInput."""
    try:
        bound = bind_robot(robot, urdf=urdf, folders=folders)
    except BadInput as problem:
        if urdf is not None or {one.code for one in problem.diagnostics if has_errors([one])} != {"B008"}:
            raise
        model = read_self_model(load(robot, folders=folders))
        advice = "with --urdf FILE, its claims are compared with its arms and grippers"
        diagnostics.append(
            note("B008", f"{model.name} has no URDF: compared by its self-model alone", model.span, advice)
        )
        return Possessions(model.name, parts_of(model), claims_of(model), model)
    diagnostics += bound.diagnostics
    return possessions_of(bound)
