"""The command ``planlang``: compile, check, run. What is heavy is imported when a command needs it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from executive.console import BAD_INPUT, Answer, answer, say, show
from executive.graph_files import check_graph, write_graph
from executive.headers import Told
from executive.inputs import PlanFile, RecipeFile, find, names, read
from executive.outputs import check_outputs, write_plan, write_text
from planlang.diagnostics import BadInput, Diagnostic, Span, error, has_errors
from planlang.resources import bundled

if TYPE_CHECKING:
    from executive.running import RunResult
    from planlang.compiler import CompiledPlan

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Compile OWL action recipes to robot plans and run them in a simulated world.",
    epilog="Exit codes: 0 done, 1 the plan failed, 2 bad input, 3 the robot lacks a capability, 130 interrupted.",
)

robot_app = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="About robots.")
app.add_typer(robot_app, name="robot")

RecipeArgument = Annotated[str, typer.Argument(metavar="RECIPE", help="A recipe's file, or a bundled recipe's name.")]
RecipeOrPlan = Annotated[
    str, typer.Argument(metavar="RECIPE|PLAN", help="A recipe's or plan's file, or a bundled recipe's name.")
]
Task = Annotated[
    str | None,
    typer.Option(
        "--task", metavar="CLASS", help="The task to compile: local name or IRI of an action class in the recipe."
    ),
]
Ontologies = Annotated[
    list[Path] | None,
    typer.Option("--ontologies", metavar="DIR", help="Look for imported files here, too; repeatable."),
]
AllowAbstract = Annotated[
    bool, typer.Option("--allow-abstract", help="Steps that nothing can execute are warnings, not errors.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object to stdout.")]


@app.callback(invoke_without_command=True)
def planlang(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Compile OWL action recipes to robot plans and run them in a simulated world."""
    if version:
        from importlib.metadata import version as installed_version

        typer.echo(f"planlang {installed_version('planlang')}")
        raise typer.Exit


@app.command("compile", epilog="Example: planlang compile serve_a_drink -o serve_a_drink.py --graph serve_a_drink.svg")
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
        file = _recipe(recipe)
        problems = check_outputs({"--output": output, "--graph": graph}, {"the recipe": file.path})
        _refuse([*problems, *check_graph(graph)])
        options = {"scopes": scopes, "data_flow": data_flow}
        plan = _compile(file, task=task, ontologies=ontologies, allow_abstract=allow_abstract, **options)
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


@app.command("check", epilog="Example: planlang check my_recipe.owl --ontologies ../ontologies --fix")
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
            from executive.fixing import fix as fixed

            folders = tuple(ontologies or ())
            return fixed(_recipe(file), output, accept or (), task=task, folders=folders, allow_abstract=allow_abstract)
        match read(file):
            case RecipeFile() as found:
                plan = _compile(found, task=task, ontologies=ontologies, allow_abstract=allow_abstract)
                text = f"{found.path}: {plan.task} compiles"
                return Answer(diagnostics=plan.diagnostics, text=text, data={"kind": "recipe", "task": plan.task})
            case PlanFile() as found:
                from executive.freshness import freshness

                fresh = freshness(found, folders=tuple(ontologies or ()))
                code = BAD_INPUT if has_errors(fresh.diagnostics) else 0
                text = "\n".join(filter(None, (f"{found.path}: {fresh.state}", fresh.difference)))
                data = {"kind": "plan", "state": fresh.state, "difference": fresh.difference}
                return Answer(code, fresh.diagnostics, text, data)

    answer("check", work, as_json=json)


@app.command("convert", epilog="Example: planlang convert my_recipe.owl --to manchester -o my_recipe.omn")
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
        _refuse(check_outputs({"--output": output}, {"the file": path}))
        converted = convert(path, Target(to))
        if output is not None:
            write_text(output, converted.text)
        data: dict[str, Any] = {"output": str(output)} if output is not None else {"source": converted.text}
        text = converted.text if output is None else f"{output}: {len(converted.triples)} statements"
        return Answer(diagnostics=converted.diagnostics, text=text, data=data)

    answer("convert", work, as_json=json)


@app.command("match", epilog="Example: planlang match serve_a_drink --robot amigo")
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
        from executive.capabilities import Semantics
        from executive.feasibility import compare

        file = _recipe(recipe)
        problems: list[Diagnostic] = []
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        self_model = _named("robot", robot, "robots", "amigo", file.is_bundled, problems)
        place = None
        if environment is not None:
            place = _named("environment", environment, "environments", "", False, problems)
        _refuse(problems)
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


@app.command(
    "run",
    epilog="Example: planlang run serve_a_drink --seed 3 --trace run.jsonl --picture scene.png",
)
def run_command(
    file: Annotated[
        str | None,
        typer.Argument(metavar="RECIPE|PLAN", help="A recipe's or plan's file, or a bundled recipe's name."),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(metavar="ROBOT", help="The robot's self-model: a file, or a bundled robot's name."),
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The robot's geometry, if the self-model does not name it.")
    ] = None,
    environment: Annotated[
        str | None,
        typer.Option(metavar="MAP", help="The semantic map: a file, or a bundled environment's name."),
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y,YAW", help="Where the robot starts [m, m, rad]; default: the middle.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=OBJECT", help="Bind a parameter of the plan to an object; repeatable."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Moves the true world away from the map; 0 leaves it.")
    ] = None,
    schedule: Annotated[
        int | None,
        typer.Option(min=0, metavar="K", help="Run concurrent tasks in another order, the same for the same number."),
    ] = None,
    gui: Annotated[bool, typer.Option("--gui", help="Show the world in a window.")] = False,
    trace: Annotated[Path | None, typer.Option(metavar="FILE", help="Write what happened, as JSON Lines.")] = None,
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a picture of the end, as PNG.")] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a recording for rerun (needs planlang[record]).")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="TRACE", help="Go on with the run of this trace after the last step of the plan that completed."
        ),
    ] = None,
    world_as_left: Annotated[
        bool,
        typer.Option("--world-as-left", help="With --resume: the world is as the trace left it; do not bring it back."),
    ] = False,
    task: Task = None,
    ontologies: Ontologies = None,
    allow_abstract: AllowAbstract = False,
    force: Annotated[bool, typer.Option("--force", help="Run although the robot lacks a capability.")] = False,
    json: AsJson = False,
) -> None:
    """Run a plan or a recipe in a simulated world.

    A run that was interrupted is resumed by planlang run PLAN --resume TRACE: seed, start and parameters are those of
    the trace, as are plan, robot and environment where they are bundled ones.
    """
    if file is None and resume is None:
        raise typer.BadParameter("name a recipe or plan, or --resume TRACE")
    if world_as_left and resume is None:
        raise typer.BadParameter("--world-as-left needs --resume")
    base = _planar(start)
    bindings = _bindings(set_ or [])

    def work() -> Answer:
        recorded, told = None, Told()
        if resume is not None:
            from executive.resuming import read_trace

            recorded, told = read_trace(resume)
        trace_file = trace or resume
        found = read(file or told.plan(str(resume)))
        outputs = {"--trace": trace_file, "--picture": picture, "--record": record}
        inputs = {"the plan": found.path, "--urdf": urdf}
        problems = check_outputs(outputs, inputs)
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        if record is not None:
            from executive.report.recording import missing

            problems += missing()
        if gui:
            from executive.display import no_display

            problems += no_display()
        is_bundled = isinstance(found, RecipeFile) and found.is_bundled
        self_model = _named("robot", robot or told.robot, "robots", "amigo", is_bundled, problems)
        environment_map = _named(
            "environment", environment or told.environment, "environments", "hospital_room", is_bundled, problems
        )
        _refuse(problems)

        from executive.running import RunOptions, run_plan_file

        options = RunOptions(
            plan=found.path if isinstance(found, PlanFile) else None,
            recipe=found.path if isinstance(found, RecipeFile) else None,
            task=task or told.task,
            ontologies=tuple(ontologies or ()),
            allow_abstract=allow_abstract,
            robot=self_model,
            urdf=urdf,
            environment=environment_map,
            start=base or told.start,
            bindings=bindings,
            seed=told.seed if seed is None else seed,
            schedule=told.schedule if schedule is None else schedule,
            gui=gui,
            trace=trace_file,
            picture=picture,
            record=record,
            force=force,
            resume=recorded,
            world_as_left=world_as_left,
            progress=(lambda line: None) if json else say,
            announce=(lambda found: None) if json else show,
        )
        return _ran(run_plan_file(options), told=not json)

    answer("run", work, as_json=json)


@app.command("replay", epilog="Example: planlang replay run.jsonl")
def replay_command(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="The trace of a run.")],
    file: Annotated[
        str | None,
        typer.Argument(metavar="[RECIPE|PLAN]", help="What was run; needed unless it is a bundled recipe."),
    ] = None,
    task: Task = None,
    ontologies: Ontologies = None,
    allow_abstract: AllowAbstract = False,
    json: AsJson = False,
) -> None:
    """Run a plan again on what is recorded of its run, without robot or world; stops at the first difference.

    The plan is told what it was told: what process modules did, where places were found, what was read and believed.
    """

    def work() -> Answer:
        from executive.replaying import replay_trace
        from executive.resuming import read_trace

        recorded, told = read_trace(trace)
        found = read(file or told.plan(str(trace)))
        return replay_trace(
            recorded,
            plan=found.path if isinstance(found, PlanFile) else None,
            recipe=found.path if isinstance(found, RecipeFile) else None,
            task=task or told.task,
            folders=tuple(ontologies or ()),
            allow_abstract=allow_abstract,
        )

    answer("replay", work, as_json=json)


@app.command(
    "locate",
    epilog='Example: planlang locate "in reach of the patient with the right arm" --robot amigo '
    "--environment hospital_room --explain where.png",
)
def locate_command(
    phrase: Annotated[
        str, typer.Argument(metavar="PHRASE", help='What the place is, e.g. "in reach of the bottle and near the bed".')
    ],
    robot: Annotated[
        str | None, typer.Option(metavar="ROBOT", help="The robot's self-model: a file, or a bundled robot's name.")
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The robot's geometry, if the self-model does not name it.")
    ] = None,
    environment: Annotated[
        str | None, typer.Option(metavar="MAP", help="The semantic map: a file, or a bundled environment's name.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y,YAW", help="Where the robot is [m, m, rad]; default: the middle.")
    ] = None,
    of: Annotated[
        str | None,
        typer.Option("--of", metavar="THING", help='What is to be put there, e.g. "the bottle"; default: the base.'),
    ] = None,
    count: Annotated[int, typer.Option(min=1, max=1000, metavar="N", help="How many places, best first.")] = 3,
    explain: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw what was looked at and what became of it, as PNG.")
    ] = None,
    ontologies: Ontologies = None,
    json: AsJson = False,
) -> None:
    """Find places for the robot's base, or for a thing, that a phrase tells."""
    base = _planar(start)

    def work() -> Answer:
        problems = check_outputs({"--explain": explain}, {"--urdf": urdf})
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        reason = "a place is looked for with --{what}"
        self_model = _named("robot", robot, "robots", "", False, problems, reason=reason)
        semantic_map = _named("environment", environment, "environments", "", False, problems, reason=reason)
        _refuse(problems)
        assert self_model is not None
        assert semantic_map is not None

        from executive.locating import LocateOptions, locate

        folders = tuple(ontologies or ())
        return locate(LocateOptions(phrase, self_model, semantic_map, urdf, folders, of, base, count, explain))

    answer("locate", work, as_json=json)


@robot_app.callback()
def robots_command() -> None:
    """About robots."""


@robot_app.command("inspect", epilog="Example: planlang robot inspect amigo --picture reach.png")
def inspect_command(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="A self-model or robot file, or a bundled robot's name.")
    ],
    urdf: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The robot's geometry, if the self-model does not name it.")
    ] = None,
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw what the arms reach, as PNG.")] = None,
    json: AsJson = False,
) -> None:
    """Show a robot's chains, joints, limits and postures, what its arms reach, and what is missing."""

    def work() -> Answer:
        source = find("robot", robot, bundled("ontologies") / "robots")
        problems = check_outputs({"--picture": picture}, {"the robot": source, "--urdf": urdf})
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        _refuse(problems)
        from executive.inspecting import InspectOptions, inspect

        return inspect(InspectOptions(source, urdf, picture, (lambda line: None) if json else say))

    answer("robot inspect", work, as_json=json)


def _ran(result: RunResult, *, told: bool) -> Answer:
    lines = [result.outcome, *result.final_state]
    data: dict[str, Any] = {
        "outcome": result.outcome,
        "failure": list(result.failure),
        "final_state": list(result.final_state),
        "plan_seconds": result.seconds,
    }
    text = "\n".join(line for line in lines if line)
    return Answer(result.exit_code, () if told else result.diagnostics, text, data)


def _recipe(name: str) -> RecipeFile:
    found = read(name)
    if isinstance(found, PlanFile):
        advice = f"planlang check {name} tells about a plan, planlang run {name} runs it"
        raise BadInput([error("C007", f"{name} is a plan already, not a recipe", Span(str(found.path)), advice)])
    return found


def _compile(
    file: RecipeFile,
    *,
    task: str | None,
    ontologies: list[Path] | None,
    allow_abstract: bool,
    scopes: bool = True,
    data_flow: bool = True,
) -> CompiledPlan:
    from planlang.compiler import compile_recipe

    return compile_recipe(
        file.path,
        task=task,
        folders=tuple(ontologies or ()),
        allow_abstract=allow_abstract,
        scopes=scopes,
        data_flow=data_flow,
    )


def _named(
    what: str,
    given: str | None,
    folder: str,
    default: str,
    is_bundled: bool,
    problems: list[Diagnostic],
    *,
    reason: str = "this plan needs --{what}; only bundled recipes have a default",
) -> Path | None:
    """The file of a robot or environment; bundled recipes have a default, all others need one."""
    place = bundled("ontologies") / folder
    if given is None and not is_bundled:
        advice = f"add --{what} FILE, or a bundled one: {', '.join(names(place))}"
        problems.append(error("C008", reason.format(what=what), help=advice))
        return None
    try:
        return find(what, given or default, place)
    except BadInput as bad:
        problems.extend(bad.diagnostics)
        return None


def _refuse(problems: list[Diagnostic]) -> None:
    if has_errors(problems):
        raise BadInput(problems)


def _planar(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    import math

    try:
        x, y, yaw = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not x,y,yaw; write for example --start 1.5,-0.2,3.14") from None
    if not all(map(math.isfinite, (x, y, yaw))):
        raise typer.BadParameter(f"{text!r} has a number that is not finite")
    return x, y, yaw


def _bindings(texts: Sequence[str]) -> dict[str, str]:
    bindings: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise typer.BadParameter(f"{text!r} is not NAME=OBJECT; write for example --set bottle=bottle2")
        if name in bindings:
            raise typer.BadParameter(f"{name!r} is set twice")
        bindings[name] = value
    return bindings
