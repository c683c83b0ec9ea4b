"""``planlang match``: whether a robot has what a recipe requires, with the reasons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from executive.cli.arguments import (
    Recipe,
    Robot,
    TaskArguments,
    Urdf,
    check_files,
    chosen,
    read_recipe_file,
    refuse,
    taking,
)
from executive.cli.console import Answer, ExitCode, answer
from planlang.diagnostics import BadInput, Diagnostic, has_errors, note
from planlang.resources import Bundled

if TYPE_CHECKING:
    from executive.robots.matching import Possessions
    from planlang.ontology import Ontology

LARGEST_LIBRARY = 200
"""Files of the ``--ontologies`` folders that are searched for missing things: more would take minutes."""


class Reading(Enum):
    """How requirements are read: closed under dependencies, or as KnowRob did."""

    CLOSURE = "closure"
    ORIGINAL = "original"


@dataclass(frozen=True, kw_only=True)
class MatchArguments(TaskArguments):
    """Arguments of ``planlang match``."""

    recipe: Recipe
    robot: Robot = None
    urdf: Urdf = None
    environment: Annotated[
        str | None,
        typer.Option(metavar="MAP", help="A map's file, or a bundled one: also look for missing things there."),
    ] = None
    semantics: Annotated[Reading, typer.Option(help="How requirements are read; original: as KnowRob did.")] = (
        Reading.CLOSURE
    )


@taking(MatchArguments)
def match_command(arguments: MatchArguments) -> None:
    """Tell whether a robot has what a recipe requires, and why.

    Missing things are looked for in the ontologies at hand. Exit code 3 if something is missing.
    """
    answer("match", lambda: _matched(arguments), as_json=arguments.json)


def _matched(arguments: MatchArguments) -> Answer:
    """Compare, and explain; a robot without URDF is judged by its self-model alone."""
    from executive.robots import Semantics, match
    from executive.robots.matching import Judge
    from executive.robots.tasks import with_remedies
    from planlang.ontology import load
    from planlang.recipe import Actions, read_recipe

    file = read_recipe_file(arguments.recipe)
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf)
    robot = chosen(Bundled.ROBOT, arguments.robot, "amigo" if file.is_bundled else None, problems)
    environment = None
    if arguments.environment is not None:
        environment = chosen(Bundled.ENVIRONMENT, arguments.environment, None, problems)
    refuse(problems)
    assert robot is not None
    folders, semantics = arguments.folders, Semantics(arguments.semantics.value)
    ontology = load(file.path, folders=folders)
    reading = read_recipe(Actions(ontology), arguments.task, allow_abstract=True)
    found = [*reading.diagnostics]
    if reading.recipes is None:
        raise BadInput(found)
    possessions = _possessions(robot, arguments.urdf, folders, found)
    matched = match(ontology, reading.recipes, possessions, semantics)
    if matched.feasible is not True and semantics is Semantics.CLOSURE:
        knowledge = (ontology, *_knowledge(possessions, environment, folders))
        matched = with_remedies(matched, Judge(ontology, possessions, semantics), knowledge)
    code = ExitCode.DONE if matched.feasible is not False else ExitCode.MISSING_CAPABILITY
    if has_errors(found):
        code = ExitCode.BAD_INPUT
    return Answer(code, tuple(found), "\n".join(matched.lines()), {"task": matched.tree.text, **matched.as_json()})


def _possessions(robot: Path, urdf: Path | None, folders: Sequence[Path], found: list[Diagnostic]) -> Possessions:
    from executive.robots import bind_robot, possessions_of
    from executive.robots.matching import Possessions
    from executive.robots.self_model import claims_of, parts_of, read_self_model
    from planlang.ontology import load

    try:
        bound = bind_robot(robot, urdf=urdf, folders=folders)
    except BadInput as problem:
        if urdf is not None or {one.code for one in problem.diagnostics if has_errors([one])} != {"B008"}:
            raise
        model = read_self_model(load(robot, folders=folders))
        advice = "with --urdf FILE, its claims are compared with its arms and grippers"
        found.append(
            note("B008", f"there is no URDF of {model.name}: judged by its self-model alone", model.span, advice)
        )
        return Possessions(model.name, parts_of(model), claims_of(model), model)
    found += bound.diagnostics
    return possessions_of(bound)


def _knowledge(robot: Possessions, environment: Path | None, folders: Sequence[Path]) -> Iterator[Ontology]:
    """Yield the ontologies that are searched for missing things; those that cannot be read are left out."""
    from planlang.ontology import load

    if robot.model is not None:
        yield robot.model.ontology
    if environment is not None:
        yield load(environment, folders=folders)
    files = sorted(path for folder in folders for path in folder.iterdir() if path.is_file())
    for path in files[:LARGEST_LIBRARY]:
        try:
            yield load(path, folders=folders)
        except BadInput:
            continue
