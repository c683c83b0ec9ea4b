"""Commands about recipes and plans: compile, check, convert, match. What is heavy is imported when it is needed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from executive.cli.console import BAD_INPUT, Answer, answer
from executive.cli.graph_files import check_graph, write_graph
from executive.cli.inputs import PlanFile, RecipeFile, find, read
from executive.cli.options import (
    AllowAbstract,
    AsJson,
    Ontologies,
    RecipeArgument,
    RecipeOrPlan,
    Task,
    compiled,
    named,
    recipe_file,
    refuse,
)
from executive.cli.outputs import check_outputs, write_plan, write_text
from planlang.diagnostics import Diagnostic, error, has_errors
from planlang.resources import bundled

if TYPE_CHECKING:
    pass


def compile_command(
    recipe: RecipeArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the plan here, not to stdout.")
    ] = None,
    graph: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the order of the steps, too: a .svg, .html, .dot or .mmd (Mermaid)."),
    ] = None,
    task: Task = None,
    ontologies: Ontologies = None,
    allow_abstract: AllowAbstract = False,
    scopes: Annotated[
        bool, typer.Option("--scopes/--no-scopes", help="Open a location scope at each base motion.")
    ] = True,
    data_flow: Annotated[
        bool, typer.Option("--dataflow/--no-dataflow", help="Order steps by what they hand on, and hand it on.")
    ] = True,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a plan that was edited by hand.")] = False,
    json: AsJson = False,
) -> None:
    """Compile a recipe to a plan in Python."""

    def work() -> Answer:
        file = recipe_file(recipe)
        problems = check_outputs({"--output": output, "--graph": graph}, {"the recipe": file.path})
        refuse([*problems, *check_graph(graph)])
        options = {"scopes": scopes, "data_flow": data_flow}
        plan = compiled(file, task=task, ontologies=ontologies, allow_abstract=allow_abstract, **options)
        if output is not None:
            write_plan(output, plan.source, force=force)
        if graph is not None:
            write_graph(graph, plan)
        data: dict[str, Any] = {"task": plan.task, "functions": list(plan.functions)}
        data |= {"graph": str(graph)} if graph is not None else {}
        data |= {"plan": str(output)} if output is not None else {"source": plan.source}
        text = plan.source if output is None else f"{output}: {plan.task}"
        return Answer(diagnostics=plan.diagnostics, text=text, data=data)

    answer("compile", work, as_json=json)


def check_command(
    file: RecipeOrPlan,
    fix: Annotated[
        bool,
        typer.Option("--fix", help="Write a copy, NAME.fixed.EXT, with what is safe to fix, and show the changes."),
    ] = False,
    accept: Annotated[
        list[str] | None,
        typer.Option(metavar="CODE", help="With --fix: do what is not safe for this code, too; repeatable."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="With --fix: write the copy here.")
    ] = None,
    task: Task = None,
    ontologies: Ontologies = None,
    allow_abstract: AllowAbstract = False,
    json: AsJson = False,
) -> None:
    """Check a recipe or a plan; nothing is run.

    Of a recipe: everything that is wrong with it. Of a plan: whether its recipe or the compiler has changed since, or
    it was edited, and how a fresh compile differs from it.
    """
    if not fix and (accept or output):
        raise typer.BadParameter("--accept and --output need --fix")

    def work() -> Answer:
        if fix:
            from executive.cli.fixing import fix as fixed

            folders = tuple(ontologies or ())
            return fixed(
                recipe_file(file), output, accept or (), task=task, folders=folders, allow_abstract=allow_abstract
            )
        match read(file):
            case RecipeFile() as found:
                plan = compiled(found, task=task, ontologies=ontologies, allow_abstract=allow_abstract)
                text = f"{found.path}: {plan.task} compiles"
                return Answer(diagnostics=plan.diagnostics, text=text, data={"kind": "recipe", "task": plan.task})
            case PlanFile() as found:
                from executive.cli.freshness import freshness

                fresh = freshness(found, folders=tuple(ontologies or ()))
                code = BAD_INPUT if has_errors(fresh.diagnostics) else 0
                text = "\n".join(filter(None, (f"{found.path}: {fresh.state}", fresh.difference)))
                data = {"kind": "plan", "state": fresh.state, "difference": fresh.difference}
                return Answer(code, fresh.diagnostics, text, data)

    answer("check", work, as_json=json)


def convert_command(
    file: Annotated[str, typer.Argument(metavar="FILE", help="An ontology's file, in any syntax that is read.")],
    to: Annotated[
        str, typer.Option("--to", metavar="SYNTAX", help="manchester, turtle, ntriples or rdfxml.", show_default=False)
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the text here, not to stdout.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Write an ontology, such as a recipe, in another syntax; what does not survive that is told."""
    from planlang.ontology.writing import Target, convert

    if to not in [target.value for target in Target]:
        raise typer.BadParameter(f"{to!r} is none of {', '.join(target.value for target in Target)}", param_hint="--to")

    def work() -> Answer:
        path = find("recipe", file, bundled("recipes"))
        refuse(check_outputs({"--output": output}, {"the file": path}))
        converted = convert(path, Target(to))
        if output is not None:
            write_text(output, converted.text)
        data: dict[str, Any] = {"output": str(output)} if output is not None else {"source": converted.text}
        text = converted.text if output is None else f"{output}: {len(converted.triples)} statements"
        return Answer(diagnostics=converted.diagnostics, text=text, data=data)

    answer("convert", work, as_json=json)


def match_command(
    recipe: RecipeArgument,
    robot: Annotated[
        str | None, typer.Option(metavar="ROBOT", help="A robot's file, or a bundled robot's name.")
    ] = None,
    urdf: Annotated[Path | None, typer.Option(metavar="FILE", help="The robot's URDF.")] = None,
    environment: Annotated[
        str | None,
        typer.Option(metavar="MAP", help="A map's file, or a bundled one: look for what is missing there, too."),
    ] = None,
    semantics: Annotated[
        str, typer.Option(metavar="closure|original", help="How requirements are read; original: as KnowRob did.")
    ] = "closure",
    task: Task = None,
    ontologies: Ontologies = None,
    json: AsJson = False,
) -> None:
    """Tell whether a robot has what a recipe requires, and why.

    What is missing is looked for in the ontologies at hand. Exit code 3 if something is missing.
    """
    if semantics not in ("closure", "original"):
        raise typer.BadParameter(f"--semantics is closure or original, not {semantics!r}")

    def work() -> Answer:
        from executive.cli.feasibility import compare
        from executive.robots import Semantics

        file = recipe_file(recipe)
        problems: list[Diagnostic] = []
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        self_model = named("robot", robot, "robots", "amigo", file.is_bundled, problems)
        place = None
        if environment is not None:
            place = named("environment", environment, "environments", "", False, problems)
        refuse(problems)
        assert self_model is not None
        return compare(
            file.path,
            self_model,
            urdf=urdf,
            environment=place,
            folders=tuple(ontologies or ()),
            task=task,
            semantics=Semantics(semantics),
        )

    answer("match", work, as_json=json)
