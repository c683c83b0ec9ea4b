"""``planlang match``: whether a robot has what a recipe requires, with the reasons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from executive.cli.console import BAD_INPUT, DONE, MISSING_CAPABILITY, Answer
from executive.robots import bind_robot
from executive.robots.matching import Judge, Possessions, possessions_of
from executive.robots.parts import claims_of, parts_of
from executive.robots.remedies import with_remedies
from executive.robots.requirements import Semantics
from executive.robots.self_model import read_self_model
from executive.robots.tasks import match
from planlang.diagnostics import BadInput, Diagnostic, has_errors, note
from planlang.ontology import Ontology, load
from planlang.recipe import Actions, read_recipe

LARGEST_LIBRARY = 200
"""Files of the ``--ontologies`` folders in which what is missing is looked for."""


def compare(
    recipe: Path,
    robot: Path,
    *,
    urdf: Path | None = None,
    environment: Path | None = None,
    folders: Sequence[Path] = (),
    task: str | None = None,
    semantics: Semantics = Semantics.CLOSURE,
) -> Answer:
    """Compare, and explain. The exit code tells: 0 nothing is missing, 3 something is, 2 the recipe has errors.

    A robot for which there is no URDF is judged by its self-model alone.
    """
    ontology = load(recipe, folders=folders)
    reading = read_recipe(Actions(ontology), task, allow_abstract=True)
    found = [*reading.diagnostics]
    if reading.recipes is None:
        raise BadInput(found)
    possessions = _possessions(robot, urdf, folders, found)
    compared = match(ontology, reading.recipes, possessions, semantics)
    if compared.feasible is not True and semantics is Semantics.CLOSURE:
        knowledge = (ontology, *_knowledge(possessions, environment, folders))
        compared = with_remedies(compared, Judge(ontology, possessions, semantics), knowledge)
    code = DONE if compared.feasible is not False else MISSING_CAPABILITY
    if has_errors(found):
        code = BAD_INPUT
    return Answer(code, tuple(found), "\n".join(compared.lines()), {"task": compared.tree.text, **compared.as_json()})


def _possessions(robot: Path, urdf: Path | None, folders: Sequence[Path], found: list[Diagnostic]) -> Possessions:
    try:
        bound = bind_robot(robot, urdf=urdf, folders=folders)
    except BadInput as problem:
        if urdf is not None or {one.code for one in problem.diagnostics if has_errors([one])} != {"B008"}:
            raise
        model = read_self_model(load(robot, folders=folders))
        advice = "with --urdf FILE, what it claims is compared with its arms and grippers"
        found.append(
            note("B008", f"there is no URDF of {model.name}: judged by its self-model alone", model.span, advice)
        )
        return Possessions(model.name, parts_of(model), claims_of(model), model)
    found += bound.diagnostics
    return possessions_of(bound)


def _knowledge(robot: Possessions, environment: Path | None, folders: Sequence[Path]) -> Iterator[Ontology]:
    """Where what is missing is looked for: the robot's own file, the environment, and the folders, leniently."""
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
